# SPDX-License-Identifier: Apache-2.0
"""Gymnasium environments of small worlds (MDPs) that are given as tables of outcomes, probabilities and rewards."""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium import Env
from gymnasium.spaces import Discrete

from mobee.learning.tabular import TabularWorld, deep_sea, river_swim


class TabularEnv(Env[Any, Any]):
    """A Gymnasium environment of an MDP in tables; the observation is the state, and every episode starts in state 0.

    Args:
        world: the tables of outcomes, probabilities and rewards; every state has all actions.
        returning: True: an episode terminates when the state is 0 again; False: it never terminates.
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
        """Start in state 0; return it with an empty info. `seed` determines all later random outcomes."""
        super().reset(seed=seed)
        self._state = 0
        return 0, {}

    def step(self, action: int) -> tuple[int, float, bool, bool, dict[str, Any]]:
        """Draw the outcome of an action from the tables; return state, reward, whether the episode has ended, False, and an empty info."""
        row = self._cumulative[self._state, action]
        drawn = int(row.searchsorted(self.np_random.random() * row[-1], side="right"))
        reward = float(self.world.rewards[self._state, action, drawn])
        self._state = int(self.world.outcomes[self._state, action, drawn])
        return self._state, reward, self.returning and self._state == 0, False, {}


def river_swim_env(length: int = 6, render_mode: None = None) -> TabularEnv:
    """Return the MDP `mobee.learning.tabular.river_swim`, with `length` states, as an environment whose episodes never end.

    Made by its id, `MoBeE/RiverSwim-v0`, it truncates an episode after 200 steps.
    """
    return TabularEnv(river_swim(length), render_mode=render_mode)


def deep_sea_env(depth: int = 10, render_mode: None = None) -> TabularEnv:
    """Return the MDP `mobee.learning.tabular.deep_sea` as an environment; each episode ends after `depth` steps.

    The last of these steps returns to state 0, the top.
    """
    return TabularEnv(deep_sea(depth), returning=True, render_mode=render_mode)
