# SPDX-License-Identifier: Apache-2.0
"""Reaching through a plant: targets and outcomes (thesis 8.2)."""

from __future__ import annotations

import reprlib
from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np
from numpy.typing import ArrayLike

from mobee.arrays import Array, is_number, real_array
from mobee.errors import InvalidValue, UnknownName
from mobee.plant import Outcome, Plant

Aim = Literal["centre", "surface"]
AIMS = ("centre", "surface")
TARGET = "reach_target"  # name of the presented target in the plant's world
RADIUS = 0.05  # m, of the thesis' targets (8.3)
MAX_DISTANCE = 1e3  # m, of a target; larger squares could overflow


@dataclass(frozen=True, slots=True, eq=False)
class ReachTarget:
    """A sphere as a target for a marker (a named point with a normal on a link); it repels all links except the hand that reaches for it.

    `position`: (3,) m, root frame, centre of the sphere, at most 1 km away.  `radius`: m, above 0.  `aim`: the marker has to reach the
    "centre" (thesis 8.2) or the "surface" of the sphere.  `normal`: (3,), root frame, desired direction of the marker's normal, scaled to
    length 1; None: any.  `faces`: True: the desired direction of the normal is the direction from the marker to the centre, so that a
    palm turns towards its target.
    """

    position: Array
    radius: float = RADIUS
    aim: Aim = "centre"
    normal: Array | None = None
    faces: bool = False

    def __post_init__(self) -> None:
        """Check all fields and scale the normal to length 1; raises InvalidValue, or UnknownName for an unknown `aim`."""
        where = _triple(self.position, "position")
        if np.abs(where).max() > MAX_DISTANCE:
            raise InvalidValue(f"position {where.tolist()} of the target: must be within {MAX_DISTANCE:g} m of the root frame's origin")
        if not (is_number(self.radius) and 0.0 < self.radius <= MAX_DISTANCE):
            raise InvalidValue(f"radius {self.radius!r} of the target: must be a length above 0 m, at most {MAX_DISTANCE:g} m")
        if self.aim not in AIMS:
            raise UnknownName("aim", self.aim, AIMS)
        if self.faces and self.normal is not None:
            raise InvalidValue("target with a normal that also faces it: give a direction of the marker's normal, or faces=True, not both")
        object.__setattr__(self, "position", where + 0.0)  # -0 and 0 are one position, also where its bytes are the key
        if self.normal is not None:
            normal = _triple(self.normal, "normal")
            longest = float(np.abs(normal).max())
            if longest == 0.0:
                raise InvalidValue("normal of the target: must not be all 0")
            normal = np.ldexp(normal, -int(np.frexp(longest)[1]))  # an exact scaling, after which its square does not overflow or become 0
            object.__setattr__(self, "normal", normal / float(np.linalg.norm(normal)))

    def missing(self, marker: Array) -> float:
        """Return the remaining distance [m] from a marker at `marker` (3,) m, root frame, to the target: |x - x*| of thesis eq. 8.4.

        With the aim "surface" it is the distance to the surface, and 0 inside the sphere.
        """
        distance = float(np.linalg.norm(self.position - marker))
        return max(distance - self.radius, 0.0) if self.aim == "surface" else distance


@dataclass(frozen=True, slots=True, eq=False)
class ReachOutcome:
    """The outcome of a reach in two phases: a force pulls the marker to the target, then the attractor pulls the part back.

    The attractor is the pose to which the control law pulls the motors of the part.

    `q`: (n_part,) rad, encoder values at the end of the first phase.  `marker`: (3,) m, root frame, position of the marker that the model
    computes from `q`.  `missing`: m, remaining distance to the target (`ReachTarget.missing`).  `settled`: False if the first phase timed
    out.  `duration`: s of both phases, by the plant's clock.  `touched`: names of the free world objects that at the end of the first phase
    touch a link that the part moves, that is, overlap one of its solids (volumes of its body) or fields (larger volumes that cause
    repulsive forces).  `after`: outcome of the second phase.
    """

    marker: Array
    q: Array
    missing: float
    settled: bool
    duration: float
    touched: tuple[str, ...]
    after: Outcome


class ReachPlant(Plant, Protocol):
    """A Plant that can reach for targets."""

    def present(self, target: ReachTarget | None) -> None:
        """Add the target to the world as the object `TARGET` ("reach_target") with role "target", or move that object; None removes it."""
        ...

    def reach(self, part: str, marker: str, stay: bool = False) -> ReachOutcome:
        """Pull the named marker by a force to the presented target until the part has settled or a time limit is over (thesis 8.2).

        The attractor (the pose to which the control law pulls the motors) stays at the target of the part's last action. When the force has
        ended, the attractor pulls the part back; this is the second phase.  `stay`: True: the attractor moves to the pose in which the
        force ended, so that the part stays there. Then there is no second phase, and the field `after` of the result is the outcome of the
        first phase.
        Raises InvalidValue if no target is presented or the part does not move the marker; ActionInterrupted on a hold (a safe stop), a
        fault or a restart of the robot.
        """
        ...


def checked_target(given: object) -> ReachTarget:
    """Return the given target unchanged; raises InvalidValue if it is no `ReachTarget`."""
    if not isinstance(given, ReachTarget):
        raise InvalidValue(f"target {' '.join(reprlib.repr(given).split())}: must be a ReachTarget, as ReachTarget((-0.3, 0.2, 0.1))")
    return given


def reward_of(missing: float, scale: float = 0.01) -> float:
    """Return the reward 1 / (1 + missing / scale) of a reach (thesis eq. 8.4).

    `missing`: m, final distance of the marker from the target. `scale`: m, the unit of the distance, which the thesis does not state.
    """
    return 1.0 / (1.0 + missing / scale)


def _triple(value: ArrayLike, what: str) -> Array:
    try:
        found = real_array(what, value)
    except InvalidValue:
        found = np.empty(0)
    if found.shape != (3,) or not np.isfinite(found).all():
        shown = f"({', '.join(f'{x:g}' for x in found)})" if found.shape == (3,) else repr(value)
        raise InvalidValue(f"{what} {shown} of the target: must be three finite numbers, in m in the root frame")
    return found
