# SPDX-License-Identifier: Apache-2.0
"""Reaching: forces of a controller that pull markers to targets (thesis 8.2), and paths to a target computed in advance (thesis 5.1).

`reach_path` computes a path with the Jacobian transpose (eqs. 5.4 to 5.6, Algorithm 5). `Reacher` pulls a marker tick by tick. `Reaches`
are the reaches of a controller that are in progress; their formulas are in core/reach.cpp and core/reach_pull.cpp.
"""

from __future__ import annotations

import ctypes
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from mobee._core import Table, address, view
from mobee._core import law as core
from mobee.arrays import Array, Ints
from mobee.control.forces import checked
from mobee.control.law import Law
from mobee.errors import InvalidValue
from mobee.model.kinematics import tables
from mobee.reach import ReachTarget
from mobee.robot.motor_units import motor_units
from mobee.robot.robot import Marker, Robot

if TYPE_CHECKING:
    from mobee.control.controller import Controller
    from mobee.model.model import Model

ARM = 0.1  # m: an error of the normal by an angle counts as an error of the position by this times the angle
MIN_MOTION = 1e-7  # m, and rad of the normal: a step that moves the marker less counts as none
MIN_STIFFNESS = 1e-12  # m^2: of J J^T, for a marker that no motor moves

SMOOTHING_TIME = 0.25  # s, over which the error is averaged
PATIENCE = 3.0  # s without coming nearer by the tolerance, after which a reach counts as stuck

ReachStatus = Literal["reaching", "reached", "stuck"]
Chain = tuple[int, Marker, Table, Table, Table]
"""The arguments of `Reaching` for one part and one marker: part, marker, joints, drives and motors, as its constructor describes them."""


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
    if not (tolerance > 0 and steps > 0):
        raise InvalidValue(f"tolerance {tolerance} and {steps} steps: both must be above 0")
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
        if not 0 < tolerance < np.inf:
            raise InvalidValue(f"tolerance {tolerance} m: must be a finite distance above 0")
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
        if not 0.0 < dt < np.inf:
            raise InvalidValue(f"dt {dt} s: must be a finite time above 0")
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


class Reaching:
    """One reach in progress: a force that pulls a marker to a target. Its state is in the compiled core."""

    def __init__(self, part: int, marker: Marker, joints: Table, drives: Table, motors: Table) -> None:
        """Begin a reach without a target.

        `part`: index of the first motor of the part; -1: the whole body. `joints`, `drives`, `motors`: tables with the columns JOINT, DRIVE
        and PULLED of `mobee._core.law`, for the chain from the base to the marker; joints and motors are copied, because the core changes
        them.
        """
        self.marker = marker.name
        self.joints, self.motors = joints.copy(), motors.copy()
        self._drives, self._curvature = drives, np.zeros((len(motors), len(motors)))
        self.struct = core.Reach(
            part=part, joint_count=1 + int(np.flatnonzero(joints["pulled"])[-1]),  # joints up to the last that a pulled motor drives
            joints=view(self.joints), drives=view(self._drives), motors=view(self.motors),
            curvature=address(self._curvature), point=tuple(marker.position), normal=tuple(marker.normal),
        )  # fmt: skip
        self.address = ctypes.addressof(self.struct)

    def aim(self, target: ReachTarget) -> None:
        """Set the target of the reach, or replace it."""
        self.struct.to_surface, self.struct.faces_target = target.aim == "surface", target.faces
        self.struct.turns_normal = target.faces or target.normal is not None
        self.struct.target[:], self.struct.radius = target.position.tolist(), target.radius
        self.struct.target_normal[:] = [0.0] * 3 if target.normal is None else target.normal.tolist()


