# SPDX-License-Identifier: Apache-2.0
"""`MoBeE/Reach-v0`: reach positions with a hand. Actions move the attractor of an arm, and the controller prevents collisions.

The attractor is the position to which the spring of the control law pulls the joints.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Literal

import numpy as np
from gymnasium import Env
from gymnasium.spaces import Box, Dict
from numpy.typing import ArrayLike, NDArray

from mobee.arrays import Array, Ints, real_array
from mobee.errors import InvalidValue, MobeeError
from mobee.gymnasium.registration import REACH_STEPS
from mobee.gymnasium.robots import (
    ARM,
    FRAMES_PER_S,
    SEEDS,
    Portrait,
    RobotFile,
    RobotVectorEnv,
    WorldFile,
    checked_render_mode,
    guarded,
    model_of,
    plant_settings,
)
from mobee.learning.space import checked_joints
from mobee.model.model import Model
from mobee.rendering.picture import Picture
from mobee.rendering.solid import ball
from mobee.robot.robot import Robot
from mobee.settings import Range, Settings, accepts
from mobee.simulation import OfflinePlant, PlantBatch, PlantSettings

GOAL_DRAWS = 2000  # postures that are drawn for a goal before it is given up
NOISE = 0.1  # rad, by which encoders may read more than the limits
GOAL_COLOR = (0.86, 0.20, 0.16)
_ONLY: Ints = np.array([0])  # the number of the robot of an environment that is alone

Observation = dict[str, Array]


@dataclass(frozen=True, kw_only=True)
class ReachTask(Settings):
    """Settings of `MoBeE/Reach-v0`.

    Args:
        robot: name of a shipped robot, path of an XML or URDF file, or a Robot.
        joints: motor names, all of one part; the attractors of the part's other motors (the positions to which the control law pulls them)
            stay at home.
        marker: the marker of the robot that must reach the goals.
        world: name of a shipped world, path of an XML file, or a World; None: nothing but the robot.
        plant: settings of the simulated robot; None: default gains, ticks (periods of the controller) of 20 ms.
        period: duration of a step, s, rounded to whole ticks.
        step: largest motion of a joint's attractor in one step (action 1), rad.
        tolerance: distance at which a goal counts as reached, m.
        reward: "sparse": 0 at the goal and -1 elsewhere; "dense": the negative distance in m.
    """

    robot: RobotFile = "icub"
    joints: Sequence[str] = ARM
    marker: str = "left_palm"
    world: WorldFile = "table"
    plant: PlantSettings | None = None
    period: Annotated[float, Range(gt=0)] = 0.2
    step: Annotated[float, Range(gt=0)] = 0.2
    tolerance: Annotated[float, Range(gt=0)] = 0.05
    reward: Literal["sparse", "dense"] = "sparse"


class _Reaching:
    """The model, the spaces and the rewards, which the environments of one vector share."""

    def __init__(self, task: ReachTask) -> None:
        given = model_of(task.robot, task.world)
        robot = guarded(given.robot)
        self.model = Model(robot, given.world)
        part, self.joints = checked_joints(robot, task.joints)
        self.part, self.marker = part.name, robot.marker(task.marker).name
        self.low, self.high = robot.limits[self.joints].T
        q = np.tile(robot.home, (3, 1))
        q[:, self.joints] = self.low + np.multiply.outer([0.25, 0.5, 0.75], self.high - self.low)
        if not np.ptp(self.model.evaluate(q).position(self.marker), axis=0).any():
            raise InvalidValue(f"marker={task.marker!r} is moved by none of {', '.join(task.joints)}: take one that {self.part} carries.")
        self.plant_settings = plant_settings(task.plant, [self.part])
        self.ticks = max(1, round(task.period / self.plant_settings.dt))
        self.step, self.tolerance, self.sparse = task.step, task.tolerance, task.reward == "sparse"
        count = len(self.joints)
        self.actions = Box(-1.0, 1.0, (count,), np.float64)
        place = Box(-(far := extent(robot, self.marker)), far, (3,), np.float64)
        fastest = np.array([robot.motor_table[motor].max_velocity for motor in self.joints])
        least, most = np.concatenate([self.low - NOISE, self.low, -fastest]), np.concatenate([self.high + NOISE, self.high, fastest])
        self.observations = Dict(observation=Box(least, most, dtype=np.float64), achieved_goal=place, desired_goal=place)

    def draw_goal(self, rng: np.random.Generator, plant: OfflinePlant) -> Array:
        """Return the marker's place (3,) m in a random posture in which no force acts on the joints: the arm can rest there."""
        q, no_contact = self.model.robot.home.copy(), np.zeros(len(self.model.robot.motors))
        for _ in range(GOAL_DRAWS):
            q[self.joints] = rng.uniform(self.low, self.high)
            if self._pushed(plant.controller.law.forces(q, no_contact, None)):  # limits and constraints: sooner computed than contacts
                continue
            pose = self.model.evaluate(q)
            if not pose.projection[self.joints].any():
                return pose.position(self.marker)
        raise MobeeError(
            f"no goal found: in {GOAL_DRAWS} random postures of {self.part} some force of contacts, limits or constraints acts on "
            "its joints. Take other joints, or a world with more room."
        )

    def _pushed(self, forces: Array) -> bool:
        return bool(forces[:, self.joints].any())

    def robots(self, count: int, threads: int = 1) -> PlantBatch:
        """Return new robots, simulated in `threads` threads."""
        return PlantBatch(self.model, count, self.plant_settings, threads)

    def move(self, robots: PlantBatch, which: Ints, actions: Array) -> Array:
        """Move the attractors of robots by actions (k, d), within the joints' limits, and simulate a step.

        Returns the deepest contacts of the step, of solids and of fields, (k, 2) m.
        """
        attractors = robots.state()[which, 1]
        moved = attractors[:, self.joints] + self.step * np.clip(actions, -1.0, 1.0)
        attractors[:, self.joints] = np.clip(moved, self.low, self.high)
        robots.aim(which, attractors)
        return robots.run(which, self.ticks)

    def observe(self, robots: PlantBatch, goals: Array) -> Observation:
        """Return the observations of all robots, with goals (count, 3) m: each entry is (count, ...)."""
        state = robots.state()
        seen = state[:, :, self.joints].reshape(len(goals), -1)
        achieved = self.model.evaluate(state[:, 0]).position(self.marker)
        return {"observation": seen, "achieved_goal": achieved, "desired_goal": goals.copy()}

    def judge(self, achieved: Array, desired: Array) -> tuple[Array, NDArray[np.bool_]]:
        """Return rewards (...) and whether the goals are reached (...) for places (..., 3) m."""
        distance = np.linalg.norm(achieved - desired, axis=-1)
        reached = distance <= self.tolerance
        return (reached - 1.0 if self.sparse else -distance), reached


