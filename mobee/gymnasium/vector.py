# SPDX-License-Identifier: Apache-2.0
"""The common part of vector environments: spaces, random generators, and the ends of episodes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium import Space
from gymnasium.utils.seeding import np_random
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray


class RobotVectorEnv(VectorEnv[Any, Any, Any]):
    """The base of Gymnasium vector environments: several robots that are simulated together.

    In the step after the end of a robot's episode, its action is ignored and a new episode begins (`AutoresetMode.NEXT_STEP`).

    Args:
        num_envs: number of robots.
        max_episode_steps: number of steps after which an episode is truncated.
        observations: the space of one robot's observations.
        actions: the space of one robot's actions.
    """

    metadata: dict[str, Any] = {"render_modes": [], "autoreset_mode": AutoresetMode.NEXT_STEP}

    def __init__(self, num_envs: int, max_episode_steps: int, observations: Space[Any], actions: Space[Any]) -> None:
        self.num_envs, self.render_mode, self._most = num_envs, None, max_episode_steps
        self.single_observation_space, self.single_action_space = observations, actions
        self.observation_space, self.action_space = batch_space(observations, num_envs), batch_space(actions, num_envs)
        self._rngs = [np.random.default_rng(number) for number in range(num_envs)]
        self._steps = np.zeros(num_envs, dtype=np.intp)
        self._over = np.zeros(num_envs, dtype=bool)

    def _restart_all(self, seed: int | Sequence[int | None] | None) -> None:
        """Begin all episodes; random generators with a seed are new, as in separate environments."""
        if seed is None:
            seeds: Sequence[int | None] = [None] * self.num_envs
        else:
            seeds = seed if isinstance(seed, Sequence) else [seed + number for number in range(self.num_envs)]
        self._rngs = [rng if one is None else np_random(one)[0] for rng, one in zip(self._rngs, seeds, strict=True)]
        self._steps[:], self._over[:] = 0, False

    def _count_steps(self, terminated: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Count a step of each robot, except those that began a new episode in it; returns which episodes are truncated now."""
        self._steps = np.where(self._over, 0, self._steps + 1)
        truncated: NDArray[np.bool_] = self._steps >= self._most
        self._over = terminated | truncated
        return truncated
