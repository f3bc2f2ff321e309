# SPDX-License-Identifier: Apache-2.0
"""Commands for one arm, drawn at random or varied, and runs of the plant in which each arm executes one command."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from experiments.kit.control.measures import clause_violations, speeds_at_stops
from experiments.kit.control.plant_runs import PERIOD, PlantRun, icub_at_table, place, run_plant
from mobee import Controller, Gains
from mobee.arrays import Array
from mobee.robot.robot import Robot
from mobee.simulation import OfflinePlant

MOTORS = 7  # of an arm, without the fingers: the constraints are on the first five
PHASES = 3
DIMENSIONS = 3  # of a push
SIGNS = (-1.0, 0.0, 1.0)
FARTHEST = 50.0  # of an attractor from the middle of the range, in half ranges
SHORT, LONG = 0.05, 1.5  # s, shortest and longest phase
STEPS = (0.5, 0.15, 0.05)  # sizes of a variation: half ranges for motors, factors e^step for times
PALMS = {"left_arm": "left_palm", "right_arm": "right_palm"}
ARMS = tuple(PALMS)
STRONG = 1e3  # rad/s^2 at a motor, N/kg at a palm; saturates the squash
MARGIN = np.deg2rad(15.0)  # rad along the normal, of a start; constraints push within 12 degrees


@dataclass(frozen=True, slots=True, eq=False)
class Command:
    """A command for one arm: a start posture and three phases, each with an attractor and with forces that a client of the robot exerts.

    `start` (7,) and `attractors` (3, 7): positions of the first 7 motors of the arm, all but those of the hand, in half ranges from the
    middle of the range, so -1 to 1 is inside the limits.  `seconds`: (3,), durations of the phases.  `forces`: (3, 7), forces at these
    motors, -1 to 1 in units of STRONG (1000 rad/s^2).  `pushes`: (3, 3), forces at the palm, root frame, -1 to 1 in units of STRONG (1000
    N/kg).
    """

    start: Array
    attractors: Array
    seconds: Array
    forces: Array
    pushes: Array

    @property
    def is_forced(self) -> bool:
        """Whether a client exerts forces at the motors or pushes the palm in any phase."""
        return bool(self.forces.any() or self.pushes.any())

    @property
    def is_inside(self) -> bool:
        """Whether the attractors of all phases are within the joint limits."""
        return bool(np.all(np.abs(self.attractors) <= 1.0))


def random_command(rng: np.random.Generator, forced: bool) -> Command:
    """Draw a random command: half of all commands have attractors within the joint limits, the others beyond the limits of some motors.

    `forced`: whether a client exerts random forces and pushes.
    """
    shape = (PHASES, MOTORS)
    inside = rng.uniform(-1.0, 1.0, shape)
    corners = np.where(rng.random(shape) < 0.5, np.sign(inside), inside)
    outside = np.sign(inside) * np.exp(rng.uniform(0.0, np.log(FARTHEST), shape))
    attractors = corners if rng.random() < 0.5 else np.where(rng.random(shape) < 0.5, outside, corners)
    start, seconds = rng.uniform(-1.0, 1.0, MOTORS), np.exp(rng.uniform(np.log(SHORT), np.log(LONG), PHASES))
    pushes = (PHASES, DIMENSIONS)
    if not forced:
        return Command(start, attractors, seconds, np.zeros(shape), np.zeros(pushes))
    return Command(start, attractors, seconds, rng.choice(SIGNS, shape), rng.choice(SIGNS, pushes))


def vary(rng: np.random.Generator, one: Command, other: Command) -> Command:
    """Return the command `one` with small random changes.

    A command has three phases, each with a duration, an attractor and forces.  In 30 % of the cases, each phase of `one` is first replaced,
    with probability 0.5, by the same phase of the command `other`.
    """
    step = rng.choice(STEPS)
    take = rng.random(PHASES) < (0.5 if rng.random() < 0.3 else 0.0)
    attractors = np.where(take[:, None], other.attractors, one.attractors)
    touched = rng.random(attractors.shape) < 0.4
    changed = attractors + step * rng.standard_normal(attractors.shape) * np.maximum(np.abs(attractors), 1.0)
    if one.is_inside:
        changed = changed.clip(-1.0, 1.0)
    forces, pushes = np.where(take[:, None], other.forces, one.forces), np.where(take[:, None], other.pushes, one.pushes)
    if one.is_forced:
        forces, pushes = (np.where(rng.random(f.shape) < 0.1, rng.choice(SIGNS, f.shape), f) for f in (forces, pushes))
    return Command(
        (one.start + step * rng.standard_normal(MOTORS)).clip(-1.0, 1.0),
        np.where(touched, changed, attractors).clip(-FARTHEST, FARTHEST),
        (np.where(take, other.seconds, one.seconds) * np.exp(step * rng.standard_normal(PHASES))).clip(SHORT, LONG),
        forces,
        pushes,
    )


def as_numbers(command: Command) -> list[float]:
    """Return a command as a list of numbers for JSON: start, attractors, seconds, forces and pushes, rounded to six decimals."""
    parts = (command.start, command.attractors.ravel(), command.seconds, command.forces.ravel(), command.pushes.ravel())
    return [round(float(x), 6) for x in np.concatenate(parts)]


def from_numbers(numbers: list[float]) -> Command:
    """Return the command from the list of numbers that `as_numbers` returned."""
    ends = np.cumsum([MOTORS, PHASES * MOTORS, PHASES, PHASES * MOTORS])
    start, attractors, seconds, forces, pushes = np.split(np.array(numbers), ends)
    return Command(start, attractors.reshape(PHASES, -1), seconds, forces.reshape(PHASES, -1), pushes.reshape(PHASES, -1))


@dataclass(frozen=True, slots=True, eq=False)
class Tried:
    """Measures of a run in which each arm executed a command; the first row of each array is of the left arm.

    `run`: the recording.  `violations`: (2, C) rad, the largest violation of each of the C clauses of an arm, as `clause_violations`
    computes it; a clause is a condition on several motor positions, which the cables of the shoulder impose.  `stop`: (2,) rad/s, the
    largest speed of a motor at a hard stop.
    """

    run: PlantRun
    violations: Array
    stop: Array


def try_commands(gains: Gains, commands: Sequence[Command], torso: Array, seed: int) -> Tried:
    """Run the iCub at its table with a command for the left arm and one for the right arm, and measure the run.

    `commands`: the command of the left arm, then that of the right arm.  `torso`: (3,), attractor of the torso during the whole run, in the
    same units as those of `Command.attractors`.  `seed`: seed of the plant's random numbers.
    """
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

    def begin_phases(tick: int) -> None:
        for part, command, begins in zip(ARMS, commands, schedule, strict=True):
            for phase in np.flatnonzero(begins == tick):
                _begin_phase(plant.controller, part, command, int(phase), force)

    switches = {int(tick) for begins in schedule for tick in begins}
    run = run_plant(plant, max(command.seconds.sum() for command in commands), begin_phases, switches)
    violations = clause_violations(robot, run.q).max(axis=0)
    arriving = np.abs(speeds_at_stops(robot, run, start))
    return Tried(run, violations.reshape(len(ARMS), -1), np.array([arriving[:, _motors(robot, part)].max() for part in ARMS]))


def _begin_phase(controller: Controller, part: str, command: Command, phase: int, force: Array) -> None:
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
    """Return the posture nearest to q on the line from home in which all cable constraints are farther than MARGIN (15 degrees) away.

    Only 21 points of the line are tried; if none is far enough, home is returned.
    """
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
