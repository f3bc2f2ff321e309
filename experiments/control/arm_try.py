"""One run of the plant in which both arms try a command each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from experiments.control.arm_command import MOTORS, Command
from experiments.control.margins import clause_violations, limit_violations
from experiments.control.models import icub_at_table
from experiments.control.ride import PERIOD, Ride, place, ride
from mobee import Controller, Gains
from mobee.robot.robot import Array, Robot
from mobee.simulation import OfflinePlant

PALMS = {"left_arm": "left_palm", "right_arm": "right_palm"}
ARMS = tuple(PALMS)
STRONG = 1e3  # rad/s^2 at a motor, N/kg at a palm: the squash lets through nearly all that it can
MARGIN = np.deg2rad(15.0)  # of a start, along the normal; the constraints are felt nearer than 12
AT_STOP = np.deg2rad(0.01)


@dataclass(frozen=True, slots=True, eq=False)
class Trial:
    """What came of a run."""

    ride: Ride
    violations: Array  # (2, clauses of an arm) rad along the normal, the worst of each
    stop: Array  # (2,) rad/s, the fastest arrival at a hard stop


def try_commands(gains: Gains, commands: Sequence[Command], torso: Array, seed: int) -> Trial:
    """Both arms do as they are told, the torso goes to `torso` (3,), half ranges from its middle."""
    robot = icub_at_table().robot
    plant = OfflinePlant(icub_at_table(), seed, gains, dt=PERIOD[gains.law])
    start = robot.home.copy()
    for part, command in zip(ARMS, commands, strict=True):
        start[_motors(robot, part)] = _angles(robot, part, command.start)
    start = _legal(robot, start)
    place(plant, start)
    plant.controller.set_attractor("torso", _middle(robot, "torso") + torso * _half(robot, "torso"))
    force = np.zeros(len(robot.motors))
    schedule = [np.round(np.cumsum([0.0, *command.seconds[:-1]]) / plant.dt) for command in commands]

    def tell(tick: int) -> None:
        for part, command, begins in zip(ARMS, commands, schedule, strict=True):
            for phase in np.flatnonzero(begins == tick):
                _tell(plant.controller, part, command, int(phase), force)

    switches = {int(tick) for begins in schedule for tick in begins}
    done = ride(plant, max(command.seconds.sum() for command in commands), tell, switches)
    return _judge(robot, done, start)


def _judge(robot: Robot, done: Ride, start: Array) -> Trial:
    violations = clause_violations(robot, done.q).max(axis=0)
    at_stop = limit_violations(robot, done.q) > -AT_STOP
    arriving = np.diff(done.q, axis=0, prepend=start[None]) / done.dt * at_stop
    stop = [np.abs(arriving[:, _motors(robot, part)]).max() for part in ARMS]
    return Trial(done, violations.reshape(len(ARMS), -1), np.array(stop))


def _tell(controller: Controller, part: str, command: Command, phase: int, force: Array) -> None:
    robot = controller.robot
    where = _motors(robot, part)
    attractor = controller.attractor
    attractor[where] = _angles(robot, part, command.attractors[phase])
    controller.attractor = attractor
    if command.is_forced:
        force[where] = STRONG * command.forces[phase]
        controller.force(force)
        controller.push(PALMS[part], STRONG * command.pushes[phase])


def _legal(robot: Robot, q: Array) -> Array:
    """On the way from home to q, as far as all constraints are farther than MARGIN: what is violated later is the command's doing."""
    for share in np.linspace(1.0, 0.0, 21):
        found: Array = robot.home + share * (q - robot.home)
        if clause_violations(robot, found[None]).max() < -MARGIN:
            return found
    return robot.home


def _motors(robot: Robot, part: str) -> slice:
    start = robot.parts[part].start
    return slice(start, start + MOTORS)


def _angles(robot: Robot, part: str, levels: Array) -> Array:
    return _middle(robot, part)[:MOTORS] + levels * _half(robot, part)[:MOTORS]


def _middle(robot: Robot, part: str) -> Array:
    middle: Array = robot.limits[robot.parts[part].slice].mean(axis=1)
    return middle


def _half(robot: Robot, part: str) -> Array:
    half: Array = np.diff(robot.limits[robot.parts[part].slice], axis=1)[:, 0] / 2.0
    return half
