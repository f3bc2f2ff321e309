# SPDX-License-Identifier: Apache-2.0
"""Reaching: a path to a target computed in advance (thesis 5.1), and a marker that a controller pulls to a target (thesis 8.2).

`reach_path` computes a path with the Jacobian transpose (eqs. 5.4 to 5.6, Algorithm 5). `Reacher` pulls a marker tick by tick.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from mobee.arrays import Array, is_number
from mobee.control.forces import checked
from mobee.errors import InvalidValue
from mobee.reach import ReachTarget

if TYPE_CHECKING:
    from mobee.control.controller import Controller
    from mobee.model.model import Model

ARM = 0.1  # m: an error of the normal by an angle counts as an error of the position by this times the angle
MIN_MOTION = 1e-7  # m, and rad of the normal: a step that moves the marker less counts as none
MIN_STIFFNESS = 1e-12  # m^2: of J J^T, for a marker that no motor moves

SMOOTHING_TIME = 0.25  # s, over which the error is averaged
PATIENCE = 3.0  # s without coming nearer by the tolerance, after which a reach counts as stuck

ReachStatus = Literal["reaching", "reached", "stuck"]


@dataclass(frozen=True, slots=True, eq=False)
class ReachPath:
    """The piecewise linear path that `reach_path` returns.

    `q`: (K, n) rad, the poses from start to end. `end`: why the path ends, "reached", "stuck" or "steps used up". `distance`: m, from the
    marker to the target at the end. `angle`: rad, between the marker's normal and the wanted normal at the end; 0 without a wanted normal.
    """

    q: Array
    end: Literal["reached", "stuck", "steps used up"]
    distance: float
    angle: float


def reach_path(
    model: Model,
    marker: str,
    position: Array,
    start: Array,
    normal: Array | None = None,
    tolerance: float = 1e-3,
    steps: int = 2000,
) -> ReachPath:
    """Return a path that moves a marker to a target in steps of alpha J^T dx (thesis eq. 5.4, Algorithm 5); contacts are ignored.

    The thesis leaves alpha open. Here it is 1 / (l + b), so that no step overshoots: l is the largest eigenvalue of J J^T, and b a bound on
    the curvature of the marker's path (`bend_bound`). Every step ends within the motors' limits. The path ends "stuck" when steps no longer
    move the marker: the target is out of reach, limits block the motion, or the pose is singular.

    Args:
        model: the robot.
        marker: name of the marker.
        position: (3,) m, root frame, of the target.
        start: (n,) rad, first pose of the path.
        normal: (3,), root frame, wanted direction of the marker's normal; None: any direction.
        tolerance: distance [m], and angle between the normals [rad], at which the target counts as reached.
        steps: largest number of steps.

    Raises:
        InvalidValue, UnknownName: an argument is not valid, or the robot has no such marker.
    """
    model.robot.marker(marker)
    target = ReachTarget(position, normal=normal)
    if not (is_number(tolerance) and is_number(steps) and tolerance > 0 and steps > 0):
        raise InvalidValue(f"tolerance {tolerance!r} and {steps!r} steps: both must be above 0")
    low, high = model.robot.limits.T
    path = [checked("start", start, len(low))]
    here = marker_error(model, marker, target, path[0])
    end: Literal["reached", "stuck", "steps used up"] = "steps used up"
    while True:
        if here.distance <= tolerance and here.angle <= tolerance:
            end = "reached"
            break
        if len(path) > steps:
            break
        jacobian = model.jacobian(path[-1], marker)
        rows = jacobian[: len(here.error)] * here.arms[:, None]
        stiffness = float(np.linalg.eigvalsh(rows @ rows.T)[-1]) + bend_bound(jacobian, here.error)
        alpha = 1.0 / max(stiffness, MIN_STIFFNESS)
        q = np.clip(path[-1] + alpha * rows.T @ here.error, low, high)
        there = marker_error(model, marker, target, q)
        if np.linalg.norm(there.position - here.position) + abs(there.angle - here.angle) < MIN_MOTION:
            end = "stuck"
            break
        path.append(q)
        here = there
    return ReachPath(np.array(path), end, here.distance, here.angle)


@dataclass(frozen=True, slots=True, eq=False)
class MarkerError:
    """The position of a marker in a pose, and its remaining error to the centre of its target.

    `position`: (3,) m, root frame, of the marker. `error`: (3,) m from marker to target; with a wanted normal (6,), where the last three
    are ARM (0.1 m) times the cross product of the marker's normal and the wanted normal. `angle`: rad, between the normals; 0 without a
    wanted normal.
    """

    position: Array
    error: Array
    angle: float

    @property
    def distance(self) -> float:
        """The distance between marker and target [m]."""
        return float(np.linalg.norm(self.error[:3]))

    @property
    def arms(self) -> Array:
        """The weight of each row of the marker's Jacobian, (3,) or (6,): 1 for a position, ARM (0.1 m) for a rotation."""
        return np.repeat([1.0, ARM], 3)[: len(self.error)]


