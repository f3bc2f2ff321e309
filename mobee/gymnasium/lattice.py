# SPDX-License-Identifier: Apache-2.0
"""`MoBeE/Lattice-v0`: the states are cells of a lattice over a part's joints; a step lasts until the part has settled."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from gymnasium import Env
from gymnasium.spaces import Discrete
from numpy.typing import NDArray

from mobee.arrays import Array, Ints
from mobee.errors import InvalidValue
from mobee.gymnasium.registration import LATTICE_STEPS
from mobee.gymnasium.robots import (
    ARM,
    FRAMES_PER_S,
    SEEDS,
    Portrait,
    RobotFile,
    RobotVectorEnv,
    WorldFile,
    checked_render_mode,
    model_of,
    plant_settings,
    whole,
)
from mobee.learning.goal import target_states
from mobee.learning.lattice import Lattice, Levels
from mobee.learning.transitions import TransitionModel
from mobee.model.model import Model
from mobee.plant import Outcome
from mobee.rendering.picture import Picture
from mobee.settings import Settings, accepts
from mobee.simulation import OfflinePlant, PlantSettings, advance_together

Reward = Callable[[int, int, int, Outcome], float]
"""A function that returns the reward of a transition. Its arguments: state, action, state reached, and outcome of the action."""


@dataclass(frozen=True, kw_only=True)
class LatticeTask(Settings):
    """Settings of `MoBeE/Lattice-v0`.

    Args:
        robot: name of a shipped robot, path of an XML or URDF file, or a Robot.
        joints: motor names, all of one part.
        levels: fractions of each joint's range; the samples (points of the lattice) are at all combinations of them, see `mobee.Lattice`.
        neighbours: number of neighbours to which each state has actions; "equidistant": the neighbours one level away along one joint;
            None: 16, or all others if there are fewer.
        tie_seed: seed of the random choice among equally near neighbours. It defines the space; the seed of `reset` defines the noise.
        world: name of a shipped world, path of an XML file, or a World; None: nothing but the robot.
        plant: settings of the simulated robot; None: default gains, ticks of 20 ms.
        goal: a state or several; if the robot arrives there, the episode ends with the reward 1. None: there is no goal.
        reward: added to the reward of the goal: None: 0; "gain": the information gain of the transition in nats, under a model that counts
            all episodes of this environment; or a function, see `Reward`.
    """

    robot: RobotFile = "icub"
    joints: Sequence[str] = ARM
    levels: Levels = (0.25, 0.5, 0.75)
    neighbours: int | Literal["equidistant"] | None = None
    tie_seed: int = 0
    world: WorldFile = "table"
    plant: PlantSettings | None = None
    goal: int | Sequence[int] | None = None
    reward: Literal["gain"] | Reward | None = None


class _Lattice:
    """The space of a task and the robot's model, common to the environments of one vector."""

    def __init__(self, task: LatticeTask) -> None:
        self.model: Model = model_of(task.robot, task.world)
        self.space = Lattice(self.model.robot, task.joints, task.levels, task.neighbours, task.tie_seed)
        self.part = self.space.part
        self.plant_settings = plant_settings(task.plant, [self.part])
        self.observations, self.actions = Discrete(len(self.space)), Discrete(self.space.goals.shape[1])
        self.masks: NDArray[np.int8] = (self.space.goals >= 0).astype(np.int8)
        self.goal: frozenset[int] = frozenset() if task.goal is None else frozenset(target_states(self.space, task.goal).tolist())
        if not (task.reward in (None, "gain") or callable(task.reward)):
            raise InvalidValue(f'reward={task.reward!r}: give None, "gain", or a function of state, action, state reached and outcome.')
        self.reward = task.reward


