# SPDX-License-Identifier: Apache-2.0
"""`MoBeE/Table-v0`: several parts of a robot at a table; each part is an agent of PettingZoo's parallel interface."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Annotated, Any, Literal

import numpy as np
from gymnasium.spaces import Discrete
from gymnasium.utils.seeding import np_random

from mobee.errors import InvalidValue, NotInstalled, UnknownName
from mobee.gymnasium.robots import (
    ARM,
    FRAMES_PER_S,
    SEEDS,
    Portrait,
    RobotFile,
    WorldFile,
    checked_render_mode,
    model_of,
    plant_settings,
    whole,
)
from mobee.learning.lattice import Lattice, Levels
from mobee.learning.transitions import TransitionModel
from mobee.plant import Outcome
from mobee.rendering.picture import Picture
from mobee.settings import Range, Settings, accepts
from mobee.simulation import OfflinePlant, PlantSettings

try:
    from pettingzoo import ParallelEnv
except ImportError:
    raise NotInstalled('MoBeE/Table-v0 needs PettingZoo, which is not installed: pip install "mobee[gym]"') from None

TORSO = ("torso_yaw", "torso_roll", "torso_pitch")
PARTS: Mapping[str, Sequence[str]] = MappingProxyType(
    {"torso": TORSO, "left_arm": ARM, "right_arm": tuple(name.replace("l_", "r_", 1) for name in ARM)}
)
NEIGHBOURS: Mapping[str, int] = MappingProxyType({"torso": 8})  # published; the arms have 16


@dataclass(frozen=True, kw_only=True)
class TableTask(Settings):
    """Settings of `MoBeE/Table-v0`.

    Args:
        robot: name of a shipped robot, path of an XML or URDF file, or a Robot.
        parts: a dict from the name of each part, an agent, to the joints of its lattice (grid of poses, one for each state).
        levels: fractions of each joint's range; the samples (points of a lattice) are at all combinations of them, see `mobee.Lattice`.
        neighbours: a dict from a part's name to the number of neighbours to which each of its states has actions; for parts that it does
            not name: 16, or all other states if there are fewer.
        world: name of a shipped world, path of an XML file, or a World; None: nothing but the robot.
        plant: settings of the simulated robot; None: default gains, ticks of 20 ms.
        reward: "gain": the information gain of each transition in nats, under a model that counts all episodes; None: 0.
        steps: number of steps after which an episode is truncated.
    """

    robot: RobotFile = "icub"
    parts: Mapping[str, Sequence[str]] = field(default_factory=lambda: PARTS)
    levels: Levels = (0.25, 0.5, 0.75)
    neighbours: Mapping[str, int] = field(default_factory=lambda: NEIGHBOURS)
    world: WorldFile = "table"
    plant: PlantSettings | None = None
    reward: Literal["gain"] | None = None
    steps: Annotated[int, Range(gt=0)] = 200


class TableEnv(ParallelEnv[str, int, int]):  # type: ignore[misc]  # PettingZoo has no type information
    """A PettingZoo environment: several parts of one robot act at the same time, and each begins its next action when it has settled.

    Each agent is a part. Its observation is its own state: the number of the nearest pose of its lattice (grid of poses, `mobee.Lattice`).
    Its action is an index into the neighbours of this state, in ascending order. It does not observe the other parts. A step begins the
    actions of all agents whose parts are at rest, then simulates until at least one part has settled or timed out.

    `infos[agent]["ready"]`: whether the agent's action has ended. If it is True, the info has the outcome (`q` (n_part,) rad by the
    encoders, `settled`, `duration` in s, `touched`), the agent gets its reward, and its next action is used. If it is False, the part still
    moves: the observation is the previous one, the reward is 0, and an action for this agent is ignored. `infos[agent]["action_mask"]` is 1
    for the valid actions; all are 0 while the part moves. An action that the state does not have leaves the part at rest for this step.

    All agents' episodes are truncated together, after `steps` steps.

    Args:
        render_mode: "rgb_array", or None: no pictures.
        settings: the task; None: the defaults.
        **changes: fields of `TableTask` by keyword, in place of the values in `settings`.

    Raises:
        InvalidValue, UnknownName: the robot does not have a part or joint, or the fractions in `levels` are not valid.
    """

    metadata: dict[str, Any] = {"name": "MoBeE/Table-v0", "render_modes": ["rgb_array"], "render_fps": FRAMES_PER_S}

    @accepts(TableTask)
    def __init__(self, render_mode: str | None = None, *, settings: TableTask | None = None, **changes: Any) -> None:
        self.task = task = TableTask.made(settings, changes)
        self.render_mode = checked_render_mode(render_mode, "rgb_array")
        self._model = model_of(task.robot, task.world)
        if task.neighbours is not NEIGHBOURS and (unknown := [name for name in task.neighbours if name not in task.parts]):
            raise UnknownName("part with neighbours", unknown[0], task.parts)
        self.spaces = {part: self._space(part, joints) for part, joints in task.parts.items()}
        """The lattice of each agent: its states and actions."""
        self.possible_agents = list(self.spaces)
        self.agents: list[str] = []
        self.observation_spaces = {part: Discrete(len(space)) for part, space in self.spaces.items()}
        self.action_spaces = {part: Discrete(space.goals.shape[1]) for part, space in self.spaces.items()}
        self.plant = OfflinePlant(self._model, settings=plant_settings(task.plant, self.possible_agents))
        """The simulated robot."""
        self.learned = {part: TransitionModel(space) for part, space in self.spaces.items()} if task.reward == "gain" else {}
        """By agent, the transition model from which the reward "gain" is computed; empty with another reward."""
        self._states = {part: 0 for part in self.spaces}
        self._under_way: dict[str, int] = {}
        self._steps = 0
        self._rng = np_random(None)[0]
        self._portrait: Portrait | None = None

    def observation_space(self, agent: str) -> Discrete:
        """Return the space of an agent's observations, the numbers of its states; it is always the same object, as PettingZoo requires."""
        return self.observation_spaces[agent]

    def action_space(self, agent: str) -> Discrete:
        """Return the space of an agent's actions, the indices of neighbours; it is always the same object, as PettingZoo requires."""
        return self.action_spaces[agent]

    def reset(self, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[dict[str, int], dict[str, dict[str, Any]]]:
        """Put the robot at home; return the agents' states and infos. `seed` determines the noise of this and all later episodes."""
        if seed is not None:
            self._rng = np_random(seed)[0]
        self.plant.restart(int(self._rng.integers(SEEDS)))
        self.agents, self._under_way, self._steps = list(self.possible_agents), {}, 0
        self._states = {part: space.state_of(self.plant.measure(part)) for part, space in self.spaces.items()}
        return dict(self._states), {part: {"ready": True, "action_mask": self._mask(part)} for part in self.agents}

    def step(
        self, actions: Mapping[str, int]
    ) -> tuple[dict[str, int], dict[str, float], dict[str, bool], dict[str, bool], dict[str, dict[str, Any]]]:
        """Begin the actions of the parts at rest, and simulate until at least one part has ended its action.

        `actions`: a dict from the agent to its action; actions of parts that still move, and actions that the state does not have, are
        ignored. Return states, rewards, terminated (always False), truncated (True after `steps` steps) and infos, each a dict by agent.
        The infos are explained at the class.
        """
        for name in actions:
            if name not in self.spaces:
                raise UnknownName("agent", name, self.spaces)
        for part in self.agents:
            if part not in self._under_way and part in actions:
                self._begin(part, whole("action", actions[part]))
        ended = dict(self.plant.advance()) if self._under_way else {}
        self._steps += 1
        rewards, infos = {}, {}
        for part in self.agents:
            rewards[part] = self._learn(part, ended[part]) if part in ended else 0.0
            infos[part] = {"ready": part not in self._under_way, "action_mask": self._mask(part)}
            if part in ended:
                infos[part] |= {name: getattr(ended[part], name) for name in ("q", "settled", "duration", "touched")}
        truncated = self._steps >= self.task.steps
        agents, self.agents = self.agents, [] if truncated else self.agents
        seen = {part: self._states[part] for part in agents}
        return seen, rewards, dict.fromkeys(agents, False), dict.fromkeys(agents, truncated), infos

    def render(self) -> Picture | None:
        """Return a picture (H, W, 3) of the robot in its world, or None if there is no render mode."""
        if self.render_mode is None:
            return None
        if self._portrait is None:
            self._portrait = Portrait(self._model)
        return self._portrait.picture(self._model.evaluate(self.plant.q), self.possible_agents)

    def _space(self, part: str, joints: Sequence[str]) -> Lattice:
        space = Lattice(self._model.robot, joints, self.task.levels, self.task.neighbours.get(part))
        if space.part != part:
            raise InvalidValue(f"parts[{part!r}] names joints of {space.part}: give motors of {part}.")
        return space

    def _begin(self, part: str, action: int) -> None:
        space, state = self.spaces[part], self._states[part]
        if 0 <= action < len(space.actions(state)):
            self.plant.begin(part, space.aim(state, action))
            self._under_way[part] = action

    def _learn(self, part: str, outcome: Outcome) -> float:
        """Record the outcome of a part's action; returns the reward."""
        before, action = self._states[part], self._under_way.pop(part)
        self._states[part] = self.spaces[part].state_of(outcome.q)
        return self.learned[part].observe(before, action, self._states[part]) if self.learned else 0.0

    def _mask(self, part: str) -> Any:
        mask = (self.spaces[part].goals[self._states[part]] >= 0).astype(np.int8)
        return np.zeros_like(mask) if part in self._under_way else mask


parallel_env = TableEnv
"""`TableEnv` under the name that PettingZoo's tools expect in the module of an environment."""
