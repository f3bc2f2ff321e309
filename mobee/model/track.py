# SPDX-License-Identifier: Apache-2.0
"""Evaluates a sequence of poses, fast if each is near the previous one; uses a list of the near pairs of volumes (a neighbour list)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from numpy.typing import ArrayLike

from mobee._core import engine as core
from mobee.arrays import Array
from mobee.model.contact import ContactTable
from mobee.model.engine import Engine, Scene
from mobee.model.snapshot import Hands, Snapshot, hand_numbers

if TYPE_CHECKING:
    from mobee.model.model import Model, Reaching
    from mobee.model.pose import Pose


class Neighbours:
    """Computes the contacts of a robot in consecutive poses, with a list of the pairs of volumes that are near each other.

    An object is for one thread at a time. `skin`: m; pairs nearer than this are in the list. `cut`: True: a contact acts only on the motors
    of the touching link's own part, as in the MoBeE program of 2014; False: also on the motors nearer to the base.
    """

    def __init__(self, engine: Engine, skin: float, cut: bool = False) -> None:
        self._engine = engine
        self._core = core.Following(skin, cut)
        self._known: tuple[Scene, Hands] | None = None

    def contacts(self, q: Array, snapshot: Snapshot, reaching: Hands) -> tuple[ContactTable, Array]:
        """Return all contacts in the consecutive poses q (B, n) rad, and their projection to the motors, (B, n) m^2/rad.

        The projection is the sum of J^T (depth * normal) over the contacts of fields. Fields are volumes that cause repulsive forces; J is
        the Jacobian of the contact's point. `snapshot`: the state of the world. `reaching`: the hands that reach for targets; their
        contacts with targets are ignored.
        """
        self.enter(snapshot, reaching)
        numbers, reals, torque = self._core.follow(q)
        return self._engine.table(snapshot, numbers, reals), torque

    def enter(self, snapshot: Snapshot, reaching: Hands) -> int:
        """Set the world and the reaching hands for later computations; return the memory address of the core's object `Neighbours`.

        If the world or the hands have changed, the list of near pairs is discarded; the core makes a new one when this saves time.
        """
        scene = self._engine.scene_of(snapshot)
        known = self._known
        if known is None or known[0] is not scene or known[1] != reaching:
            self._core.enter(scene.handle, hand_numbers(reaching))
            self._known = scene, reaching
        return self._core.at


class Track:
    """Evaluates consecutive poses of one model: faster than `Model.evaluate` if each is near the previous one, with the same results.

    The argument `skin` of `Model.track` is a distance: pairs of volumes that are farther apart are not checked until a volume has moved by
    half this distance. A track takes little time to make and is for one thread at a time. For large steps between poses it is as fast as
    `Model.evaluate`.
    """

    def __init__(self, model: Model, engine: object, skin: float) -> None:
        """Make a track; users call `Model.track`.

        `engine`: of the model; the engine of python-fcl has no list of near pairs and evaluates every pair. `skin`: m; pairs of volumes
        nearer than this are in the list.
        """
        self._model = model
        self._neighbours = Neighbours(engine, skin) if isinstance(engine, Engine) else None

    def evaluate(self, q: ArrayLike, reaching: Reaching = None) -> Pose:
        """Return the pose at q (n,) rad, or the poses along a path q (..., n) rad, evaluated in this order.

        `reaching`: name of the marker that reaches for the targets, or names of up to two; None: none. The compiled engine computes the
        contacts at once, not when they are read. Raises InvalidValue if q has another shape or is not finite, and UnknownName if the robot
        does not have the marker.
        """
        pose = self._model.evaluate(q, reaching=reaching)
        if self._neighbours is not None:
            pose.compute_contacts(self._neighbours)
        return pose
