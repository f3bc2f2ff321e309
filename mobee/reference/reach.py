# SPDX-License-Identifier: Apache-2.0
"""The force that pulls a marker to a target with one part or the whole body (thesis 5.1, 8.2).

Published law: J^T f, with f proportional to the distance of the marker from the target. It is saturated (eq. 5.9) like a client's force,
the force that the program that uses the controller requests. The spring that pulls the motors to the attractor (the posture to which the
controller moves the robot) acts against it.

Default law: J^T control oscillates if the motors execute commands with a delay, because its stiffness depends on the pose: the stiffness is
J J^T plus, for a far target, a term from the curvature of the marker's path. J^T control also stops in singular poses (thesis 5.1).
Therefore the marker is pulled at the same RATE in every direction, by (J E J^T + damping)^-1 e, where e is the remaining error and E the
mobility of the motors (`motor_mobility`). The force leads out of a singular pose along a direction in which the error has negative
curvature. If the forces at limits, clauses (conditions on motor positions) and contacts oppose the motion, the component of the reach's
force against them is reduced, so that the marker slides along them. The attractor's spring is removed while the reach lasts.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from mobee.arrays import Array, Ints
from mobee.control.gains import Gains
from mobee.reach import ReachTarget
from mobee.reference.forces import State, limit_force, squash, squash_together
from mobee.reference.kinematics import joint_column, joints_to, link_frames, marker_at
from mobee.robot.motor_units import limit_zones, motor_units
from mobee.robot.robot import Robot

FORCE_GAIN = math.radians(5000.0)  # rad/s^2 for a lever and a distance of 1 m; the 2014 program's 5000 are deg/s^2

RATE = 5.0  # 1/s: far below the rate at which commands three ticks old at 100 Hz oscillate (docs/law.md)
ARM = 0.1  # m: an error of the normal by an angle counts as an error of the position by this times the angle
FACING = 0.02  # m from the target's centre, within which the marker is turned less and less towards it
LONGEST = 0.2  # m: the pull does not grow beyond this distance
TOLERANCE = 2e-3  # m
SOFT = 0.03  # damping, relative to the size of J E J^T
WALL = 0.5  # rad/s^2: a force of this size that holds the motors back counts half as a wall
SMOOTH = 0.25  # s, over which the error is averaged
BETTER = 5e-4  # m: a decrease of the error that counts
WAIT = 0.6  # s without such a decrease, after which the reach may be over
PATIENCE = 3.0  # s without such a decrease, after which no direction out of a singular pose is tried
WEAK = 0.05  # of the error's force that acts on the motors: below it the pose counts as singular
CURVED = 1e-3  # relative to the size of J E J^T: the smallest curvature that counts
NUDGE = 0.1  # rad, out of a singular pose
PROBE = 1e-4  # rad, step of finite differences
NOTHING = 1e-12  # the least divisor: a distance [m], or the size of J E J^T [m^2/s] for a marker that no motor moves


@dataclass(slots=True, eq=False)
class Reach:
    """A reach in progress: its motors, and the state of the default law from tick to tick.

    `motors`: (m,) indices of the motors on which the reach exerts a force. `seen`: (6,) m, the error as `rows` defines it, averaged over
    time to reduce the encoders' noise. `remaining`: m, the norm of `seen`; `best`: m, the norm at its last decrease that counted
    (`note_error`); `since`: time [s] since that decrease. `escape`: (m,) unit vector of motor motions, the last direction out of a singular
    pose; None: no such direction is known.
    """

    robot: Robot
    gains: Gains
    marker: str
    target: ReachTarget
    motors: Ints
    seen: Array = field(default_factory=lambda: np.zeros(6))
    remaining: float = 0.0
    best: float = math.inf
    since: float = 0.0
    escape: Array | None = None

    @property
    def is_approaching(self) -> bool:
        """Whether the marker has not arrived and still comes nearer: then the reach must continue, even if all motors are slow."""
        return self.remaining > 0.75 * TOLERANCE and self.since < WAIT


def begin(robot: Robot, gains: Gains, part: str | None, marker: str, target: ReachTarget) -> Reach:
    """Return the state of a new reach of `marker` for `target`.

    Its motors are those of the named part, or of the whole body if `part` is None, that move the marker and have a weight above 0 in the
    gains (the control law never moves a motor of weight 0).
    """
    moving = (robot.coupling[0][joints_to(robot, robot.marker(marker).link)] != 0.0).any(axis=0) & (gains.weight(robot.motors) > 0)
    if part is not None:
        moving[: robot.part(part).slice.start] = moving[robot.part(part).slice.stop :] = False
    return Reach(robot, gains, marker, target, np.flatnonzero(moving))


@dataclass(frozen=True, slots=True, eq=False)
class View:
    """The errors of a reaching marker in a pose, and the derivatives of its position and rotation.

    All vectors are in the root frame. `error`: (3,) m, from the marker to its goal. `turn`: (3,) n x n*, the axis about which the marker's
    normal n should turn to the wanted normal n*. If the marker shall face the target and is nearer than FACING (2 cm) to its centre, `turn`
    is multiplied by distance / FACING. `facing`: n . n*. `columns`: (k, 6), velocity and angular velocity of the marker for each of the k
    joints between base and marker. `drives`: (k, m), motion of these joints when one of the m pulled motors (`Reach.motors`) moves by 1 rad
    (a slide: by its `motor_units`).
    """

    error: Array
    turn: Array
    facing: float
    columns: Array
    drives: Array

    @property
    def jacobian(self) -> Array:
        """The marker's Jacobian with respect to the m pulled motors, (6, m): linear rows, then angular, root frame."""
        found: Array = self.columns.T @ self.drives
        return found