class Reaches:
    """The reaches in progress, forces that pull markers to targets: at most one for each part, and at most one for the whole body.

    In all methods, the part None means the reach of the whole body.
    """

    __slots__ = ("_addresses", "_chains", "_core", "_law", "_robot", "_under_way", "address")

    def __init__(self, robot: Robot, law: Law) -> None:
        self._robot, self._law = robot, law
        self._chains: dict[tuple[str | None, str], Chain] = {}  # by part and marker
        self._under_way: dict[str | None, Reaching] = {}  # by part, None the whole body
        self._core = core.calls()
        self._list()

    def __len__(self) -> int:
        return len(self._under_way)

    def __getitem__(self, part: str | None) -> Reaching:
        return self._under_way[part]

    @property
    def markers(self) -> tuple[str, ...]:
        """The names of the markers that are pulled at present, without repetition."""
        return tuple(dict.fromkeys(reaching.marker for reaching in self._under_way.values()))

    def begin(self, part: str | None, marker: str) -> None:
        """Begin a reach of a part (None: of the whole body): a force that will pull a marker. It has no target yet (see `Reaching.aim`).

        A reach of the part that is in progress is replaced.
        Raises UnknownName for an unknown part or marker, InvalidValue if the marker is moved by none of the motors that may move.
        """
        if (part, marker) not in self._chains:
            self._chains[part, marker] = _chain(self._robot, part, marker, self._drawn(part, marker))
        self._under_way.pop(part, None)
        self._under_way[part] = Reaching(*self._chains[part, marker])
        self._list()

    def end(self, part: str | None) -> None:
        """End the reach of a part (None: of the whole body), if there is one."""
        if self._under_way.pop(part, None) is not None:
            self._list()

    def marker(self, part: str | None) -> str | None:
        """Return the name of the marker with which a part (None: the whole body) reaches; None if there is no such reach."""
        reaching = self._under_way.get(part)
        return None if reaching is None else reaching.marker

    def add_forces(self, q: Array, attractor: Array, dt: float, total: Array) -> None:
        """Add the forces of all reaches at the measured q (n,) rad to `total`, in place.

        `attractor`: (n,) rad, q* of the control law, the posture to which its springs pull the motors; a reach cancels these springs for
        the motors that it moves (not with the gains of 2014). `dt`: time since the last tick [s]. `total`: (n,) rad/s^2, at the call the
        sum of all other forces; these springs and the damping are not in it, because `Law.step` adds them later.
        """
        copy = q.copy()
        self._core.add_reaches(self._law.address, self.address, len(self), address(copy), attractor.tobytes(), dt, address(total))

    def is_approaching(self, part: str | None) -> bool:
        """Return whether the reach of a part (None: of the whole body) still moves its marker nearer to the target.

        Always False without a reach, and with the gains of 2014 (`Gains.published_2014`).
        """
        return bool(self._core.reach_is_approaching(self._law.address, self.address, len(self), _first(self._robot, part)))

    def _list(self) -> None:
        """Update the addresses of the reaches under way, which the core reads."""
        self._addresses = np.array([reaching.address for reaching in self._under_way.values()], dtype=np.int64)
        self.address = address(self._addresses)

    def _drawn(self, part: str | None, marker: str) -> Ints:
        """Return the motors of a part, or of the whole body, that may be moved and move a marker."""
        robot = self._robot
        link, where = robot.marker(marker).link, slice(0, None) if part is None else robot.part(part).slice
        moving = np.zeros(len(robot.motors), dtype=bool)
        moving[self._law.active] = True
        moving &= (robot.coupling[0][tables(robot).ancestry[link]] != 0.0).any(axis=0)
        motors: Ints = where.start + np.flatnonzero(moving[where])
        if not len(motors):
            raise InvalidValue(
                f"{part or 'the robot'} cannot reach with {marker} on {robot.links[link]}: none of the motors that it may move does"
            )
        return motors


def _first(robot: Robot, part: str | None) -> int:
    """Return the number of the first motor of a part, by which the core identifies the part; -1 for None (the whole body).

    An action of a part that has settled waits for the reach of this part while its marker still approaches the target. No action waits for
    a reach of the whole body, because -1 is the number of no motor.
    """
    return -1 if part is None else robot.part(part).start


def _chain(robot: Robot, part: str | None, marker: str, motors: Ints) -> Chain:
    """Return the tables of the chain of joints from the base to a marker, restricted to these motors."""
    placed, (matrix, offset), units = robot.marker(marker), robot.coupling, motor_units(robot)
    links = tables(robot).ancestry[placed.link]
    number = {int(motor): k for k, motor in enumerate(motors)}
    joints: Table = np.zeros(len(links), dtype=core.JOINT)
    joints["angle"] = np.nan  # no pose computed yet
    joints["frame"][:1] = np.eye(3)
    drives = list[tuple[int, int, float, float]]()
    for row, j in zip(joints, links, strict=True):
        joint, by = robot.joints[j], np.flatnonzero(matrix[j])
        row["slides"], row["pulled"] = joint.kind == "prismatic", np.isin(by, motors).any()
        row["axis"], row["pivot"], row["offset"] = joint.axis, joint.point, offset[j]
        row["drives"] = len(drives), len(drives) + len(by)
        drives += [(int(m), number.get(int(m), -1), matrix[j, m], matrix[j, m] * units[m] * (int(m) in number)) for m in by]
    pulled: Table = np.zeros(len(motors), dtype=core.PULLED)
    pulled["motor"] = motors
    return _first(robot, part), placed, joints, np.array(drives, dtype=core.DRIVE), pulled
