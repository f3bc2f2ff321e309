"""A path of a map as a motion of the robot: the controller's attractor is moved along it, and the law does the rest."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from mobee.collision.contact import Contact
from mobee.control.gains import Gains
from mobee.errors import InvalidValue
from mobee.model import Model
from mobee.real_array import real_array
from mobee.roadmap.edges import Flags
from mobee.roadmap.reference import ROUNDING, Reference, reference
from mobee.robot.robot import Array, Robot
from mobee.simulation import OfflinePlant

SPEED = 0.8  # of what the springs can do
PERIOD = 0.05  # s between two places of the attractor
PATIENCE = 5.0  # s for coming to rest behind the path
_HARD = 0.8  # of its largest force: what a spring gives at most to follow


@dataclass(frozen=True, slots=True, eq=False)
class Played:
    """What a robot did on a path, a row a tick.

    `wanted`, `q`: (T, n) rad, where it was to be and where it was; `solid`, `field`: (T,) m, the deepest contacts; `rested`: it came to
    rest; `deepest`: what touched what where `solid` was largest.
    """

    times: Array
    wanted: Array
    q: Array
    solid: Array
    field: Array
    rested: bool
    deepest: tuple[Contact, ...]

    @property
    def lag(self) -> float:
        """The largest difference of a motor of the path from where it was to be at that moment, rad."""
        return float(np.abs(self._q - self._wanted).max())

    @property
    def missing(self) -> float:
        """The largest difference of a motor of the path from the path's end, at the end, rad."""
        return float(np.abs(self._q[-1] - self._wanted[-1]).max())

    @property
    def off(self) -> float:
        """How far it came from the path, whenever it was to be there: the largest difference of a motor of the path, rad."""
        from scipy.spatial import KDTree

        return float(KDTree(self._wanted).query(self._q, p=np.inf)[0].max())

    @property
    def _moved(self) -> Flags:
        found: Flags = np.ptp(self.wanted, axis=0) > 0.0
        return found

    @property
    def _q(self) -> Array:
        return self.q[:, self._moved]

    @property
    def _wanted(self) -> Array:
        return self.wanted[:, self._moved]


def play(
    model: Model, path: ArrayLike, speed: float = SPEED, rounding: float = ROUNDING, gains: Gains | None = None, seed: int = 0
) -> Played:
    """Have the offline plant follow a path (K, n) rad from its first pose, at rest, until it rests behind it.

    Args:
        model: the robot in its world.
        path: as of Roadmap.path.
        speed: share of the speed that the springs of the attractor can give.
        rounding: as of `reference`.
        gains: of the control law; None: the default ones.
        seed: of the encoders' noise.

    Raises:
        InvalidValue: with what is valid.
    """
    given, robot = _within(model.robot, path), model.robot
    law = Gains.default() if gains is None else gains
    wanted = timed(robot, given, law, speed, rounding)
    parts = moving(robot, given)
    if not parts:
        raise InvalidValue("the path leads nowhere: all of its poses are the same.")
    plant = OfflinePlant(Model(standing(robot, given[0]), model.world), seed, law, active=parts)
    plant.model.reaching = model.reaching
    traces = []
    ticks = round(PERIOD / plant.dt)
    for attractor in attractors(robot, wanted, law):
        for part in parts:
            plant.begin(part, attractor[robot.part(part).slice])
        traces.append(plant.run(ticks))
    rested = False
    while not rested and len(traces) * PERIOD < wanted.times[-1] + PATIENCE:
        traces.append(plant.run(ticks))
        rested = bool(np.abs(traces[-1].velocity).max() < law.settle.speed)
    q, encoders = (np.concatenate([getattr(one, name) for one in traces]) for name in ("q", "encoders"))
    solid, field = (np.concatenate([getattr(one, name) for one in traces]) for name in ("solid", "field"))
    times: Array = plant.dt * np.arange(1.0, len(q) + 1.0)
    return Played(times, at(wanted, times), q, solid, field, rested, touched_most(model, encoders, solid))


def watched(model: Model, wanted: Reference, times: Array, q: Array, rested: bool) -> Played:
    """What was played elsewhere, by the poses q (T, n) rad that were seen at times (T,) s."""
    depths = np.zeros((2, len(q)))  # solids, fields
    table = model.track().evaluate(q).table
    np.maximum.at(depths, (table.kind, table.pose), table.depth)
    return Played(times, at(wanted, times), q, depths[0], depths[1], rested, touched_most(model, q, depths[0]))


def touched_most(model: Model, q: Array, solid: Array) -> tuple[Contact, ...]:
    """The solid contacts in the one of the poses q (T, n) in which they are deepest, solid (T,) m."""
    worst = int(solid.argmax())
    if not solid[worst] > 0.0:
        return ()
    return tuple(one for one in model.evaluate(q[worst]).contacts if one.kind == "solid")


def timed(robot: Robot, path: Array, gains: Gains, speed: float = SPEED, rounding: float = ROUNDING, dt: float = 0.01) -> Reference:
    """The reference along a path (K, n) rad that the springs of the attractor can follow, at a share of their speed."""
    if not 0.0 < speed <= 1.0:
        raise InvalidValue(f"speed {speed}: must be above 0 and at most 1.")
    strength, damping = (gains.of_robot(name, robot) for name in ("max_spring", "damping"))
    fastest = np.minimum(strength / damping, [motor.max_velocity for motor in robot.motor_table])
    hardest = np.minimum(0.5 * strength, [motor.max_acceleration for motor in robot.motor_table])
    return reference(path, speed * _HARD * fastest, speed * _HARD * hardest, rounding, dt)


def attractors(robot: Robot, wanted: Reference, gains: Gains) -> Iterator[Array]:
    """Where the attractor is every PERIOD, (n,) rad each: so far ahead that the law's spring gives what the motion takes (eq. 5.7).

    The last is the reference's end.  A motor that has not to move keeps its place.
    """
    strength, stiffness, damping = (gains.of_robot(name, robot) for name in ("max_spring", "stiffness", "damping"))
    held = np.arange(0.0, wanted.times[-1] + PERIOD, PERIOD) + 0.5 * PERIOD  # each is in force for a period: meant for its middle
    for row in np.minimum(np.searchsorted(wanted.times, held), len(wanted.times) - 1):
        force = np.clip(wanted.acceleration[row] + damping * wanted.velocity[row], -_HARD * strength, _HARD * strength)
        ahead = force * strength / (stiffness * (strength - np.abs(force)))
        yield np.clip(wanted.q[row] + ahead, *robot.limits.T)


def at(wanted: Reference, times: Array) -> Array:
    """Where the motors are to be at times (T,) s, (T, n) rad; behind the end, at the end."""
    return np.stack([np.interp(times, wanted.times, column) for column in wanted.q.T], axis=1)


def moving(robot: Robot, path: Array) -> tuple[str, ...]:
    """The parts of which some motor moves along a path (K, n)."""
    moves = np.ptp(path, axis=0) > 0.0
    return tuple(name for name, part in robot.parts.items() if moves[part.slice].any())


def standing(robot: Robot, q: Array) -> Robot:
    """The robot with another home, q (n,) rad, where an offline plant begins."""
    return replace(robot, motor_table=tuple(replace(motor, home=float(x)) for motor, x in zip(robot.motor_table, q, strict=True)))


def _within(robot: Robot, path: ArrayLike) -> Array:
    """The path, if the robot can be there; encoders may say a hair's breadth more than the limits."""
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
