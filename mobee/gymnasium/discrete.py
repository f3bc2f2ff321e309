# SPDX-License-Identifier: Apache-2.0
"""Discrete environments: any environment of Gymnasium as a plant for the curious agent, and worlds in tables as environments.

The worlds are small MDPs that are given as tables of outcomes, probabilities and rewards.
"""

from __future__ import annotations

import re
from typing import Any

import numpy as np
from gymnasium import Env
from gymnasium.spaces import Discrete
from numpy.typing import ArrayLike

from mobee.arrays import Array
from mobee.errors import ActionInterrupted, InvalidValue
from mobee.learning.discrete import DiscreteSpace, InstantPlant
from mobee.learning.tabular import TabularWorld, deep_sea, river_swim
from mobee.plant import Outcome

_ADDRESS = re.compile(r" at 0x[0-9a-fA-F]+")  # in the repr of a function: another in each process


class EnvPlant(InstantPlant):
    """A discrete Gymnasium environment as a plant: its observations are states, and one of its steps is an action.

    Use:  `plant = EnvPlant(env); agent = mobee.CuriousAgent(plant.space, plant, beliefs="debiased"); agent.run(1000)`

    If an episode terminates, its last state is a state like any other: every action there leads to the first observation of the next
    episode, and the agent learns this. If an episode is truncated, the next action raises ActionInterrupted, as on a robot that was
    stopped. The agent must then measure the first state of the new episode, so that it learns no wrong transition; `agent.run` does this.

    Args:
        env: the environment; its observations and actions must be Discrete, so wrap other environments first.
        seed: seed of the first reset.
        goals: (S, A) the state to which each action is expected to lead; None: not known; the goal of each action is then the state in
            which it starts. With `beliefs="debiased"` goals have little influence on the agent's plans (see `DiscreteSpace`).

    Raises:
        InvalidValue: observations or actions are not Discrete.
    """

    space: DiscreteSpace

    def __init__(self, env: Env[Any, Any], seed: int = 0, goals: ArrayLike | None = None) -> None:
        self._first_state, states = _counted(env.observation_space, "observations")
        self._first_action, actions = _counted(env.action_space, "actions")
        self.env = env
        super().__init__(DiscreteSpace(states, actions, goals))
        self.rewards: Array = np.zeros((states, actions))
        """The mean of the environment's rewards for each state and action so far, 0 before the first, shape (S, A)."""
        self.returns: list[float] = []
        """The sum of the environment's rewards in each episode that has ended."""
        self.info: dict[str, Any] = {}
        """The environment's info of the last step or reset."""
        self._tries = np.zeros((states, actions), dtype=np.intp)
        self._return = 0.0
        self._terminated = self._truncated = False
        self._state = self._reset(seed)

    @property
    def state(self) -> int:
        """The number of the state that was observed last, from 0."""
        return self._state

    @property
    def settings(self) -> dict[str, Any]:
        """The id and the arguments of the environment, as JSON values; empty for an environment that was not made by its id."""
        spec = self.env.spec
        if spec is None:
            return {}
        return {"env": spec.id, "arguments": {name: _ADDRESS.sub("", repr(value)) for name, value in spec.kwargs.items()}}

    @property
    def q(self) -> Array:
        """The last observed state as motor positions, (2,): its number, and 0.

        These are the positions of the two motors "state" and "action" by which `DiscreteSpace` represents states and actions.
        """
        return self.space.target(self._state)

    def measure(self, part: str) -> Array:
        """Return the last observed state as motor positions, (2,): its number, and 0, as in `q`.

        `part`: must be `space.part`, else UnknownName is raised.
        """
        self._check_part(part)
        return self.q

    def act(self, part: str, target: Array) -> Outcome:
        """Make one step of the environment and return its outcome; a step counts as 1 s.

        `part`: must be `space.part`. `target`: (2,), from `space.aim`: the expected state and the action. If the last step truncated the
        episode, the action is not made, a new episode begins, and ActionInterrupted is raised.
        """
        self._check_part(part)
        action = self.space.action_of(target)
        if self._truncated and not self._terminated:
            self._state = self._reset()
            raise ActionInterrupted("the episode was truncated and a new one has begun: measure the state again.")
        if self._terminated:
            self._state = self._reset()
        else:
            self._state = self._step(action)
        return Outcome(self.q, settled=True, duration=1.0)

    def _step(self, action: int) -> int:
        state = self._state
        seen, reward, self._terminated, self._truncated, self.info = self.env.step(action + self._first_action)
        self._tries[state, action] += 1
        self.rewards[state, action] += (float(reward) - self.rewards[state, action]) / self._tries[state, action]
        self._return += float(reward)
        if self._terminated or self._truncated:
            self.returns.append(self._return)
        return int(seen) - self._first_state

    def _reset(self, seed: int | None = None) -> int:
        seen, self.info = self.env.reset(seed=seed)
        self._return, self._terminated, self._truncated = 0.0, False, False
        return int(seen) - self._first_state


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


def _counted(space: Any, what: str) -> tuple[int, int]:
    """Return the first number of a Discrete space and their count; raises InvalidValue for another space."""
    if not isinstance(space, Discrete):
        raise InvalidValue(
            f"{what} of the environment are {space}: they must be Discrete. Wrap the environment so that each has a number, "
            "for example with gymnasium.wrappers.TransformObservation."
        )
    return int(space.start), int(space.n)