def view(r: Reach, q: Array) -> View:
    """Return the errors of the marker's position and normal at q (n,) rad, and their derivatives with respect to the joints."""
    frames, target = link_frames(r.robot, q), r.target
    place, normal = marker_at(r.robot, frames, r.marker)
    error = target.position - place
    if target.aim == "surface":
        error = error * max(0.0, 1.0 - target.radius / max(float(np.linalg.norm(error)), NOTHING))
    wanted, near = normal if target.normal is None else target.normal, 1.0
    if target.faces:
        apart = float(np.linalg.norm(target.position - place))
        wanted, near = (target.position - place) / max(apart, NOTHING), min(1.0, apart / FACING)
    joints = joints_to(r.robot, r.robot.marker(r.marker).link)[::-1]
    columns = np.array([joint_column(r.robot, frames, j, place) for j in joints])
    drives = r.robot.coupling[0][joints][:, r.motors] * motor_units(r.robot)[r.motors]
    return View(error, near * np.cross(normal, wanted), float(normal @ wanted), columns, drives)


def reach_force(r: Reach, s: State, dt: float, against: Array) -> Array:
    """Return the force of a reach as a term of eq. 5.7, (n,) rad/s^2, and update the state of the reach.

    `dt`: length of the tick [s]. `against` (n,) rad/s^2: the sum of all other forces except the attractor's spring and the damping.
    """
    total, seen = np.zeros(len(s.q)), view(r, s.q)
    if r.gains.law == "published_2014":
        total[r.motors] = bounded(r, published(r, seen))
        return total
    force, nudge = drawn(r, seen, s, dt, against)
    most, slope = (r.gains.of_robot(name, r.robot)[r.motors] for name in ("max_spring", "stiffness"))
    spring = squash((s.attractor - s.q)[r.motors], most, slope)
    total[r.motors] = bounded(r, force) - spring + squash(nudge * motor_units(r.robot)[r.motors], most, slope)
    return total


