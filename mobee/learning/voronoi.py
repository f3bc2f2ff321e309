# SPDX-License-Identifier: Apache-2.0
"""State spaces of random samples: the states are the Voronoi cells of the samples (thesis 6.2)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from mobee.arrays import Array, Ints, real_array
from mobee.errors import InvalidValue
from mobee.learning.neighbours import nearest_goals
from mobee.learning.space import MAX_STATES, Space, checked_joints, checked_neighbours
from mobee.robot.robot import Robot


class Voronoi(Space):
    """A space whose samples are drawn at random, or given; actions aim at the nearest samples.

    A state is the Voronoi cell of its sample. Distances are in fractions of the joint ranges. To make thousands of states takes seconds;
    memory grows in proportion to their number.

    Args:
        robot: the robot; samples are drawn within its motor limits.
        joints: motor names, all of one part.
        samples: number of samples to draw uniformly in the joint ranges, or the samples themselves, shape (S, d), in [rad].
        seed: seed of the random samples; ignored if the samples are given.
        neighbours: number of nearest samples to which each state has actions. None: 16, or all others if there are fewer.
        tie_seed: if several samples are equally near, but not all of them become neighbours, a random choice with this seed decides.
        rest: fraction of its range at which each other motor of the part stays.

    Raises:
        InvalidValue, UnknownName: an argument is out of its range or unknown; the message states the valid ones.
    """

    def __init__(
        self,
        robot: Robot,
        joints: Sequence[str],
        samples: int | ArrayLike,
        seed: int = 0,
        neighbours: int | None = None,
        tie_seed: int = 0,
        rest: float = 0.5,
    ) -> None:
        _, indices = checked_joints(robot, joints)
        limits = robot.limits[indices]
        drawn = isinstance(samples, (int, np.integer))
        poses = _drawn_samples(samples, limits, seed) if drawn else _checked_within(samples, limits, joints)
        self.seed, self.tie_seed = seed if drawn else None, tie_seed
        self.neighbours = checked_neighbours(neighbours, len(poses))
        goals: Ints = nearest_goals((poses - limits[:, 0]) / np.ptp(limits, axis=1), self.neighbours, tie_seed)
        super().__init__(robot, joints, poses, goals, rest)

    @property
    def settings(self) -> dict[str, Any]:
        """The constructor's arguments and a hash of the space, as JSON values.

        `mobee.learning.record.space_from` rebuilds the space from them.
        """
        samples = len(self) if self.seed is not None else self.samples.tolist()
        made = {"samples": samples, "seed": self.seed, "neighbours": self.neighbours, "tie_seed": self.tie_seed}
        return self._made | made | {"kind": "voronoi"}


def _drawn_samples(samples: Any, limits: Array, seed: int) -> Array:
    if isinstance(samples, bool) or not 2 <= samples <= MAX_STATES:
        raise InvalidValue(
            f"samples={samples!r}: give how many to draw, 2 to {MAX_STATES}, or an array of poses (S, {len(limits)}) in rad."
        )
    low, high = limits.T
    return np.random.default_rng(seed).uniform(low, high, size=(samples, len(limits)))


def _checked_within(samples: ArrayLike, limits: Array, joints: Sequence[str]) -> Array:
    given = real_array("samples", samples)
    if given.ndim != 2 or given.shape[1] != len(joints) or not 2 <= len(given) <= MAX_STATES:
        raise InvalidValue(
            f"samples have shape {given.shape}: give 2 to {MAX_STATES} poses of {', '.join(joints)}, shape (S, {len(joints)}), in rad."
        )
    outside = ~((given >= limits[:, 0]) & (given <= limits[:, 1]))
    if outside.any():
        sample, joint = np.argwhere(outside)[0]
        low, high = limits[joint]
        raise InvalidValue(f"sample {sample} has {joints[joint]} at {given[sample, joint]}: valid is {low:.4g} to {high:.4g} rad.")
    if len(np.unique(given, axis=0)) < len(given):
        raise InvalidValue("samples: two are the same pose, so one of them would have no cell; leave one out.")
    return given
