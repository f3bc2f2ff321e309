"""Reaching through a plant: targets and outcomes (thesis 8.2)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np
from numpy.typing import ArrayLike

from mobee.arrays import Array, real_array
from mobee.errors import InvalidValue, UnknownName
from mobee.plant import Outcome, Plant

Aim = Literal["centre", "surface"]
AIMS = ("centre", "surface")
TARGET = "reach_target"  # name of the presented target in the plant's world
RADIUS = 0.05  # m, of the thesis' targets (8.3)
FARTHEST = 1e3  # m: farther than any robot sees, nearer than squares overflow


@dataclass(frozen=True, slots=True, eq=False)
class ReachTarget:
    """A place to put a marker: a sphere, which is in everybody's way but the reaching hand's.

    `position`: (3,) m, root frame, at most 1 km off.  `radius`: m, above 0.  `aim`: a marker is to come to its "centre" (thesis 8.2) or
    to its "surface".  `normal`: (3,), root frame, where the marker's normal is to point; None: anywhere.
    """

    position: Array
    radius: float = RADIUS
    aim: Aim = "centre"
    normal: Array | None = None

    def __post_init__(self) -> None:
        """Check; raises InvalidValue, UnknownName."""
        where = _triple(self.position, "position")
        if np.abs(where).max() > FARTHEST:
            raise InvalidValue(f"position {where.tolist()} of the target: must be within {FARTHEST:g} m of the root frame's origin")
        if not 0.0 < self.radius <= FARTHEST:
            raise InvalidValue(f"radius {self.radius!r} of the target: must be a length above 0 m, at most {FARTHEST:g} m")
        if self.aim not in AIMS:
            raise UnknownName("aim", self.aim, AIMS)
        object.__setattr__(self, "position", where)
        if self.normal is not None:
            normal = _triple(self.normal, "normal")
            length = float(np.linalg.norm(normal))
            if length == 0.0:
                raise InvalidValue("normal of the target: must not be all 0")
            object.__setattr__(self, "normal", normal / length)

    def missing(self, marker: Array) -> float:
        """How far a marker at (3,) m is from where it is to be [m]: |x - x*| of thesis eq. 8.4."""
        distance = float(np.linalg.norm(self.position - marker))
        return max(distance - self.radius, 0.0) if self.aim == "surface" else distance


@dataclass(frozen=True, slots=True, eq=False)
class ReachOutcome:
    """How a reach ended: when its force did, and after the part had been drawn back to its attractor.

    `marker`: (3,) m, where the model sees the marker at the end of the force, by the encoders then, `q` (n_part,) rad.
    `missing`: m, from where it was to be.  `settled`: False means that the reach itself timed out.  `duration`: s of plant
    time, of both.  `touched`: world objects in contact (fields included) at the end of the force.
    `after`: how the part came to rest again.
    """

    marker: Array
    q: Array
    missing: float
    settled: bool
    duration: float
    touched: tuple[str, ...]
    after: Outcome


class ReachPlant(Plant, Protocol):
    """A Plant that reaches."""

    def present(self, target: ReachTarget | None) -> None:
        """Put the target into the world as `TARGET`, role "target", or move it there; None takes it away."""
        ...

    def reach(self, part: str, marker: str, stay: bool = False) -> ReachOutcome:
        """Draw the marker to the presented target until the part has settled or timed out, then let it go (thesis 8.2).

        The attractor of the part is where its last action aimed, and draws it back when the force has ended.  `stay`: it does not,
        the attractor follows to where the reach ended, and `after` is that end.
        Raises InvalidValue if nothing is presented or the part does not move the marker; ActionInterrupted as `act`.
        """
        ...


def reward_of(missing: float, scale: float = 0.01) -> float:
    """1 / (1 + |x - x*|) (thesis eq. 8.4), the distance [m] in units of `scale` [m]; the thesis leaves the unit open."""
    return 1.0 / (1.0 + missing / scale)


def _triple(value: ArrayLike, what: str) -> Array:
    try:
        found = real_array(what, value)
    except InvalidValue:
        found = np.empty(0)
    if found.shape != (3,) or not np.isfinite(found).all():
        raise InvalidValue(f"{what} {value!r} of the target: must be three finite numbers, in m in the root frame")
    return found