def bounded(r: Reach, force: Array) -> Array:
    """Saturate a force on the m pulled motors, (m,) rad/s^2, with the gains `max_client` and `client_slope`.

    These are the gains for a client's force, which the program that uses the controller requests. Returns (m,) rad/s^2; for a motor that
    slides, m/s^2 (`mobee.robot.motor_units`).
    """
    maximum, slope = (r.gains.of_robot(name, r.robot)[r.motors] for name in ("max_client", "client_slope"))
    unit = motor_units(r.robot)[r.motors]
    if r.gains.client_squash == "each":
        return squash(force * unit, maximum, slope)
    return squash_together(force * unit, maximum, slope, unit)


def published(r: Reach, v: View) -> Array:
    """Return the force of the 2014 program on the m pulled motors, (m,), not yet saturated: J^T f.

    The force on the marker is 5000 (x* - x). If its normal n should have the direction n*, the moment 5000 |x* - x| (1 - n.n*) / 2 (n x n*)
    is added. With the factor 5000 and lengths in m, the force on a motor is in deg/s^2; here it is converted to rad/s^2 (FORCE_GAIN).
    """
    twist = 0.5 * float(np.linalg.norm(v.error)) * (1.0 - v.facing) * v.turn
    force: Array = FORCE_GAIN * v.jacobian.T @ np.concatenate([v.error, twist])
    return force


def drawn(r: Reach, v: View, s: State, dt: float, against: Array) -> tuple[Array, Array]:
    """Return the force of the default law on the m pulled motors, (m,), not yet saturated, and a shift of their positions, (m,) rad.

    The shift leads out of a singular pose; in other poses it is 0. The caller adds the force that a spring extended by the shift exerts.
    `dt`: length of the tick [s]. `against` (n,) rad/s^2: the sum of all other forces except the attractor's spring and the damping. The
    state of the reach is updated.
    """
    jacobian, error = rows(r, v)
    note_error(r, error, dt)
    slope = jacobian.T @ error  # the decrease of half the squared error along each motor
    mobility = motor_mobility(r, s.q, slope)
    marker_mobility = (jacobian * mobility) @ jacobian.T
    size = max(float(np.linalg.norm(marker_mobility)), NOTHING)
    weak = float(slope @ (mobility * slope)) < WEAK**2 * size * float(error @ error)
    nudge = np.zeros(len(r.motors))
    if weak and r.remaining > TOLERANCE and r.since <= PATIENCE:
        nudge = NUDGE * escape_direction(r, s.q, mobility, size)
    fading = r.remaining / (r.remaining + 0.5 * TOLERANCE)  # so that at the target the encoders' noise has no effect
    pull = RATE * fading / (1.0 + float(np.linalg.norm(error)) / LONGEST) * error / size
    force = jacobian.T @ pushed(r, v, marker_mobility / size, pull, mobility)
    return along_walls(r, v, s, against, force, mobility, size, pull), nudge


def rows(r: Reach, v: View) -> tuple[Array, Array]:
    """Return the Jacobian (k, m) and the error (k,) m of the reach for the m pulled motors; k is 3, or 6 if the target asks for a normal.

    The last three rows are those of the rotation that turns the marker's normal to the wanted one, multiplied by ARM (0.1 m).
    """
    if r.target.normal is None and not r.target.faces:
        return v.jacobian[:3], v.error
    return v.jacobian * np.repeat([1.0, ARM], 3)[:, None], np.concatenate([v.error, ARM * v.turn])


def note_error(r: Reach, error: Array, dt: float) -> None:
    """Update the averaged error of the reach, and the time since the last decrease of its norm (`Reach.since`).

    A decrease counts if the norm falls more than BETTER (0.5 mm) below `Reach.best`, its value at the last such decrease. The average
    is exponential with the time constant SMOOTH (0.25 s). `error` (3,) or (6,) m: the new error, from `rows`. `dt`: length of the tick [s].
    """
    seen = r.seen[: len(error)]
    seen += (min(1.0, dt / SMOOTH) if r.best < math.inf else 1.0) * (error - seen)
    r.remaining = float(np.linalg.norm(seen))
    if r.remaining < r.best - BETTER:
        r.best, r.since = r.remaining, 0.0
    r.since += dt