def extent(robot: Robot, marker: str) -> float:
    """Return an upper bound [m] on the distance of the marker from the origin of the root frame.

    It is the length of the path from the origin, from joint to joint, to the marker, plus the largest strokes of the sliding joints.
    """
    point, link, total = robot.markers[marker].position, robot.markers[marker].link, 0.0
    while link > 0:
        joint = robot.joints[link - 1]
        total += float(np.linalg.norm(point - joint.point))
        total += float(np.abs(joint.limits).max()) if joint.kind == "prismatic" else 0.0
        point, link = joint.point, joint.parent
    return total + float(np.linalg.norm(point))


class ReachEnv(Env[Any, Any]):
    """A Gymnasium environment: reach positions with a hand, while the controller of MoBeE prevents collisions.

    An action (d,) in [-1, 1] moves the attractor of each of the d joints (the position to which the control law's spring pulls it) by up to
    `step` rad, within the joint's limits; then `period` seconds are simulated. Contacts of fields, joint limits and cable constraints cause
    forces during every step. A solid is a rigid volume of a link. A field is a larger volume around a link; it is not solid, but its
    contacts cause repulsive forces.

    The observation is a dict: `observation` (3 d,): positions of the joints by the encoders [rad], their attractors [rad], and the
    controller's own velocities [rad/s]; `achieved_goal` (3,): position of the marker, a named point on the robot, and
    `desired_goal` (3,): its goal, both in m in the root frame. A goal is the position of the marker in a random posture in which no force
    acts on the joints. An episode never terminates; an environment that was made by its id truncates it after 50 steps.

    `info["is_success"]`: whether the marker is at the goal now. `info["solid_depth"]` and `info["field_depth"]`: m, depth of the deepest
    contact of solids and of fields during the step, 0 without a contact. `solid_depth` includes all contacts of the robot's solids with the
    world. It includes contacts between solids of two links only if the fields of these links are tested against each other (see
    `mobee.gymnasium.robots.guarded`).

    `reset` puts the robot at home and draws a goal, or takes `options={"goal": (x, y, z)}`, m, root frame.

    Args:
        render_mode: "rgb_array", or None: no pictures.
        settings: the task; None: the defaults.
        **changes: fields of `ReachTask` by keyword, in place of the values in `settings`.
    """

    metadata: dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": FRAMES_PER_S}

    @accepts(ReachTask)
    def __init__(self, render_mode: str | None = None, *, settings: ReachTask | None = None, **changes: Any) -> None:
        self.task = ReachTask.made(settings, changes)
        self.render_mode = checked_render_mode(render_mode, "rgb_array")
        self._reaching = _Reaching(self.task)
        self.observation_space, self.action_space = self._reaching.observations, self._reaching.actions
        self._robots = self._reaching.robots(1)
        self._goal: Array = np.zeros(3)
        self._portrait: Portrait | None = None

    @property
    def plant(self) -> OfflinePlant:
        """The simulated robot."""
        return self._robots.plants[0]

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Observation, dict[str, Any]]:
        """Put the robot at home and draw a goal; return observation and info.

        `seed`: determines the noise and the goals of this and all later episodes. `options={"goal": (x, y, z)}`: use this goal, m, root
        frame.
        """
        super().reset(seed=seed)
        self.plant.restart(int(self.np_random.integers(SEEDS)))
        self._goal = _chosen_goals(options, self._reaching.draw_goal(self.np_random, self.plant))
        seen = self._observed()
        return seen, {"is_success": bool(self._reaching.judge(seen["achieved_goal"], self._goal)[1])}

    def step(self, action: ArrayLike) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Move the attractors of the joints by an action (d,) in [-1, 1], times `step` rad, and simulate `period` seconds.

        An attractor is the position to which the control law pulls a joint.
        Return observation, reward, False (never terminated), False (never truncated here), and info.
        """
        actions = _checked_actions(action, self.action_space.shape)[None]
        ((solid, field),) = self._reaching.move(self._robots, _ONLY, actions)
        seen = self._observed()
        reward, reached = self._reaching.judge(seen["achieved_goal"], self._goal)
        return seen, float(reward), False, False, {"is_success": bool(reached), "solid_depth": float(solid), "field_depth": float(field)}

    def compute_reward(self, achieved_goal: ArrayLike, desired_goal: ArrayLike, info: Any = None) -> Any:
        """Return the rewards for any positions of the marker and goals, as hindsight experience replay needs them.

        `achieved_goal`: positions of the marker, (..., 3) m, root frame. `desired_goal`: goals, (..., 3) m. `info`: not used. The result
        has shape (...).
        """
        return self._reaching.judge(np.asarray(achieved_goal), np.asarray(desired_goal))[0]

    def render(self) -> Picture | None:
        """Return a picture (H, W, 3) of the robot in its world, with the goal as a red ball, or None if there is no render mode."""
        if self.render_mode is None:
            return None
        if self._portrait is None:
            self._portrait = Portrait(self._reaching.model)
        pose = self._reaching.model.evaluate(self.plant.q)
        return self._portrait.picture(pose, [self._reaching.part], [ball(self._goal, self.task.tolerance / 2.0, GOAL_COLOR, veiled=0.3)])

    def _observed(self) -> Observation:
        return {name: rows[0] for name, rows in self._reaching.observe(self._robots, self._goal[None]).items()}


def _checked_actions(given: ArrayLike, shape: tuple[int, ...] | None) -> Array:
    """Return actions as an array; raises InvalidValue for another shape than `shape`, or for NaN."""
    actions = real_array("action", given)
    if actions.shape != shape or np.isnan(actions).any():
        raise InvalidValue(f"action of shape {actions.shape}: give numbers in [-1, 1], shape {shape}, and no NaN.")
    return actions


def _chosen_goals(options: dict[str, Any] | None, drawn: Array) -> Array:
    """Return the goals of the options of a reset, in the shape of the drawn ones, (3,) or (num_envs, 3) m; without any, the drawn ones."""
    given = (options or {}).get("goal")
    if given is None:
        return drawn
    try:
        goals = np.broadcast_to(np.asarray(given, dtype=np.float64), drawn.shape).copy()
    except (TypeError, ValueError):
        raise InvalidValue(f"goal: {given!r} is not a position, three numbers in m, or one position for each robot") from None
    if not np.isfinite(goals).all():
        raise InvalidValue(f"goal: {given!r} has numbers that are not finite")
    return goals


class ReachVectorEnv(RobotVectorEnv):
    """Several robots that reach, simulated together; the results of each are bit-equal to those of a separate `ReachEnv`.

    In the step after the end of a robot's episode, its action is ignored and a new episode begins (`AutoresetMode.NEXT_STEP`).

    Args:
        num_envs: number of robots.
        max_episode_steps: number of steps after which an episode is truncated.
        threads: number of threads of the simulation.
        render_mode: only None is supported.
        settings: the task; None: the defaults.
        **changes: fields of `ReachTask` by keyword, in place of the values in `settings`.
    """

    @accepts(ReachTask)
    def __init__(
        self,
        num_envs: int = 1,
        max_episode_steps: int = REACH_STEPS,
        threads: int = 1,
        render_mode: None = None,
        *,
        settings: ReachTask | None = None,
        **changes: Any,
    ) -> None:
        self.task = ReachTask.made(settings, changes)
        self._reaching = _Reaching(self.task)
        checked_render_mode(render_mode)
        super().__init__(num_envs, max_episode_steps, self._reaching.observations, self._reaching.actions)
        self._robots = self._reaching.robots(num_envs, threads)
        self._goals = np.zeros((num_envs, 3))

    @property
    def plants(self) -> list[OfflinePlant]:
        """The simulated robots, one for each environment."""
        return self._robots.plants

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Put all robots at home and draw a goal for each; return observations and infos, each entry (num_envs, ...).

        `seed`: a list with one seed for each robot, or the first of consecutive seeds. `options={"goal": (x, y, z)}`: use this goal, m,
        root frame, or one goal for each robot, (num_envs, 3); in later episodes goals are drawn.
        """
        self._restart_all(seed)
        for number in range(self.num_envs):
            self._begin(number)
        self._goals = _chosen_goals(options, self._goals)
        seen = self._reaching.observe(self._robots, self._goals)
        return seen, self._infos(self._reaching.judge(seen["achieved_goal"], self._goals)[1])

    def step(self, actions: Array) -> tuple[Observation, Array, NDArray[np.bool_], NDArray[np.bool_], dict[str, Any]]:
        """Move the attractors by actions (num_envs, d) in [-1, 1], times `step` rad, and simulate `period` seconds.

        An attractor is the position to which the control law pulls a joint. A robot whose episode has ended ignores its action, begins a
        new episode and gets the reward 0. Return observations, rewards, False (never terminated), whether episodes are truncated, each
        (num_envs, ...), and infos.
        """
        begun, depths = self._over, np.zeros((self.num_envs, 2))
        going = np.flatnonzero(~begun)
        depths[going] = self._reaching.move(self._robots, going, _checked_actions(actions, self.action_space.shape)[going])
        for number in np.flatnonzero(begun).tolist():
            self._begin(number)
        seen = self._reaching.observe(self._robots, self._goals)
        rewards, reached = self._reaching.judge(seen["achieved_goal"], self._goals)
        infos = self._infos(reached)
        infos |= {"solid_depth": depths[:, 0], "_solid_depth": ~begun, "field_depth": depths[:, 1], "_field_depth": ~begun}
        terminated = np.zeros(self.num_envs, dtype=bool)
        return seen, np.where(begun, 0.0, rewards), terminated, self._count_steps(terminated), infos

    def _begin(self, number: int) -> None:
        plant, rng = self.plants[number], self._rngs[number]
        plant.restart(int(rng.integers(SEEDS)))
        self._goals[number] = self._reaching.draw_goal(rng, plant)

    def _infos(self, reached: NDArray[np.bool_]) -> dict[str, Any]:
        return {"is_success": reached, "_is_success": np.ones(self.num_envs, dtype=bool)}