def marker_error(model: Model, marker: str, target: ReachTarget, q: Array) -> MarkerError:
    """Return the position of a marker at q (n,) rad, and its remaining error to the centre of a target."""
    pose = model.evaluate(q)
    position = pose.position(marker)
    wanted, apart = target.normal, target.position - position
    if target.faces:
        wanted = apart / max(float(np.linalg.norm(apart)), 1e-12)
    if wanted is None:
        return MarkerError(position, apart, 0.0)
    normal = pose.normal(marker)
    turn = np.cross(normal, wanted)
    angle = float(np.arctan2(np.linalg.norm(turn), normal @ wanted))
    return MarkerError(position, np.concatenate([target.position - position, ARM * turn]), angle)


def bend_bound(jacobian: Array, error: Array) -> float:
    """Return an upper bound on the curvature term in the second derivative of |e|^2 / 2, where e is the marker's error [m^2 per rad^2].

    Let the motors move along a unit vector v (n,). The second derivative of |e|^2 / 2 is then |J v|^2 - e . x'', where x'' is the second
    derivative of the marker's position. The result is a bound on the curvature term |e . x''| for all v. For a joint i nearer to the base
    than a joint j, the second derivative of the position by both is the cross product of the axis of i and the linear column j of J. So the
    bound is the norm of the position's error times the Frobenius norms of the linear and of the angular rows of J. If `error` has six
    numbers, a term for the rotation is added: ARM (0.1 m) * norm of the last three numbers * squared Frobenius norm of the angular rows.

    Args:
        jacobian: (6, n), the Jacobian J of the marker, linear rows first.
        error: (3,) m, e, from marker to target; or (6,) m, where the last three are ARM times the error of the rotation.
    """
    levers, axes = np.linalg.norm(jacobian[:3]), np.linalg.norm(jacobian[3:])
    return float(np.linalg.norm(error[:3]) * levers * axes + ARM * np.linalg.norm(error[3:]) * axes * axes)


class Reacher:
    """Pulls a marker (a named point on a link) of a controlled robot to a target.

    Call `update` once per tick (control cycle), and `stop` at the end. The pull begins when the object is made. All motors that move the
    marker take part, also those of the torso. The controller's forces keep the robot away from obstacles. With the gains of 2014
    (`Gains.published_2014`) the control law's springs pull the robot back to the attractor (their goal) during the reach, so that the
    marker stops before the target. A controller has at most one reach of the whole body: a new `Reacher` replaces the previous one. To
    reach with two hands at the same time use `Controller.reach_toward` with their parts.
    """

    __slots__ = ("_best", "_controller", "_marker", "_seen", "_since", "_tolerance", "angle", "distance", "target")

    def __init__(self, controller: Controller, marker: str, position: Array, normal: Array | None = None, tolerance: float = 2e-3) -> None:
        """Begin to pull `marker` to `position` (3,) m, root frame.

        `normal`: (3,), root frame, wanted direction of the marker's normal; None: any. `tolerance`: m, error at which the target counts as
        reached; an error of 1 rad between the normals counts as 0.1 m. Raises UnknownName for an unknown marker. Raises InvalidValue for a
        position, normal or tolerance that is not valid, or if none of the motors that may move moves the marker.
        """
        if not (is_number(tolerance) and 0 < tolerance < np.inf):
            raise InvalidValue(f"tolerance {tolerance!r} m: must be a finite distance above 0")
        self._controller, self._marker, self._tolerance = controller, marker, tolerance
        self.target = ReachTarget(position, normal=normal)
        controller.reach_toward(None, marker, self.target)
        self._best, self._since = np.inf, 0.0  # m, the smallest error; s, the time since then
        self._seen = np.zeros(3 if normal is None else 6)  # m, the error, averaged over the encoders' noise
        self.distance = np.inf  # m, to the target, averaged
        self.angle = 0.0  # rad, between the normals, at the last update

    def update(self, q: Array, dt: float) -> ReachStatus:
        """Return the status at the measured q (n,) rad, dt [s] after the last update: "reaching", "reached" or "stuck".

        "stuck": the marker came no nearer for 3 s, because the target is out of reach, or limits, clauses, contacts or springs prevent the
        motion. The force on the marker continues after every status; `stop` ends it. Raises InvalidValue if q has another shape or is not
        finite, or if dt is not a finite time above 0.
        """
        if not (is_number(dt) and 0.0 < dt < np.inf):
            raise InvalidValue(f"dt {dt!r} s: must be a finite time above 0")
        found = marker_error(self._controller.model, self._marker, self.target, checked("q", q, len(self._controller.robot.motors)))
        self.angle = found.angle
        self._seen += (found.error - self._seen) * (1.0 if np.isinf(self.distance) else min(1.0, dt / SMOOTHING_TIME))
        self.distance = float(np.linalg.norm(self._seen[:3]))
        error = float(np.linalg.norm(self._seen))
        if error < self._best - self._tolerance:
            self._best, self._since = error, 0.0
        self._since += dt
        if error <= self._tolerance:
            return "reached"
        return "stuck" if self._since > PATIENCE else "reaching"

    def stop(self, q: Array) -> None:
        """End the pull, and set the attractor of all motors that move the marker to q (n,) rad, so that the marker stays.

        The attractor is the goal of the control law's springs. Raises InvalidValue if q has another shape or is not finite.
        """
        controller = self._controller
        q = checked("q", q, len(controller.robot.motors))
        controller.end_reach(None)
        moved = np.abs(controller.model.jacobian(q, self._marker)).max(axis=0) > 0
        controller.attractor = np.where(moved, q, controller.attractor)
