# SPDX-License-Identifier: Apache-2.0
"""Evaluates poses that follow each other closely, with a list of the pairs that are near each other (a neighbour list)."""

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
    """Computes the contacts of a robot in consecutive poses, with a list of the pairs nearer than `skin` [m]; for one thread at a time.

    `cut`: see `Engine.contacts`.
    """

    def __init__(self, engine: Engine, skin: float, cut: bool = False) -> None:
        self._engine = engine
        self._core = core.Following(skin, cut)
        self._known: tuple[Scene, Hands] | None = None

    def contacts(self, q: Array, snapshot: Snapshot, reaching: Hands) -> tuple[ContactTable, Array]:
        """Return what `Engine.contacts` returns, for the poses q (B, n) one after the other."""
        self.enter(snapshot, reaching)
        numbers, reals, torque = self._core.follow(q)
        return self._engine.table(snapshot, numbers, reals), torque

    def enter(self, snapshot: Snapshot, reaching: Hands) -> int:
        """Use this world in all later calls, with a new list of pairs if it changed; return the address of the core's `Neighbours`."""
        scene = self._engine.scene_of(snapshot)
        known = self._known
        if known is None or known[0] is not scene or known[1] != reaching:
            self._core.enter(scene.handle, hand_numbers(reaching))
            self._known = scene, reaching
        return self._core.at


class Track:
    """Evaluates poses of one model that follow each other closely: the same results as `Model.evaluate`, faster.

    Pairs of volumes that cannot touch until one of them has moved by half the skin are not checked until then. A track is cheap to make
    and serves one thread at a time. Where the steps are large it is as fast as `Model.evaluate`.
    """

    def __init__(self, model: Model, engine: object, skin: float) -> None:
        """`engine`: that of the model; one without neighbour lists, python-fcl, evaluates every pair."""
        self._model = model
        self._neighbours = Neighbours(engine, skin) if isinstance(engine, Engine) else None

    def evaluate(self, q: ArrayLike, reaching: Reaching = None) -> Pose:
        """Return the pose at q (n,), or the poses along a path (..., n) rad in this order; arguments and errors: see `Model.evaluate`.

        The contacts are computed at once, not when they are read.
        """
        pose = self._model.evaluate(q, reaching=reaching)
        if self._neighbours is not None:
            pose.compute_contacts(self._neighbours)
        return pose