class _Arm:
    """One robot on the lattice: its plant, its state, and the action under way."""

    def __init__(self, lattice: _Lattice) -> None:
        self._lattice = lattice
        self.plant = OfflinePlant(lattice.model, settings=lattice.plant_settings)
        self.learned = TransitionModel(lattice.space) if lattice.reward == "gain" else None
        self.state = self._measured()

    def restart(self, rng: np.random.Generator, options: dict[str, Any] | None) -> dict[str, Any]:
        """Put the robot at home, and move it to the state of the options, if there is one; returns the info."""
        lattice = self._lattice
        start = (options or {}).get("state")
        states = [] if start is None else target_states(lattice.space, start).tolist()
        if len(states) > 1:
            raise InvalidValue(f"state: {start!r}: give the number of one state.")
        self.plant.restart(int(rng.integers(SEEDS)))
        for state in states:
            self.plant.act(lattice.part, lattice.space.target(state))
        self.state = self._measured()
        return {"action_mask": lattice.masks[self.state].copy(), "q": self.plant.measure(lattice.part)}

    def begin(self, action: int) -> bool:
        """Start an action; returns False, and starts nothing, if the state has no such action."""
        space, part = self._lattice.space, self._lattice.part
        if not 0 <= action < len(space.actions(self.state)):
            return False
        self.plant.begin(part, space.aim(self.state, action))
        return True

    def end(self, action: int, outcome: Outcome | None) -> tuple[int, float, bool, dict[str, Any]]:
        """Return the state reached, the reward, whether the episode is over, and the info; `outcome`: None if nothing was started."""
        lattice, before = self._lattice, self.state
        info: dict[str, Any] = {"valid": outcome is not None}
        if outcome is None:
            outcome = Outcome(self.plant.measure(lattice.part), settled=True, duration=0.0)
            reward = 0.0
        else:
            self.state = lattice.space.state_of(outcome.q)
            reward = self._reward(before, action, outcome)
        over = info["valid"] and self.state in lattice.goal
        info |= {name: getattr(outcome, name) for name in ("q", "settled", "duration", "touched")}
        info["action_mask"] = lattice.masks[self.state].copy()
        return self.state, reward + float(over), over, info

    def _reward(self, before: int, action: int, outcome: Outcome) -> float:
        if self.learned is not None:
            return self.learned.observe(before, action, self.state)
        own = self._lattice.reward
        return float(own(before, action, self.state, outcome)) if callable(own) else 0.0

    def _measured(self) -> int:
        return self._lattice.space.state_of(self.plant.measure(self._lattice.part))


class LatticeEnv(Env[Any, Any]):
    """A Gymnasium environment: a part of a robot on a lattice. A step is a whole action, until the part has settled or timed out.

    Observation: the state, the number of a cell of the lattice. Action a sets the attractor (the pose to which the controller pulls the
    part) to the sample (the lattice point) of the a-th neighbour of the state, neighbours in ascending order. `info["action_mask"]` is 1
    for the actions that the present state has; any other action moves nothing and takes no time. A contact, a cable or a limit may stop the
    part in another state. `info` has the outcome: `q` (n_part,) rad by the encoders, `settled`, `duration` in s, `touched` (names of world
    objects in contact at the end), and `valid` (False if the state did not have the action).

    `reset` puts the robot at home; with `options={"state": s}` it then moves to that state, but an obstacle may stop it in another one.

    Args:
        render_mode: "rgb_array", or None: no pictures.
        settings: the task; None: the defaults.
        **changes: fields of `LatticeTask` by keyword, in place of the values in `settings`.
    """

    metadata: dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": FRAMES_PER_S}

    @accepts(LatticeTask)
    def __init__(self, render_mode: str | None = None, *, settings: LatticeTask | None = None, **changes: Any) -> None:
        self.task = LatticeTask.made(settings, changes)
        self.render_mode = checked_render_mode(render_mode, "rgb_array")
        self._lattice = _Lattice(self.task)
        self.observation_space, self.action_space = self._lattice.observations, self._lattice.actions
        self._arm = _Arm(self._lattice)
        self._portrait: Portrait | None = None

    @property
    def space(self) -> Lattice:
        """The lattice: the states, which are the observations, and their actions."""
        return self._lattice.space

    @property
    def plant(self) -> OfflinePlant:
        """The simulated robot."""
        return self._arm.plant

    @property
    def learned(self) -> TransitionModel | None:
        """The transition model from which the reward "gain" is computed; None with another reward."""
        return self._arm.learned

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[int, dict[str, Any]]:
        """Put the robot at home and return its state and info; `seed` determines the noise of this and all later episodes.

        `options={"state": s}`: the robot then moves to that state, before its state is read. Raises InvalidValue if there is no such state.
        """
        super().reset(seed=seed)
        info = self._arm.restart(self.np_random, options)
        return self._arm.state, info

    def step(self, action: int) -> tuple[int, float, bool, bool, dict[str, Any]]:
        """Perform a whole action of the part: the controller moves it until it has settled or timed out.

        `action`: its number among the actions of the present state, see the class. Return the state reached, the reward, whether the
        goal was reached (it ends the episode), False (never truncated here), and info.
        """
        action = whole("action", action)
        outcome = self._arm.plant.advance()[0][1] if self._arm.begin(action) else None
        state, reward, over, info = self._arm.end(action, outcome)
        return state, reward, over, False, info

    def render(self) -> Picture | None:
        """Return a picture (H, W, 3) of the robot in its world, or None if there is no render mode."""
        if self.render_mode is None:
            return None
        if self._portrait is None:
            self._portrait = Portrait(self._lattice.model)
        return self._portrait.picture(self._lattice.model.evaluate(self.plant.q), [self._lattice.part])


