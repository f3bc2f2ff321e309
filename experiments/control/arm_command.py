"""What one arm is told in a try, at random or as a variation of what was bad before."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mobee.robot.robot import Array

MOTORS = 7  # of an arm, without the fingers: the constraints are on the first five
PHASES = 3
DIMENSIONS = 3  # of a push
SIGNS = (-1.0, 0.0, 1.0)
FAR = 50.0  # half ranges from the middle of a range, the farthest attractor
SHORT, LONG = 0.05, 1.5  # s, a phase
STEPS = (0.5, 0.15, 0.05)  # of a variation: half ranges of the motors, and factors e^step of the times


@dataclass(frozen=True, slots=True, eq=False)
class Command:
    """Positions are in half ranges from the middle of a motor's range: inside the joint box they are -1 to 1."""

    start: Array  # (7,)
    attractors: Array  # (3, 7)
    seconds: Array  # (3,)
    forces: Array  # (3, 7): -1 to 1, of more than the squash lets through, at the motors
    pushes: Array  # (3, 3): the same at the palm, root frame

    @property
    def is_forced(self) -> bool:
        """Whether a client pushes in any phase."""
        return bool(self.forces.any() or self.pushes.any())

    @property
    def is_inside(self) -> bool:
        """Whether all attractors are within the joint limits."""
        return bool(np.all(np.abs(self.attractors) <= 1.0))


def random_command(rng: np.random.Generator, forced: bool) -> Command:
    """Anything: half of the commands stay in the joint box, the others leave it with some of the motors."""
    shape = (PHASES, MOTORS)
    inside = rng.uniform(-1.0, 1.0, shape)
    corners = np.where(rng.random(shape) < 0.5, np.sign(inside), inside)
    outside = np.sign(inside) * np.exp(rng.uniform(0.0, np.log(FAR), shape))
    attractors = corners if rng.random() < 0.5 else np.where(rng.random(shape) < 0.5, outside, corners)
    start, seconds = rng.uniform(-1.0, 1.0, MOTORS), np.exp(rng.uniform(np.log(SHORT), np.log(LONG), PHASES))
    pushes = (PHASES, DIMENSIONS)
    if not forced:
        return Command(start, attractors, seconds, np.zeros(shape), np.zeros(pushes))
    return Command(start, attractors, seconds, rng.choice(SIGNS, shape), rng.choice(SIGNS, pushes))


def vary(rng: np.random.Generator, one: Command, other: Command) -> Command:
    """One command with a little changed, and now and then with phases of another."""
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
        np.where(touched, changed, attractors).clip(-FAR, FAR),
        (np.where(take, other.seconds, one.seconds) * np.exp(step * rng.standard_normal(PHASES))).clip(SHORT, LONG),
        forces,
        pushes,
    )


def as_numbers(command: Command) -> list[float]:
    """For JSON: start, attractors, seconds, forces, pushes, one behind the other."""
    parts = (command.start, command.attractors.ravel(), command.seconds, command.forces.ravel(), command.pushes.ravel())
    return [round(float(x), 6) for x in np.concatenate(parts)]


def from_numbers(numbers: list[float]) -> Command:
    """What `as_numbers` has made."""
    ends = np.cumsum([MOTORS, PHASES * MOTORS, PHASES, PHASES * MOTORS])
    start, attractors, seconds, forces, pushes = np.split(np.array(numbers), ends)
    return Command(start, attractors.reshape(PHASES, -1), seconds, forces.reshape(PHASES, -1), pushes.reshape(PHASES, -1))
