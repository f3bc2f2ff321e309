# SPDX-License-Identifier: Apache-2.0
"""Two robots that babble (move to random postures) in one workspace, and protections against their collisions (thesis 4.1.2).

A client is a program that sends random postures to a robot.  Its protection is none, the reflex of MoBeE 1.0 (which moves the robot back
along its recent poses after a contact), or a controller of MoBeE 2.0.  Both robots share one model.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from experiments.claims.ch4_reflex.babbling_trial import PositionMove, Targets
from experiments.kit.two_robots import ICUB, KATANA, motors_of, two_robots
from mobee.arrays import Array
from mobee.control import Controller, Gains, SettleTest
from mobee.control.reflex import Reflex, ReflexSettings, Violation, Watch
from mobee.model.model import Model
from mobee.model.pose import Pose
from mobee.model.world_file import load_world
from mobee.simulation.motors import Mode, MotorParameters, Motors

DT = 0.01  # s
SPEED = 0.2  # of the motors' top speed, as in thesis 4.1.1
REST = 1.0  # s after a position move, in which the motors arrive
PATIENCE = 5.0  # s for which a reflex may be stuck, until its client accepts the pose
DEEP = 2e-3  # m: a contact that counts as a collision
ROBOTS = {"icub": ICUB, "katana": KATANA}
GAINS = {"icub": Gains.default, "katana": Gains.derived}  # the latter for fields that were derived
MARK = "katana_"  # begins the names of the Katana's shapes, motors and parts


class Protected(Protocol):
    """A client of a robot together with its protection against collisions: none, the reflex or a controller.

    `mode`: the kind of its commands, "position" or "velocity".
    """

    mode: Mode

    def command(self, k: int, q: Array, pose: Pose) -> Array:
        """Return the commands (n_own,) of the robot's own motors for tick `k`, in rad or rad/s as `mode` says.

        `q`: encoder values (n,) rad of both robots.  `pose`: the model's evaluation of `q`.
        """


class Client:
    """Commands random postures to one robot, one position move after the other.  `moves`: number of postures so far.

    Args:
        own: slice of the robot's motors among those of both robots.
        seed: of the postures.
    """

    def __init__(self, own: slice, seed: int) -> None:
        robot = two_robots()
        self._own, self._targets = own, Targets(robot, seed)
        self._speed = SPEED * np.array([motor.max_velocity for motor in robot.motor_table])[own]
        self._begin = 0
        self.moves = 0
        self._move = PositionMove(robot.home[own], robot.home[own], self._speed)

    def next(self) -> Array:
        """Return the next random posture (n_own,) rad, and count it in `moves`."""
        self.moves += 1
        return self._targets.next()[self._own]

    def start(self, k: int, here: Array) -> None:
        """Begin a position move to the next random posture in tick `k`.  `here`: posture (n_own,) rad in which it starts."""
        self._begin, self._move = k, PositionMove(here, self.next(), self._speed)

    def is_over(self, k: int) -> bool:
        """Whether tick `k` is after the end of the present move and of the pause of 1 s that follows it."""
        return (k - self._begin) * DT >= self._move.duration + REST

    def reference(self, k: int) -> Array:
        """Return the reference positions (n_own,) rad of the present move in tick `k`."""
        return self._move.at((k - self._begin) * DT)


class Unprotected:
    """A client without any protection; the commands are its reference positions.

    `own`: slice of the robot's motors among those of both robots.  `seed`: of the random postures.
    """

    mode: Mode = "position"

    def __init__(self, own: slice, seed: int) -> None:
        self._client = Client(own, seed)

    def command(self, k: int, q: Array, pose: Pose) -> Array:
        """Return the reference positions (n_own,) rad of the client for tick `k`; see `Protected.command`."""
        if self._client.is_over(k):
            self._client.start(k, self._client.reference(k))
        return self._client.reference(k)


class WithReflex:
    """A client and the reflex of MoBeE 1.0, which moves the robot back along its recent poses after a violation.

    `own`: slice of the robot's motors among those of both robots.  `client`: sends the references.  `watch`: function that returns the
    violations in a pose; they trigger the reflex.
    """

    mode: Mode = "position"

    def __init__(self, own: slice, client: Client, settings: ReflexSettings, watch: Callable[[Pose], Sequence[Violation]]) -> None:
        robot = two_robots()
        self.reflex = Reflex(settings, DT, np.array([motor.max_velocity for motor in robot.motor_table])[own])
        self._own, self._client, self._watch = own, client, watch
        self._stuck_since = -1
        self._was_cut = True

    def command(self, k: int, q: Array, pose: Pose) -> Array:
        """Return the positions (n_own,) rad for tick `k`: those of the reflex while it has control, else the client's references.

        See `Protected.command`.
        """
        mine, violations = q[self._own], self._watch(pose)
        target = self.reflex.tick(mine, violations)
        if self.reflex.state != "stuck":
            self._stuck_since = k
        elif (k - self._stuck_since) * DT > PATIENCE:
            self.reflex.accept(mine, violations)
        if target is not None:
            self._was_cut = True
            return target
        if self._was_cut or self._client.is_over(k):
            limits = two_robots().limits[self._own]
            self._client.start(k, mine.clip(limits[:, 0], limits[:, 1]) if self._was_cut else self._client.reference(k))
            self.reflex.mark()
            self._was_cut = False
        return self._client.reference(k)


class WithController:
    """A client and a controller of MoBeE 2.0, which moves only the robot's own motors.

    The client's random postures are the controller's attractors (poses to which it pulls the motors).

    `own`: slice of these motors among those of both robots.  `seed`: of the random postures.  `model`: of both robots.  `gains`: of the
    controller.
    """

    mode: Mode = "velocity"

    def __init__(self, own: slice, seed: int, model: Model, gains: Gains) -> None:
        alive = np.zeros(len(two_robots().motors), dtype=bool)
        alive[own] = True
        self._own, self._client = own, Client(own, seed)
        self._controller = Controller(model, gains, speed_scale=SPEED, alive=alive)
        self._attractor = self._controller.attractor
        self._test = SettleTest(self._controller.gains.settle, 0.0)
        self._next(0.0)

    def command(self, k: int, q: Array, pose: Pose) -> Array:
        """Return the velocities (n_own,) rad/s that the controller commands in tick `k`; see `Protected.command`.

        When the motion has settled or timed out, the client's next random posture becomes the attractor (the pose to which the controller
        pulls).
        """
        controller, own = self._controller, self._own
        velocity = controller.step(q, DT, pose=pose).velocity[own]
        if self._test.update(k * DT, controller.velocity[own], controller.acceleration[own]) != "moving":
            self._next(k * DT)
        return velocity

    def _next(self, t: float) -> None:
        self._attractor[self._own] = self._client.next()
        self._controller.attractor = self._attractor
        self._test = SettleTest(self._controller.gains.settle, t)


@dataclass(slots=True)
class Truth:
    """Records the contacts of the true postures of two robots.

    `collisions`: number of contacts of solids between the robots that became deeper than DEEP (2 mm).  `deepest`: depth of the deepest
    contact of solids between the robots [m].  `deepest_own`: the same for a robot with itself or the table [m].  `path`: length of the
    paths of all motors, summed [rad].  `near`: number of contacts between the robots in which at least one volume is a field (not solid),
    summed over all ticks.
    """

    collisions: int = 0
    deepest: float = 0.0
    deepest_own: float = 0.0
    path: float = 0.0
    near: int = 0
    _deep: set[tuple[str, str]] = field(default_factory=set)
    _last: Array | None = None

    def note(self, pose: Pose) -> None:
        """Record the pose of one tick."""
        now = set[tuple[str, str]]()
        if len(pose.contacts):
            for contact in pose.contacts:
                between = is_between(contact.first, contact.second)
                self.near += between and contact.kind == "field"
                if contact.kind != "solid":
                    continue
                if not between:
                    self.deepest_own = max(self.deepest_own, float(contact.depth))
                    continue
                self.deepest = max(self.deepest, float(contact.depth))
                if contact.depth > DEEP:
                    now.add((contact.first, contact.second))
        self.collisions += len(now - self._deep)
        self._deep = now
        if self._last is not None:
            self.path += float(np.abs(pose.q - self._last).sum())
        self._last = pose.q.copy()


def is_between(first: str, second: str) -> bool:
    """Whether a contact is one between the two robots.  `first`, `second`: names of its shapes; `second` may also be a world object."""
    shapes = {shape.name for shape in two_robots().shapes}
    return second in shapes and first.startswith(MARK) != second.startswith(MARK)


def watch_of(robots: Sequence[str]) -> Callable[[Pose], list[Violation]]:
    """Return a function that finds the violations of the given robots in a pose, and returns them as a list.

    `robots`: "icub", "katana" or both.  Violations are contacts with one of their shapes, motors beyond a limit, and clauses (constraints
    on several joints) that do not hold.  The contact of the Katana's base with the table does not count.
    """
    watch, model = Watch(two_robots()), Model(two_robots(), load_world("table"))
    always = {one.what for one in watch.check(model.evaluate(two_robots().home))}  # the Katana's base on the table

    def check(pose: Pose) -> list[Violation]:
        return [one for one in watch.check(pose) if one.what not in always and any(_is_of(robot, one) for robot in robots)]

    return check


def _is_of(robot: str, violation: Violation) -> bool:
    names = violation.what.split(" - ") if violation.kind == "contact" else [violation.what]
    if robot == "katana":
        return any(name.startswith(MARK) for name in names)
    return not names[0].startswith(MARK) or (len(names) > 1 and is_between(*names))


def babble(makers: Sequence[tuple[slice, Protected]], model: Model, minutes: float, seed: int) -> Truth:
    """Simulate both robots for `minutes` of robot time, and return the record of their contacts.

    `makers`: a pair for each client: the slice of the motors that it commands, among those of both robots, and the client with its
    protection.  `seed`: of the motors' encoder noise.  A command that is computed from the encoders of tick k moves the motors from the
    next tick on, as in the live system.
    """
    robot, parameters, truth = two_robots(), MotorParameters(), Truth()
    motors = Motors(robot, parameters, seed, robot.home)
    substeps = parameters.substeps(DT)
    seen, real = model.track(), model.track()
    for k in range(round(60.0 * minutes / DT)):
        q = motors.encoders(k, DT)
        pose = seen.evaluate(q)
        commands = [(own, one.mode, one.command(k, q, pose)) for own, one in makers]
        motors.move(substeps, DT / substeps)
        for own, mode, reference in commands:
            motors.command(own, mode, reference)
        truth.note(real.evaluate(motors.q))
    return truth


def run_trial(protection: str, minutes: float, paces: Sequence[float], seed: int) -> dict[str, float]:
    """Let both robots babble (move to random postures) with a protection against collisions, and return the measurements.

    `protection`: "none"; "reflexes", one for each robot; "one reflex" for both robots together; or "controllers", one for each robot.
    `minutes`: robot time.  `paces`: for the iCub and for the Katana, the number of recorded poses that the reflex retraces in each tick;
    "one reflex" has the number of the iCub.  `seed`: of postures and encoder noise.

    Keys: "minutes"; "collisions", "deepest", "deepest_own", "path" and "near" as in `Truth`; "reflexes", number of reflexes; "stuck",
    number of reflexes that found no pose without violation.
    """
    model = Model(two_robots(), load_world("table"))
    model.world.set_role("ball", "ghost")
    slices = [motors_of(parts) for parts in ROBOTS.values()]
    seeds = [2 * seed, 2 * seed + 1]
    reflexes: list[Reflex] = []
    robots: list[tuple[slice, Protected]] = []
    if protection == "one reflex":
        whole = slice(0, len(two_robots().motors))
        both = WithReflex(whole, Client(whole, seeds[0]), ReflexSettings(pace=paces[0]), watch_of(tuple(ROBOTS)))
        robots, reflexes = [(whole, both)], [both.reflex]
    for own, own_seed, name, pace in zip(slices, seeds, ROBOTS, paces, strict=True):
        if protection == "none":
            robots.append((own, Unprotected(own, own_seed)))
        elif protection == "reflexes":
            guarded = WithReflex(own, Client(own, own_seed), ReflexSettings(pace=pace), watch_of((name,)))
            robots.append((own, guarded))
            reflexes.append(guarded.reflex)
        elif protection == "controllers":
            robots.append((own, WithController(own, own_seed, model, GAINS[name]())))
    truth = babble(robots, model, minutes, seed)
    return {
        "minutes": minutes,
        "collisions": truth.collisions,
        "deepest": truth.deepest,
        "deepest_own": truth.deepest_own,
        "path": truth.path,
        "near": truth.near,
        "reflexes": sum(one.counts.reflexes for one in reflexes),
        "stuck": sum(one.counts.stuck for one in reflexes),
    }