def motor_mobility(r: Reach, q: Array, slope: Array) -> Array:
    """Return the mobility E of the m pulled motors, (m,) s: the velocity [rad/s] of each motor per unit of force [rad/s^2].

    It is the gain `client_slope` (k of eq. 5.8) divided by the gain `damping`. It is 0 for a motor that is in the outer half of a limit
    zone, where the force at limits f_lim acts, if the reach would move it towards the limit. `slope` (m,): J^T e, as `slope_at` returns it.
    """
    zones = 0.5 * limit_zones(r.robot, r.gains.of_robot("limit_width", r.robot))
    low, high = r.robot.limits.T + zones.T * np.array([[1.0], [-1.0]])
    kept = ((q < low)[r.motors] & (slope < 0.0)) | ((q > high)[r.motors] & (slope > 0.0))
    mobility = r.gains.of_robot("client_slope", r.robot) / r.gains.of_robot("damping", r.robot)
    return np.where(kept, 0.0, mobility[r.motors])


def pushed(r: Reach, v: View, marker_mobility: Array, pull: Array, mobility: Array) -> Array:
    """Return the force on the marker, (k,): (J E J^T / size + damping)^-1 pull, with enough damping for a stable motion.

    k is 3, or 6 if a normal is wanted, as in `rows`. `marker_mobility` (k, k): J E J^T / size, where size is the norm of J E J^T. `pull`
    (k,): the wanted velocity of the marker, divided by size. `mobility` (m,): E, from `motor_mobility`. The damping is doubled until the
    largest eigenvalue of the matrix `bend_of_path` [1/s] is below RATE (5 1/s).
    """
    soft = SOFT
    while True:
        push: Array = np.asarray(np.linalg.solve(marker_mobility + soft * np.eye(len(marker_mobility)), pull), dtype=np.float64)
        bend = bend_of_path(v, push, mobility)
        if largest_eigenvalue(bend, mobility, turns=12)[0] < RATE:
            return push
        soft *= 2.0


def bend_of_path(v: View, push: Array, mobility: Array) -> Array:
    """Return the matrix -E^1/2 (push . d2x/dq2) E^1/2 for the m pulled motors, (m, m) 1/s, where x is the position of the marker.

    It is a stiffness: the curvature of the marker's path adds it to the stiffness of the force that pulls the marker. `push` (3,) or (6,):
    this force, as `pushed` returns it. `mobility` (m,): diagonal of E, from `motor_mobility`.

    For two joints a and b, a nearer to the base, d2x/(da db) is the cross product of the axis of a and the derivative dx/db. If `push` has
    six components, the last three add a similar term for the rotation.
    """
    count = len(v.columns)
    along = np.zeros((count, count))
    for a in range(count):
        for b in range(a, count):
            axis, (motion, turning) = v.columns[a, 3:], (v.columns[b, :3], v.columns[b, 3:])
            along[a, b] = push[:3] @ np.cross(axis, motion)
            if len(push) == 6 and a != b:
                along[a, b] += 0.5 * ARM * push[3:] @ np.cross(axis, turning)
            along[b, a] = along[a, b]
    found: Array = -(v.drives.T @ along @ v.drives) * np.sqrt(np.outer(mobility, mobility))
    return found


def largest_eigenvalue(matrix: Array, mobility: Array, turns: int) -> tuple[float, Array]:
    """Return the largest eigenvalue of a symmetric matrix (m, m), and its eigenvector (m,), by power iteration with `turns` steps.

    The entries of the eigenvector are 0 for motors with a `mobility` (m,) of 0.
    """
    shift = float(np.linalg.norm(matrix))  # makes it the largest in absolute value too
    vector: Array = 1.0 + 0.1 * np.arange(len(matrix), dtype=np.float64)
    length = 0.0
    for _ in range(turns):
        vector = shift * vector + matrix @ vector
        length = float(np.linalg.norm(vector))
        vector = np.where(mobility > 0.0, vector / length, 0.0) if length > 0.0 else np.zeros(len(matrix))
    return length - shift, vector


