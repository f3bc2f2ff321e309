# SPDX-License-Identifier: Apache-2.0
"""The scene of the eyes: the robot's solids, the world around it, and a camera in each eye."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from mobee.arrays import Array
from mobee.model.kinematics import link_transforms, matrix_from_quaternion
from mobee.model.world import World, WorldObject
from mobee.rendering.camera import Raster, eye_camera
from mobee.rendering.solid import Color, Solid
from mobee.robot.robot import Robot
from services.common.eyes import eye_frame

Picture = NDArray[np.uint8]

BACKGROUND = (168, 174, 182)
PART_COLORS: dict[str, Color] = {"torso": (0.62, 0.64, 0.67), "left_arm": (0.78, 0.79, 0.80), "right_arm": (0.70, 0.71, 0.73)}
OTHER_COLOR: Color = (0.6, 0.6, 0.55)
LIGHT = np.array([0.37, -0.24, 0.90], np.float32)  # unit vector towards the lamp: behind, left of and above the robot
AMBIENT, DIFFUSE = 0.65, 0.4  # brightness of a surface that is turned away from the lamp, and how much brighter one is that faces it


class Scene:
    """Mirrors the robot's links and the world's objects, and draws what an eye sees of them."""

    def __init__(self, robot: Robot, world: World, width: int = 320, height: int = 240, view_deg: float = 50.0) -> None:
        self._robot, self._size, self._view_deg = robot, (width, height), view_deg
        # The eyes are inside the shapes of the head.
        self._shapes = [shape for shape in robot.shapes if shape.role == "solid" and shape.part != "head"]
        self._objects = {item.name: _object_solid(item) for item in world.objects.values()}
        self._transforms = link_transforms(robot, robot.home)
        camera = eye_camera(np.zeros(3), np.eye(3), width, height, view_deg)
        left, up = camera.corner * camera.scale
        self.intrinsics = np.array([[camera.scale, 0.0, -left - 0.5], [0.0, camera.scale, up - 0.5], [0.0, 0.0, 1.0]])
        """(3, 3), with the middles of pixels at integers and the origin top left."""

    def pose(self, q: Array) -> None:
        """Put the robot's links where they are at q (n,) rad."""
        self._transforms = link_transforms(self._robot, q)

    def place(self, name: str, position: Array, quaternion: Array) -> None:
        """Put an object of the world at (3,) m, quaternion wxyz; a name that the world does not have is ignored."""
        if name in self._objects:
            self._objects[name] = replace(self._objects[name], position=position, rotation=matrix_from_quaternion(quaternion))

    def draw(self, eye: str) -> Picture:
        """Return the picture of the eye "left" or "right": (height, width, 3) bytes, red, green, blue."""
        origin, rotation = eye_frame(self._robot, self._transforms, eye)
        axes = rotation.T * np.array([[1.0], [-1.0], [1.0]])  # right, up, ahead
        seen = Raster(eye_camera(origin, axes, *self._size, self._view_deg), [*self._robot_solids(), *self._objects.values()])
        brightness = AMBIENT + DIFFUSE * np.maximum(seen.normal @ LIGHT, 0.0)
        picture: Picture = np.minimum(255.0 * seen.color * brightness[..., None], 255.0).astype(np.uint8)
        picture[np.isinf(seen.depth)] = BACKGROUND
        return picture

    def _robot_solids(self) -> list[Solid]:
        solids = []
        for shape in self._shapes:
            link = self._transforms[shape.link]
            position, rotation = link[:3, :3] @ shape.position + link[:3, 3], link[:3, :3] @ shape.rotation
            color = PART_COLORS.get(shape.part, OTHER_COLOR)
            solids.append(Solid(shape.kind, shape.size, position, rotation, color, vertices=shape.vertices))
        return solids


def _object_solid(item: WorldObject) -> Solid:
    red, green, blue = item.color[:3] if item.color else OTHER_COLOR
    return Solid(item.kind, item.size, item.position, item.rotation, (red, green, blue))
