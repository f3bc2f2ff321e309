"""A marker is drawn to a target by the whole body, and somebody says how it goes (thesis Algorithm 5 in real time, as in 8.2).

The force is the controller's reach law, `Controller.reach_toward` (docs/law.md); here it is only judged whether the marker arrives.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

import numpy as np

from mobee.control.reach import look
from mobee.errors import InvalidValue
from mobee.reach import ReachTarget
from mobee.real_array import real_array
from mobee.robot.robot import Array

if TYPE_CHECKING:
    from mobee.control.controller import Controller

SMOOTH = 0.25  # s, over which the error is averaged before it is judged
PATIENCE = 3.0  # s without coming nearer by the tolerance

ReachStatus = Literal["reaching", "reached", "stuck"]


class Reacher:
    """Draws a marker of a controlled robot to a target from now on; ask `update` once a tick how it goes, and `stop` when it is over.

    All motors that move the marker reach, the torso's too; nothing is done about obstacles but what the controller does.  With the
    published gains the springs to the attractor pull back all the while, so the marker ends short of the target.  A controller has one
    reach of the whole body at a time: the next `Reacher` takes over.  Two hands reach by `Controller.reach_toward`, each by its part.
    """

    __slots__ = ("_best", "_controller", "_marker", "_seen", "_since", "_tolerance", "angle", "distance", "target")

    def __init__(self, controller: Controller, marker: str, position: Array, normal: Array | None = None, tolerance: float = 2e-3) -> None:
        """`position` (3,) m and `normal` (3,), root frame; `tolerance` m, in which an angle of the normal counts times 0.1 m.

        Raises InvalidValue, also where no motor that may be moved moves the marker; UnknownName.
        """
        if not 0 < tolerance < np.inf:
            raise InvalidValue(f"tolerance {tolerance} m: must be a finite distance above 0")
        self._controller, self._marker, self._tolerance = controller, marker, tolerance
        self.target = ReachTarget(position, normal=normal)
        controller.reach_toward(None, marker, self.target)
        self._best, self._since = np.inf, 0.0  # m, and how long ago it was that much better, s
        self._seen = np.zeros(3 if normal is None else 6)  # m, the error without the encoders' noise
        self.distance = np.inf  # m, to the target, noise smoothed
        self.angle = 0.0  # rad, between the normals, at the last update

    def update(self, q: Array, dt: float) -> ReachStatus:
        """How it goes at the measured q (n,) rad, dt [s] after the last update.

        "stuck" while the marker comes no nearer: the target is out of reach, or limits, clauses, contacts or springs are in its way.
        It is pulled all the same.
        """
        found = look(self._controller.model, self._marker, self.target, real_array("q", q))
        self.angle = found.angle
        self._seen += (found.error - self._seen) * (1.0 if np.isinf(self.distance) else min(1.0, dt / SMOOTH))
        self.distance = float(np.linalg.norm(self._seen[:3]))
        missing = float(np.linalg.norm(self._seen))
        if missing < self._best - self._tolerance:
            self._best, self._since = missing, 0.0
        self._since += dt
        if missing <= self._tolerance:
            return "reached"
        return "stuck" if self._since > PATIENCE else "reaching"

    def stop(self, q: Array) -> None:
        """End the pull; the motors that move the marker stay at q (n,) rad."""
        controller = self._controller
        controller.end_reach(None)
        moved = np.abs(controller.model.jacobian(q, self._marker)).max(axis=0) > 0
        controller.attractor = np.where(moved, q, controller.attractor)