def along_walls(r: Reach, v: View, s: State, against: Array, force: Array, mobility: Array, size: float, pull: Array) -> Array:
    """Return the force of the reach on the m pulled motors, (m,), changed so that they slide along limits and contacts.

    If the forces at limits or contacts oppose the reach, its component against them is reduced, the more the stronger they are.

    `against` (n,) rad/s^2: the sum of all other forces except the attractor's spring and the damping. `force` (m,): the force of the reach
    before this change. `mobility` (m,): E, from `motor_mobility`. `size`: norm of J E J^T. `pull` (3,) or (6,): the wanted velocity of the
    marker, divided by `size`.
    """
    jacobian, unit = rows(r, v)[0], motor_units(r.robot)[r.motors]
    limit = limit_force(s)[r.motors]
    limited = np.where(limit * force < 0.0, np.abs(limit) / unit, 0.0)  # of each motor alone
    held = (against[r.motors] - limit) / unit  # by all other forces: a direction of the motors
    into = float(held @ (mobility * force)) < 0.0
    if not (limited.any() or into):
        return force
    share, mobility = WALL / (WALL + limited), mobility * WALL / (WALL + limited)
    marker_mobility, across = (jacobian * mobility) @ jacobian.T, float(held @ (mobility * held))
    wall = 0.0
    if into and across > 0.0:
        strength = float(np.linalg.norm(held))
        wall = strength / (strength + WALL) / across
        away = jacobian @ (mobility * held)
        marker_mobility = marker_mobility - wall * np.outer(away, away)  # no motion in that direction, or little
    force = jacobian.T @ pushed(r, v, marker_mobility / size, pull, mobility)
    return (force - wall * float(held @ (mobility * force)) * held) * share


def escape_direction(r: Reach, q: Array, mobility: Array, size: float) -> Array:
    """Return a unit vector (m,) of motor motions that leads out of a singular pose; 0 if there is none.

    Along this vector, and along its opposite, the error decreases to second order (negative curvature). Of the two, the one nearer to the
    vector of the last tick (`Reach.escape`) is returned; without such a vector, the one towards the middle of the motors' ranges.
    `mobility` (m,): E, from `motor_mobility`. `size`: norm of J E J^T.
    """
    curve = np.empty((len(r.motors), len(r.motors)))
    for k, motor in enumerate(r.motors):
        probe = np.zeros(len(q))
        probe[motor] = PROBE * motor_units(r.robot)[motor]
        curve[k] = (slope_at(r, q + probe) - slope_at(r, q - probe)) / (2.0 * PROBE)
    curve = 0.5 * (curve + curve.T) * np.sqrt(np.outer(mobility, mobility))
    falls, direction = largest_eigenvalue(curve, mobility, turns=60)
    before = np.zeros(len(direction)) if r.escape is None else r.escape
    if falls < CURVED * size:
        r.escape = None
        return np.zeros(len(direction))
    middle = (r.robot.limits.mean(axis=1) - q)[r.motors]
    side = float(direction @ before) or float(direction @ middle)  # as before; at first towards the middle of the motors' ranges
    r.escape = -direction if side < 0.0 else direction
    return r.escape


def slope_at(r: Reach, q: Array) -> Array:
    """Return J^T e at q (n,) rad, (m,), with the Jacobian J and the error e of `rows`.

    If no normal is wanted, it is the derivative of -|e|^2 / 2 with respect to each of the m pulled motors.
    """
    jacobian, error = rows(r, view(r, q))
    slope: Array = jacobian.T @ error
    return slope
