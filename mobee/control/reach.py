"""Algorithm 5 of the thesis: reaching with the Jacobian transpose, as a precomputed path and step by step."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from mobee.arrays import Array, real_array
from mobee.errors import InvalidValue
from mobee.reach import ReachTarget

if TYPE_CHECKING:
    from mobee.control.controller import Controller
    from mobee.model.model import Model

ARM = 0.1  # m: a normal that is wrong by an angle counts as a position that is wrong by this times the angle
STILL = 1e-7  # m (and, times the arm of a normal, rad): a step that moves the marker less is none
TINY = 1e-12  # m^2, stiffness of a marker that nothing moves


@dataclass(frozen=True, slots=True, eq=False)
class ReachPath:
    """A piecewise linear path from the start to where the algorithm ended."""

    q: Array  # (steps + 1, n) rad
    end: Literal["reached", "stuck", "steps used up"]
    distance: float  # m, of the marker from the target at the end
    angle: float  # rad, between the normals at the end


def reach_path(
    model: Model,
    marker: str,
    position: Array,
    start: Array,
    normal: Array | None = None,
    tolerance: float = 1e-3,
    steps: int = 2000,
) -> ReachPath:
    """Draw a marker to a target, steps of alpha J^T dx (thesis algorithm 5); kinematics alone, nothing keeps it from touching.

    `position` (3,) m and `normal` (3,) root frame, `start` (n,) rad, `tolerance` m, and rad for the normal.  The thesis leaves alpha
    open: here it is one over the largest eigenvalue of J J^T and of what the bend of the path adds, so that no step overshoots;
    every step ends within the motors' limits.
    Ends "stuck" where a step moves nothing: the target is out of reach, limits are in the way, or the pose is singular.
    """
    model.robot.marker(marker)
    target = ReachTarget(position, normal=normal)
    if not (tolerance > 0 and steps > 0):
        raise InvalidValue(f"tolerance {tolerance} and {steps} steps: both must be above 0")
    low, high = model.robot.limits.T
    path = [real_array("start", start)]
    here = look(model, marker, target, path[0])
    end: Literal["reached", "stuck", "steps used up"] = "steps used up"
    while True:
        if here.distance <= tolerance and here.angle <= tolerance:
            end = "reached"
            break
        if len(path) > steps:
            break
        jacobian = model.jacobian(path[-1], marker)
        rows = jacobian[: len(here.error)] * here.arms[:, None]
        stiffness = float(np.linalg.eigvalsh(rows @ rows.T)[-1]) + bend(jacobian, here.error)
        alpha = 1.0 / max(stiffness, TINY)
        q = np.clip(path[-1] + alpha * rows.T @ here.error, low, high)
        there = look(model, marker, target, q)
        if np.linalg.norm(there.position - here.position) + abs(there.angle - here.angle) < STILL:
            end = "stuck"
            break
        path.append(q)
        here = there
    return ReachPath(np.array(path), end, here.distance, here.angle)


@dataclass(frozen=True, slots=True, eq=False)
class Look:
    """A target as seen from a pose, its radius left out."""

    position: Array  # (3,) m, of the marker
    error: Array  # (3,) m toward the target, or (6,): the normal is to turn about the last three, which count ARM m a rad
    angle: float  # rad, between the normals; 0 where none is asked for

    @property
    def distance(self) -> float:
        """From the marker to the target [m]."""
        return float(np.linalg.norm(self.error[:3]))

    @property
    def arms(self) -> Array:
        """What each row of the marker's Jacobian counts [m]: 1 or ARM."""
        return np.repeat([1.0, ARM], 3)[: len(self.error)]


def look(model: Model, marker: str, target: ReachTarget, q: Array) -> Look:
    """Look from q (n,) rad."""
    pose = model.evaluate(q)
    position = pose.position(marker)
    if target.normal is None:
        return Look(position, target.position - position, 0.0)
    normal = pose.normal(marker)
    turn = np.cross(normal, target.normal)
    angle = float(np.arctan2(np.linalg.norm(turn), normal @ target.normal))
    return Look(position, np.concatenate([target.position - position, ARM * turn]), angle)


def bend(jacobian: Array, error: Array) -> float:
    """A bound on what the bending of the marker's path adds to the stiffness of a pull by the error [m^2].

    For joints i before j the path's second derivative is the axis of i times the motion of j.
    """
    levers, axes = np.linalg.norm(jacobian[:3]), np.linalg.norm(jacobian[3:])
    return float(np.linalg.norm(error[:3]) * levers * axes + ARM * np.linalg.norm(error[3:]) * axes * axes)


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