class LatticeVectorEnv(RobotVectorEnv):
    """Several `LatticeEnv`s whose actions are simulated together: each robot moves between poses of a lattice in joint space.

    Results are bit-equal to those of separate environments.

    In the step after the end of a robot's episode, its action is ignored and a new episode begins (`AutoresetMode.NEXT_STEP`).

    Args:
        num_envs: number of robots.
        max_episode_steps: number of steps after which an episode is truncated.
        threads: number of threads of the simulation.
        render_mode: only None is supported.
        settings: the task; None: the defaults.
        **changes: fields of `LatticeTask` by keyword, in place of the values in `settings`.
    """

    @accepts(LatticeTask)
    def __init__(
        self,
        num_envs: int = 1,
        max_episode_steps: int = LATTICE_STEPS,
        threads: int = 1,
        render_mode: None = None,
        *,
        settings: LatticeTask | None = None,
        **changes: Any,
    ) -> None:
        self.task = LatticeTask.made(settings, changes)
        self._lattice, self._threads = _Lattice(self.task), threads
        checked_render_mode(render_mode)
        super().__init__(num_envs, max_episode_steps, self._lattice.observations, self._lattice.actions)
        self._arms = [_Arm(self._lattice) for _ in range(num_envs)]

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Ints, dict[str, Any]]:
        """Put all robots at home and return their states (num_envs,) and infos.

        `seed`: a list with one seed for each robot, or the first of consecutive seeds. `options={"state": s}`: all robots then move to that
        state, before their states are read.
        """
        self._restart_all(seed)
        infos: dict[str, Any] = {}
        for number, (arm, rng) in enumerate(zip(self._arms, self._rngs, strict=True)):
            infos = self._add_info(infos, arm.restart(rng, options), number)
        return self._states(), infos

    def step(self, actions: Ints) -> tuple[Ints, Array, NDArray[np.bool_], NDArray[np.bool_], dict[str, Any]]:
        """Perform a whole action of each robot; a robot whose episode has ended ignores its action and begins a new episode.

        `actions`: (num_envs,), the index of a neighbour of each robot's state, as in `LatticeEnv`. Return states, rewards (0 for a robot
        that begins an episode), whether goals were reached, whether episodes are truncated, each (num_envs,), and infos.
        """
        given, over = np.asarray(actions), self._over
        if given.shape != (self.num_envs,) or given.dtype.kind not in "iu":
            raise InvalidValue(f"actions {given.tolist()!r}: give a whole number for each of the {self.num_envs} robots.")
        chosen = given.tolist()
        moving = [not done and arm.begin(action) for arm, action, done in zip(self._arms, chosen, over.tolist(), strict=True)]
        plants = [arm.plant for arm, moves in zip(self._arms, moving, strict=True) if moves]
        outcomes = iter(advance_together(plants, self._threads) if plants else [])
        infos: dict[str, Any] = {}
        rewards, terminated = np.zeros(self.num_envs), np.zeros(self.num_envs, dtype=bool)
        for number, arm in enumerate(self._arms):
            if over[number]:
                info = arm.restart(self._rngs[number], None)
            else:
                outcome = next(outcomes)[0][1] if moving[number] else None
                _, rewards[number], terminated[number], info = arm.end(chosen[number], outcome)
            infos = self._add_info(infos, info, number)
        truncated = self._count_steps(terminated)
        return self._states(), rewards, terminated, truncated, infos

    def _states(self) -> Ints:
        return np.array([arm.state for arm in self._arms], dtype=self.observation_space.dtype)
