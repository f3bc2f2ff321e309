# SPDX-License-Identifier: Apache-2.0
"""Turns a path of a roadmap into a motion in time and moves the robot along it under the control law."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from mobee.arrays import Array, real_array
from mobee.control.gains import Gains
from mobee.errors import InvalidValue
from mobee.model.contact import Contact
from mobee.model.kinematics import tables
from mobee.model.model import Model
from mobee.roadmap.edges import Flags
from mobee.robot.motor_units import fine_units, motor_units
from mobee.robot.robot import Robot
from mobee.simulation import OfflinePlant

ROUNDING = 0.1  # rad
STEP = 0.002  # rad along the path, between two places at which its speed is limited
_SAME = 1e-9  # rad


@dataclass(frozen=True, slots=True, eq=False)
class Reference:
    """A planned motion, at rest at both ends.

    `times`: (T,) s. `q`, `velocity`, `acceleration`: (T, n) rad, rad/s and rad/s^2 at these times.
    """

    times: Array
    q: Array
    velocity: Array
    acceleration: Array


def reference(path: ArrayLike, speeds: ArrayLike, accelerations: ArrayLike, rounding: float = ROUNDING, dt: float = 0.01) -> Reference:
    """Return the planned motion along a path (K, n) rad, within the motors' largest speeds and accelerations.

    Args:
        path: (K, n) rad, corners that straight lines join.
        speeds: (n,) rad/s, largest speeds.
        accelerations: (n,) rad/s^2, largest accelerations.
        rounding: distance from a corner [rad, Euclidean over all motors] at which the motion leaves the straight line and joins the next
            one. It is reduced to half the length of the shorter line at the corner. The curve's smallest distance from the corner is at
            most half this distance. 0: the motion stops at every corner.
        dt: time between two rows of the result [s].

    Raises:
        InvalidValue: an argument has a wrong shape or is out of its range.
    """
    corners, fastest, hardest = (
        real_array("path", path),
        np.asarray(speeds, dtype=np.float64),
        np.asarray(accelerations, dtype=np.float64),
    )
    _require(corners, fastest, hardest, rounding, dt)
    moves = np.ptp(corners, axis=0) > 0.0
    moving = corners[:, moves]
    moving = moving[np.concatenate([[True], np.linalg.norm(np.diff(moving, axis=0), axis=1) > _SAME])]
    pieces = [rounded(moving, rounding)] if rounding > 0.0 else [rounded(pair, 0.0) for pair in zip(moving, moving[1:], strict=False)]
    motions = [_timed(piece, fastest[moves], hardest[moves], dt) for piece in pieces if len(piece) > 1]
    rows = 1 + sum(len(one[0]) - 1 for one in motions)
    q, velocity, acceleration = np.tile(corners[0], (rows, 1)), np.zeros((rows, len(moves))), np.zeros((rows, len(moves)))
    first = 0
    for one in motions:
        for whole, part in zip((q, velocity, acceleration), one, strict=True):
            whole[first : first + len(part), moves] = part
        first += len(one[0]) - 1
    q[-1] = corners[-1]
    times: Array = dt * np.arange(float(rows))
    return Reference(times, q, velocity, acceleration)


def rounded(corners: ArrayLike, rounding: float) -> Array:
    """Return points (S, n) along a path with corners (K, n) rad: straight lines, with a parabola at each corner.

    `rounding`: distance before and after a corner at which the parabola begins and ends [rad]; it is reduced to half the length of the
    shorter line at the corner. The points are about STEP (0.002 rad) apart.
    """
    points = real_array("corners", corners)
    steps = np.diff(points, axis=0)
    far = np.linalg.norm(steps, axis=1)
    if not far.all():
        raise InvalidValue(f"corners: {int(np.argmin(far))} and the next one are equal; give each corner once.")
    directions = steps / far[:, None]
    found, here = [points[:1]], points[0]
    for k in range(1, len(points)):
        last = k == len(points) - 1
        cut = 0.0 if last else min(rounding, 0.5 * far[k - 1], 0.5 * far[k])
        before = points[k] - cut * directions[k - 1]
        found.append(_line(here, before))
        here = before
        if cut > 0.0:
            behind = points[k] + cut * directions[k]
            # An even number of pieces: where a path turns back on itself, two points beside the middle would be equal.
            share = np.linspace(0.0, 1.0, 2 * max(2, int(cut / STEP)) + 1)[1:, None]
            found.append((1.0 - share) ** 2 * before + 2.0 * share * (1.0 - share) * points[k] + share**2 * behind)
            here = behind
    return np.concatenate(found)


def _line(start: Array, end: Array) -> Array:
    far = float(np.linalg.norm(end - start))
    if far <= _SAME:
        return np.empty((0, len(start)))
    share = np.linspace(0.0, 1.0, max(4, int(far / STEP)) + 1)[1:, None]
    places: Array = start + share * (end - start)
    return places


def _timed(places: Array, speeds: Array, accelerations: Array, dt: float) -> tuple[Array, Array, Array]:
    """Return the fastest motion over points (S, n) within the limits: q, velocity and acceleration (T, n), one row per dt s."""
    from scipy.interpolate import CubicHermiteSpline

    lengths = np.linalg.norm(np.diff(places, axis=0), axis=1)
    along = np.concatenate([[0.0], np.cumsum(lengths)])
    tangent = np.gradient(places, along, axis=0)
    bend = np.gradient(tangent, along, axis=0)
    speed = _speeds(lengths, tangent, bend, speeds, accelerations)
    spans = 2.0 * lengths / (speed[1:] + speed[:-1])  # s, of even acceleration
    when, gains = np.concatenate([[0.0], np.cumsum(spans)]), np.diff(speed) / spans
    where = CubicHermiteSpline(along, places, tangent)
    stretch = 1.0
    while True:  # the interpolated motion may be a little too fast between the points: then slow all of it down a little
        count = max(1, int(np.ceil(when[-1] * stretch / dt)))
        moments = np.linspace(0.0, when[-1], count + 1)
        last = np.clip(np.searchsorted(when, moments, side="right") - 1, 0, len(spans) - 1)
        since = moments - when[last]
        q = where(along[last] + speed[last] * since + 0.5 * gains[last] * since**2)
        q[0], q[-1] = places[0], places[-1]
        steps = np.zeros((count + 2, len(speeds)))  # at rest before and behind
        steps[1:-1] = np.diff(q, axis=0) / dt
        acceleration = np.diff(steps, axis=0) / dt
        excess = max(float((np.abs(steps) / speeds).max()), float(np.sqrt((np.abs(acceleration) / accelerations).max())))
        if excess <= 1.0:
            velocity = 0.5 * (steps[1:] + steps[:-1])
            velocity[0] = velocity[-1] = acceleration[0] = acceleration[-1] = 0.0
            return q, velocity, acceleration
        stretch *= 1.01 * excess


def _speeds(lengths: Array, tangent: Array, bend: Array, speeds: Array, accelerations: Array) -> Array:
    """Return the largest speed along the path, in path length per second, at each of its S points (S,); 0 at both ends.

    `lengths`: (S - 1,) between points. `tangent`, `bend`: first and second derivative (S, n) of the motors' positions by the path length.
    `speeds`, `accelerations`: limits (n,) of the motors. Half of a motor's acceleration is kept for the bends of the path, the other half
    for changes of speed along it.
    """
    half = 0.5 * accelerations
    with np.errstate(divide="ignore"):
        limit = np.minimum((speeds / np.abs(tangent)).min(axis=1) ** 2, (half / np.abs(bend)).min(axis=1))
        gain = 2.0 * (half / np.abs(tangent)).min(axis=1)
    squared = limit.copy()
    squared[0] = squared[-1] = 0.0
    for k in range(len(lengths)):
        squared[k + 1] = min(squared[k + 1], squared[k] + gain[k] * lengths[k])
    for k in range(len(lengths) - 1, -1, -1):
        squared[k] = min(squared[k], squared[k + 1] + gain[k + 1] * lengths[k])
    found: Array = np.sqrt(squared)
    return found


def _require(path: Array, speeds: Array, accelerations: Array, rounding: float, dt: float) -> None:
    if path.ndim != 2 or not len(path) or not np.isfinite(path).all():
        raise InvalidValue(f"path has shape {path.shape}; it must be (K, n) rad, finite, at least one pose.")
    for name, values in (("speeds", speeds), ("accelerations", accelerations)):
        if values.shape != path.shape[1:] or not (np.isfinite(values) & (values > 0.0)).all():
            raise InvalidValue(f"{name} have shape {values.shape}; they must be ({path.shape[1]},), finite and above 0.")
    if not (rounding >= 0.0 and dt > 0.0):
        raise InvalidValue(f"rounding {rounding} rad, dt {dt} s: they must be at least 0, and above 0.")


SPEED = 0.8  # share of the speed that the springs can give
PERIOD = 0.05  # s between two places of the attractor
PATIENCE = 5.0  # s to come to rest after the path
_HARD = 0.8  # share of its largest force that a spring may use to follow the motion


@dataclass(frozen=True, slots=True, eq=False)
class Played:
    """The motion of a robot along a path, one row for each of T ticks.

    Distances between positions are in rad; the whole range of a motor that slides counts as 200 deg (`mobee.robot.motor_units`).

    `units`: (n,), the motion of each motor, in its own unit, that counts as 1 rad. `times`: (T,) s. `wanted`, `q`: (T, n) rad or m, planned
    and real positions. `solid`, `field`: (T,) m, depth of the deepest contact of solids
    and of fields (larger shapes around solids that cause repulsive forces), 0 without a contact. `rested`: whether the robot came to rest.
    `deepest`: the solid contacts of the pose in which `solid` was largest.
    """

    units: Array
    times: Array
    wanted: Array
    q: Array
    solid: Array
    field: Array
    rested: bool
    deepest: tuple[Contact, ...]

    @property
    def lag(self) -> float:
        """Largest distance [rad] between the real and the planned position at the same time, over all motors that the plan moves."""
        return float(np.abs(self._q - self._wanted).max())

    @property
    def missing(self) -> float:
        """Largest distance [rad] between the last real and the last planned position, over all motors that the plan moves."""
        return float(np.abs(self._q[-1] - self._wanted[-1]).max())

    @property
    def off(self) -> float:
        """Largest distance [rad] of the real motion from the planned path, over all ticks.

        At each tick it is the distance from the nearest of all planned poses, whatever its time. The distance of two poses is the largest
        difference of position among the motors that the plan moves.
        """
        from scipy.spatial import KDTree

        return float(KDTree(self._wanted).query(self._q, p=np.inf)[0].max())

    @property
    def _moved(self) -> Flags:
        found: Flags = np.ptp(self.wanted, axis=0) > 0.0
        return found

    @property
    def _q(self) -> Array:
        return (self.q / self.units)[:, self._moved]

    @property
    def _wanted(self) -> Array:
        return (self.wanted / self.units)[:, self._moved]


def play(
    model: Model, path: ArrayLike, speed: float = SPEED, rounding: float = ROUNDING, gains: Gains | None = None, seed: int = 0
) -> Played:
    """Simulate the robot on an `OfflinePlant` along a path (K, n) rad, from the first pose of the path.

    The result has the planned and the real positions and the depths of contacts in each tick (time step of the simulation). After the
    planned motion the simulation continues until the robot is at rest, but for at most 5 s.

    Args:
        model: the robot in its world.
        path: as `Roadmap.path` returns it.
        speed: factor on the largest speeds and accelerations of the planned motion, above 0 and at most 1 (`timed`).
        rounding: a curve replaces the path from this distance [rad] before each corner to this distance after it. 0: the motion stops at
            every corner.
        gains: of the control law; None: the default ones.
        seed: of the encoders' noise.

    Raises:
        InvalidValue: an argument is out of its range (the message states the range), or all poses of the path are the same.
    """
    given, robot = _within(model.robot, path), model.robot
    law = Gains.default() if gains is None else gains
    wanted = timed(robot, given, law, speed, rounding)
    parts = moving(robot, given)
    if not parts:
        raise InvalidValue("the path leads nowhere: all of its poses are the same.")
    plant = OfflinePlant(Model(standing(robot, given[0]), model.world), seed, law, active=parts)
    traces = []
    ticks = round(PERIOD / plant.dt)
    for attractor in attractors(robot, wanted, law):
        for part in parts:
            plant.begin(part, attractor[robot.part(part).slice])
        traces.append(plant.run(ticks))
    rested = False
    while not rested and len(traces) * PERIOD < wanted.times[-1] + PATIENCE:
        traces.append(plant.run(ticks))
        rested = bool((np.abs(traces[-1].velocity) < law.settle.speed * fine_units(robot)).all())
    q, encoders = (np.concatenate([getattr(one, name) for one in traces]) for name in ("q", "encoders"))
    solid, field = (np.concatenate([getattr(one, name) for one in traces]) for name in ("solid", "field"))
    times: Array = plant.dt * np.arange(1.0, len(q) + 1.0)
    return Played(motor_units(model.robot), times, at(wanted, times), q, solid, field, rested, touched_most(model, encoders, solid))


def watched(model: Model, wanted: Reference, times: Array, q: Array, rested: bool) -> Played:
    """Return the `Played` of an observed motion with the poses q (T, n) rad at times (T,) s; contacts are computed from the poses.

    `wanted`: the planned motion. `rested`: whether the robot came to rest.
    """
    depths = np.zeros((2, len(q)))  # solids, fields
    table = model.track().evaluate(q).table
    np.maximum.at(depths, (table.kind, table.pose), table.depth)
    return Played(motor_units(model.robot), times, at(wanted, times), q, depths[0], depths[1], rested, touched_most(model, q, depths[0]))


def touched_most(model: Model, q: Array, solid: Array) -> tuple[Contact, ...]:
    """Return all solid contacts of the pose with the deepest contact among the poses q (T, n) rad; an empty tuple without contacts.

    `solid`: (T,) m, depth of the deepest solid contact of each pose.
    """
    worst = int(solid.argmax())
    if not solid[worst] > 0.0:
        return ()
    return tuple(one for one in model.evaluate(q[worst]).contacts if one.kind == "solid")


def timed(robot: Robot, path: Array, gains: Gains, speed: float = SPEED, rounding: float = ROUNDING, dt: float = 0.01) -> Reference:
    """Return the planned motion along a path (K, n) rad that the control law's springs can follow, one row per `dt` [s].

    `speed`: factor on the largest speeds and accelerations. At 1 these are 0.8 of what spring and damping allow (speed max_spring /
    damping, acceleration max_spring / 2), or 0.8 of the motor's own limit if that is lower. `rounding`: a curve replaces the path from this
    distance [rad] before each corner to this distance after it; 0: the motion stops at every corner. For a motor that slides, 1 rad is the
    length of `mobee.robot.motor_units.motor_units`. Raises InvalidValue if `speed` is not above 0 and at most 1.
    """
    if not 0.0 < speed <= 1.0:
        raise InvalidValue(f"speed {speed}: must be above 0 and at most 1.")
    strength, damping = (gains.of_robot(name, robot) for name in ("max_spring", "damping"))
    fastest = np.minimum(strength / damping, [motor.max_velocity for motor in robot.motor_table])
    hardest = np.minimum(0.5 * strength, [motor.max_acceleration for motor in robot.motor_table])
    corners, units = real_array("path", path), motor_units(robot)
    _require(corners, fastest, hardest, rounding, dt)
    angles = reference(corners / units, speed * _HARD * fastest / units, speed * _HARD * hardest / units, rounding, dt)
    q = angles.q * units
    q[0], q[-1] = corners[0], corners[-1]  # exactly: an end may be at a limit
    return Reference(angles.times, q, angles.velocity * units, angles.acceleration * units)


def attractors(robot: Robot, wanted: Reference, gains: Gains, forces: Callable[[Array], Array] | None = None) -> Iterator[Array]:
    """Yield the attractor (n,) rad for each period of PERIOD (0.05 s), such that the law's spring produces the motion (eq. 5.7).

    The attractor is the position to which the spring pulls the motors. During the motion it is ahead of the planned position, so that the
    spring moves the motors. Without `forces`, the attractor of a motor that the plan does not move stays at its position, and the last
    attractor is the last pose of the plan.

    Args:
        robot: the robot.
        wanted: the planned motion.
        gains: of the control law.
        forces: function that takes a posture (n,) rad and returns the forces (n,) rad/s^2 of the control law except spring and damping. The
            attractor is shifted such that its spring cancels these forces; None: they are not cancelled.
    """
    damping = gains.of_robot("damping", robot)
    held = np.arange(0.0, wanted.times[-1] + PERIOD, PERIOD) + 0.5 * PERIOD  # each is in force for a period: meant for its middle
    for row in np.minimum(np.searchsorted(wanted.times, held), len(wanted.times) - 1):
        q = wanted.q[row]
        force = wanted.acceleration[row] + damping * wanted.velocity[row]
        yield attractor_for(robot, gains, q, force if forces is None else force - forces(q))


def attractor_for(robot: Robot, gains: Gains, q: Array, force: Array) -> Array:
    """Return the attractor (n,) rad for which the law's spring exerts `force` (n,) rad/s^2 at the posture q (n,) rad (eq. 5.7).

    The attractor is the position to which the spring pulls the motors. Forces are reduced to at most 0.8 of the spring's largest force,
    and the attractor is clipped to the motors' limits.
    """
    strength, stiffness = (gains.of_robot(name, robot) for name in ("max_spring", "stiffness"))
    force = np.clip(force, -_HARD * strength, _HARD * strength)
    ahead = force * strength / (stiffness * (strength - np.abs(force)))
    found: Array = np.clip(q + ahead, *robot.limits.T)
    return found


def at(wanted: Reference, times: Array) -> Array:
    """Return the planned positions (T, n) rad at times (T,) s, interpolated; after the end of the motion, its last position."""
    return np.stack([np.interp(times, wanted.times, column) for column in wanted.q.T], axis=1)


def moving(robot: Robot, path: Array) -> tuple[str, ...]:
    """Return the names of the parts that a path (K, n) rad moves."""
    moves = np.ptp(path, axis=0) > 0.0
    return tuple(name for name, part in robot.parts.items() if moves[part.slice].any())


def carrying(robot: Robot, motors: Sequence[str]) -> tuple[str, ...]:
    """Return the names of the parts that the given motors belong to, and of the parts that carry these parts.

    For the motors of the iCub's arm, these are the arm and the torso. `motors`: names of motors.
    """
    moves = np.isin(robot.motors, motors) @ np.abs(tables(robot).coupling) > 0.0  # (J,)
    above = np.zeros(len(robot.joints), dtype=bool)
    for joint in np.flatnonzero(moves):
        above[tables(robot).ancestry[joint + 1]] = True
    chain = np.abs(tables(robot).coupling) @ above > 0.0  # (n,)
    return tuple(name for name, part in robot.parts.items() if chain[part.slice].any())


def standing(robot: Robot, q: Array) -> Robot:
    """Return a copy of the robot whose home pose is q (n,) rad, so that an offline plant starts in this pose."""
    return replace(robot, motor_table=tuple(replace(motor, home=float(x)) for motor, x in zip(robot.motor_table, q, strict=True)))


def _within(robot: Robot, path: ArrayLike) -> Array:
    """Return the path clipped to the limits; raises InvalidValue if it is more than 0.01 rad beyond them."""
    given, n = real_array("path", path), len(robot.motors)
    if given.ndim != 2 or given.shape[1] != n or not len(given):
        raise InvalidValue(f"path has shape {given.shape}; it must be (K, {n}) rad.")
    inside = np.clip(given, *robot.limits.T)
    beyond = np.abs(given - inside).max(axis=0)
    if beyond.max() > 0.01:
        worst = int(beyond.argmax())
        low, high = robot.limits[worst]
        raise InvalidValue(f"the path brings {robot.motors[worst]} beyond its limits, {low:.3g} to {high:.3g} rad, by {beyond[worst]:.3g}.")
    return inside
