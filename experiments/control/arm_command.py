"""What one arm is told in a try, at random or as a variation of what was bad before."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mobee.robot.robot import Array

MOTORS = 7  # of an arm, without the fingers: the constraints are on the first five
PHASES = 3
FAR = 50.0  # half ranges from the middle of a range, the farthest attractor
SHORT, LONG = 0.05, 1.5  # s, a phase
STEPS = (0.5, 0.15, 0.05)  # of a variation: half ranges of the motors, and factors e^step of the times


@dataclass(frozen=True, slots=True, eq=False)
class Command:
    """Positions are in half ranges from the middle of a motor's range: inside the joint box they are -1 to 1."""

    start: Array  # (7,)
    attractors: Array  # (3, 7)
    seconds: Array  # (3,)
    forces: Array  # (3, 7): -1 to 1, of more than the squash lets through

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
    forces = rng.choice([-1.0, 0.0, 1.0], shape) if forced else np.zeros(shape)
    return Command(rng.uniform(-1.0, 1.0, MOTORS), attractors, np.exp(rng.uniform(np.log(SHORT), np.log(LONG), PHASES)), forces)


def vary(rng: np.random.Generator, one: Command, other: Command) -> Command:
    """One command with a little changed, and now and then with phases of another."""
    step = rng.choice(STEPS)
    take = rng.random(PHASES) < (0.5 if rng.random() < 0.3 else 0.0)
    attractors = np.where(take[:, None], other.attractors, one.attractors)
    touched = rng.random(attractors.shape) < 0.4
    changed = attractors + step * rng.standard_normal(attractors.shape) * np.maximum(np.abs(attractors), 1.0)
    if one.is_inside:
        changed = changed.clip(-1.0, 1.0)
    forces = np.where(take[:, None], other.forces, one.forces)
    if one.forces.any():
        forces = np.where(rng.random(forces.shape) < 0.1, rng.choice([-1.0, 0.0, 1.0], forces.shape), forces)
    return Command(
        (one.start + step * rng.standard_normal(MOTORS)).clip(-1.0, 1.0),
        np.where(touched, changed, attractors).clip(-FAR, FAR),
        (np.where(take, other.seconds, one.seconds) * np.exp(step * rng.standard_normal(PHASES))).clip(SHORT, LONG),
        forces,
    )


def as_numbers(command: Command) -> list[float]:
    """For JSON: start, attractors, seconds, forces, one behind the other."""
    parts = (command.start, command.attractors.ravel(), command.seconds, command.forces.ravel())
    return [round(float(x), 6) for x in np.concatenate(parts)]


def from_numbers(numbers: list[float]) -> Command:
    """What `as_numbers` has made."""
    start, attractors, seconds, forces = np.split(np.array(numbers), np.cumsum([MOTORS, PHASES * MOTORS, PHASES]))
    return Command(start, attractors.reshape(PHASES, MOTORS), seconds, forces.reshape(PHASES, MOTORS))
