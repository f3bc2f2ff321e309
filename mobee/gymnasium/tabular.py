# SPDX-License-Identifier: Apache-2.0
"""Tabular worlds as Gymnasium environments."""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium import Env
from gymnasium.spaces import Discrete

from mobee.learning.tabular import TabularWorld, deep_sea, river_swim


class TabularEnv(Env[Any, Any]):
    """A world of tables as an environment: states are observations, every episode starts in state 0.

    Args:
        world: the tables of outcomes, probabilities and rewards; every state has all actions.
        returning: whether an episode ends when the state is 0 again.
        render_mode: only None is supported.
    """

    metadata: dict[str, Any] = {"render_modes": []}

    def __init__(self, world: TabularWorld, returning: bool = False, render_mode: None = None) -> None:
        states, actions = world.outcomes.shape[:2]
        self.world, self.returning, self.render_mode = world, returning, render_mode
        self.observation_space, self.action_space = Discrete(states), Discrete(actions)
        self._cumulative = np.cumsum(world.probabilities, axis=-1)
        self._state = 0

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[int, dict[str, Any]]:
        """Start in state 0; `seed` determines all later draws."""
        super().reset(seed=seed)
        self._state = 0
        return 0, {}

    def step(self, action: int) -> tuple[int, float, bool, bool, dict[str, Any]]:
        """Draw the outcome of an action from the tables."""
        row = self._cumulative[self._state, action]
        drawn = int(row.searchsorted(self.np_random.random() * row[-1], side="right"))
        reward = float(self.world.rewards[self._state, action, drawn])
        self._state = int(self.world.outcomes[self._state, action, drawn])
        return self._state, reward, self.returning and self._state == 0, False, {}


def river_swim_env(length: int = 6, render_mode: None = None) -> TabularEnv:
    """Return `mobee.learning.tabular.river_swim` as an environment without end; its id has a limit of 200 steps."""
    return TabularEnv(river_swim(length), render_mode=render_mode)


def deep_sea_env(depth: int = 10, render_mode: None = None) -> TabularEnv:
    """Return `mobee.learning.tabular.deep_sea` as an environment whose episode ends after `depth` steps, at the top again."""
    return TabularEnv(deep_sea(depth), returning=True, render_mode=render_mode)
