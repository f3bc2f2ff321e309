# SPDX-License-Identifier: Apache-2.0
"""Code that the environments of robots share: the base of vector environments, loading of robots and worlds, and pictures.

`RobotVectorEnv` has their spaces, random generators, and the ends of episodes. `plant_settings` gives the settings of their plants.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from operator import index
from pathlib import Path
from typing import Any

import numpy as np
from gymnasium import Space
from gymnasium.utils.seeding import np_random
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from mobee.arrays import checked_count
from mobee.errors import InvalidValue
from mobee.model.model import Model
from mobee.model.pose import Pose
from mobee.model.world import World
from mobee.model.world_file import load_world
from mobee.rendering.camera import Camera, camera_axes, framing
from mobee.rendering.picture import Picture, draw
from mobee.rendering.sheet import View
from mobee.rendering.solid import Solid, focus, lowest, object_solids, robot_solids
from mobee.robot.load import load_robot
from mobee.robot.robot import Robot, per_robot
from mobee.simulation import PlantSettings

ARM = ("l_shoulder_pitch", "l_shoulder_roll", "l_shoulder_yaw", "l_elbow")  # of the iCub: the joints of the published arm
TICK = 0.02  # s, of the plants unless their settings are given
VIEW: View = "oblique"
PICTURE_HEIGHT = 360  # pixels
RAYS = 2  # a pixel, in each direction
MARGIN = 0.15  # m, around the robot at home
SEEDS = 2**31  # seeds of plants are drawn below it
FRAMES_PER_S = 5  # of films of steps that take 0.2 s

RobotFile = Robot | str | Path
WorldFile = World | str | Path | None


@lru_cache(maxsize=16)
def _loaded(name: str | Path) -> Robot:
    return load_robot(name)


def model_of(robot: RobotFile, world: WorldFile) -> Model:
    """Return the model of a robot in a world; each is an object, the name of a shipped one, or a path. `world` None: an empty world.

    A robot file is loaded once: the models share the robot, which is never changed. A world file is loaded for each model.
    """
    found = robot if isinstance(robot, Robot) else _loaded(robot)
    return Model(found, load_world(world) if isinstance(world, str | Path) else world)


@per_robot
def guarded(robot: Robot) -> Robot:
    """Return a copy of the robot that tests two of its solids for contacts only if the fields of their links are tested too.

    A field is a shape around a link; its contacts cause repulsive forces, which keep the solids apart. For a link without fields, such as a
    finger, the fields of the nearest link towards the base that has fields are used. For example, upper arm and pelvis of the iCub are no
    longer tested: their hulls overlap when the arm is beside the body.
    """
    with_field = {shape.link for shape in robot.shapes if shape.role == "field"}
    guard = list(range(len(robot.links)))
    for number, joint in enumerate(robot.joints):
        if number + 1 not in with_field:
            guard[number + 1] = guard[joint.parent]
    of_shape = np.array(guard)[[shape.link for shape in robot.shapes]]
    solid, fields = (np.sort(of_shape[pairs], axis=1) @ [len(guard), 1] for pairs in (robot.solid_pairs, robot.field_pairs))
    return replace(robot, solid_pairs=robot.solid_pairs[np.isin(solid, fields)])


def plant_settings(given: PlantSettings | None, parts: Sequence[str]) -> PlantSettings:
    """Return the settings of a plant: `given`, or, if this is None, the default settings with ticks of 20 ms.

    `parts`: names of the parts that the plant may move; used only if the setting `active`, which names these parts, is None.
    """
    settings = PlantSettings(dt=TICK) if given is None else given
    return settings if settings.active is not None else replace(settings, active=tuple(parts))


def whole(what: str, given: Any) -> int:
    """Return a whole number as an int; raises InvalidValue for another number. `what`: what the number is, for the message."""
    try:
        return index(given)
    except TypeError:
        raise InvalidValue(f"{what} {given!r}: give a whole number.") from None


def checked_render_mode(given: Any, *drawn: str) -> Any:
    """Return the given render mode; raises InvalidValue unless it is None, or one of the modes that the environment has (`drawn`)."""
    if given is not None and given not in drawn:
        other = "" if drawn else ', or vectorization_mode="sync", which can draw'
        raise InvalidValue(f"render_mode={given!r}: give {' or '.join([*map(repr, drawn), 'None'])}{other}.")
    return given


class Portrait:
    """Draws pictures of the robot of a model in its world, always with the same camera."""

    def __init__(self, model: Model) -> None:
        at_home = robot_solids(model.evaluate(model.robot.home))
        self._floor = lowest([*at_home, *object_solids(model.world.objects)])
        self._camera: Camera = framing(camera_axes(VIEW), focus(at_home), np.empty((0, 3)), PICTURE_HEIGHT, MARGIN)

    def picture(self, pose: Pose, bright: Sequence[str], added: Sequence[Solid] = ()) -> Picture:
        """Return the picture (H, W, 3) of a pose.

        `bright`: names of the parts that are drawn in full colour; the others are pale. `added`: further solids to draw.
        """
        return draw([*robot_solids(pose, bright), *object_solids(pose.objects), *added], self._camera, self._floor, RAYS)


class RobotVectorEnv(VectorEnv[Any, Any, Any]):
    """The base of Gymnasium vector environments: several robots that are simulated together.

    In the step after the end of a robot's episode, its action is ignored and a new episode begins (`AutoresetMode.NEXT_STEP`).

    Args:
        num_envs: number of robots.
        max_episode_steps: number of steps after which an episode is truncated.
        observations: the space of one robot's observations.
        actions: the space of one robot's actions.

    Raises:
        InvalidValue: fewer than one robot or step.
    """

    metadata: dict[str, Any] = {"render_modes": [], "autoreset_mode": AutoresetMode.NEXT_STEP}

    def __init__(self, num_envs: int, max_episode_steps: int, observations: Space[Any], actions: Space[Any]) -> None:
        for name, number in (("num_envs", num_envs), ("max_episode_steps", max_episode_steps)):
            checked_count(name, number, 1)
        self.num_envs, self.render_mode, self._most = num_envs, None, max_episode_steps
        self.single_observation_space, self.single_action_space = observations, actions
        self.observation_space, self.action_space = batch_space(observations, num_envs), batch_space(actions, num_envs)
        self._rngs = [np_random()[0] for _ in range(num_envs)]  # without a seed, each vector differs, as separate environments do
        self._steps = np.zeros(num_envs, dtype=np.intp)
        self._over = np.zeros(num_envs, dtype=bool)

    def _restart_all(self, seed: int | Sequence[int | None] | None) -> None:
        """Begin all episodes.

        `seed`: one number for each robot, or one number, to which the number of the robot is added. A robot with a seed gets a new random
        generator, as a separate environment would; one with None keeps its generator.
        """
        if seed is None:
            seeds: Sequence[int | None] = [None] * self.num_envs
        else:
            seeds = seed if isinstance(seed, Sequence) else [seed + number for number in range(self.num_envs)]
        if len(seeds) != self.num_envs:
            raise InvalidValue(f"{len(seeds)} seeds: give one for each of the {self.num_envs} robots, or the first of consecutive seeds.")
        self._rngs = [rng if one is None else np_random(one)[0] for rng, one in zip(self._rngs, seeds, strict=True)]
        self._steps[:], self._over[:] = 0, False

    def _count_steps(self, terminated: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Count a step of each robot, except those that began a new episode in it; returns which episodes are truncated now."""
        self._steps = np.where(self._over, 0, self._steps + 1)
        truncated: NDArray[np.bool_] = self._steps >= self._most
        self._over = terminated | truncated
        return truncated
