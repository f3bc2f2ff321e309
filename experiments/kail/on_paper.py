"""Rewards try by try, of actions whose outcomes are known."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from experiments.kail.spaces import space_of
from mobee import TransitionModel
from mobee.robot.robot import Array

TRIES = 30
REPEATS = 400
Outcome = Callable[[np.random.Generator, int], int]  # draws the outcome of an action with this goal


def sound(rng: np.random.Generator, goal: int) -> int:
    """The goal."""
    return goal


def failing(rng: np.random.Generator, goal: int) -> int:
    """One other state."""
    return (goal + 7) % 27


def uncertain(rng: np.random.Generator, goal: int) -> int:
    """The goal or one of two other states, equally likely."""
    return (goal, (goal + 7) % 27, (goal + 11) % 27)[int(rng.integers(3))]


KINDS: dict[str, Outcome] = {"sound": sound, "failing": failing, "uncertain": uncertain}


def rewards(part: str, divergence: str, outcome: Outcome, repeats: int = REPEATS) -> Array:
    """What each of 30 tries of one action paid, (repeats, 30)."""
    space, rng = space_of(part), np.random.default_rng(0)
    goal = int(space.goals[0, 0])
    paid = np.empty((repeats, TRIES))
    for row in paid:
        model = TransitionModel(space, divergence=divergence)
        for number in range(TRIES):
            row[number] = model.observe(0, 0, outcome(rng, goal))
    return paid


def told_apart(part: str, divergence: str, kind: str) -> float:
    """After how many tries of each a greedy agent prefers the other action to a sound one, with what it was paid last: mean.

    Infinite where 30 tries do not suffice on average.
    """
    other = rewards(part, divergence, KINDS[kind])
    plain = rewards(part, divergence, sound, repeats=1)[0]
    dearer = other > 1.05 * plain  # rewards within 5 % are not told apart
    first = np.where(dearer.any(axis=1), dearer.argmax(axis=1) + 1, np.inf)
    return float(first.mean())
