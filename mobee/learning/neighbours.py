"""Which states the actions of a lattice state aim at."""

from __future__ import annotations

import numpy as np

from mobee.robot.robot import Array, Ints

NO_ACTION = -1
DISTANCE_DECIMALS = 9  # distances that agree to here are a tie, whatever the rounding of the fractions


def lattice_digits(levels: int, joints: int) -> Ints:
    """The level of each joint in each state, first joint fastest: shape (levels ** joints, joints)."""
    return np.arange(levels**joints)[:, None] // levels ** np.arange(joints) % levels


def equidistant_goals(digits: Ints, levels: int) -> Ints:
    """The states one lattice step away along one joint, ascending: shape (S, A), padded with NO_ACTION (thesis 7.2)."""
    states = np.arange(len(digits))
    strides = levels ** np.arange(digits.shape[1])
    down = np.where(digits > 0, states[:, None] - strides, NO_ACTION)[:, ::-1]
    up = np.where(digits < levels - 1, states[:, None] + strides, NO_ACTION)
    goals = np.concatenate([down, up], axis=1)
    missing = goals == NO_ACTION
    to_the_left = np.argsort(missing, axis=1, kind="stable")
    return np.take_along_axis(goals, to_the_left, axis=1)[:, : (~missing).sum(axis=1).max()]


def nearest_goals(points: Array, count: int, tie_seed: int) -> Ints:
    """The nearest other points of each point, ties drawn at random, ascending: shape (S, count).

    One row at a time: memory grows with S, time with S squared.
    """
    rng = np.random.default_rng(tie_seed)
    goals = np.empty((len(points), count), dtype=np.intp)
    for state, point in enumerate(points):
        distance = np.round(((points - point) ** 2).sum(axis=1), DISTANCE_DECIMALS)
        distance[state] = np.inf
        last = np.partition(distance, count - 1)[count - 1]
        certain = np.flatnonzero(distance < last)
        tied = np.flatnonzero(distance == last)
        drawn = rng.choice(tied, size=count - len(certain), replace=False)
        goals[state] = np.sort(np.concatenate([certain, drawn]))
    return goals
