# SPDX-License-Identifier: Apache-2.0
"""The scene of the cameras: the robot as its file draws it, and the world around it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from mobee._core.rays import cast
from mobee.arrays import Array, Ints
from mobee.model.kinematics import link_transforms, matrix_from_quaternion
from mobee.model.world import World, WorldObject
from mobee.rendering.camera import Camera as View
from mobee.rendering.camera import Floats, Raster, eye_camera
from mobee.rendering.link_solids import LinkSolid, link_solids
from mobee.rendering.solid import Color, Solid, packed
from mobee.robot.cameras import camera_frame, cameras_of
from mobee.robot.robot import Robot
from mobee.robot.visual import Camera

Picture = NDArray[np.uint8]

BACKGROUND = (168, 174, 182)
OTHER_COLOR: Color = (0.6, 0.6, 0.55)
LIGHT = np.array([0.37, -0.24, 0.90], np.float32)  # unit vector towards the lamp: behind, left of and above the robot
AMBIENT, DIFFUSE = 0.65, 0.4  # brightness of a surface that is turned away from the lamp, and how much brighter one is that faces it


class Scene:
    """Mirrors the robot's links and the world's objects, and draws what a camera sees of them."""

    def __init__(
        self,
        robot: Robot,
        world: World,
        cameras: Mapping[str, Camera] | None = None,
        width: int = 320,
        height: int = 240,
        worn: Sequence[LinkSolid] = (),
        around: Sequence[Solid] = (),
    ) -> None:
        """`cameras`: by name; None: those of the robot.  `worn`: drawn on links beside the robot; `around`: drawn where they are."""
        self._robot, self._size = robot, (width, height)
        self.cameras = dict(cameras_of(robot) if cameras is None else cameras)
        self._link_solids = (*link_solids(robot), *worn)
        self._around = list(around)
        self._objects = {item.name: _object_solid(item) for item in world.objects.values()}
        self._transforms = link_transforms(robot, robot.home)

    def intrinsics(self, name: str) -> Array:
        """Return the matrix (3, 3) of a camera, with the middles of pixels at integers and the origin top left."""
        view = self._view(name)
        left, up = view.corner * view.scale
        return np.array([[view.scale, 0.0, -left - 0.5], [0.0, view.scale, up - 0.5], [0.0, 0.0, 1.0]])

    def pose(self, q: Array) -> None:
        """Set the robot's links to their poses at q (n,) rad."""
        self._transforms = link_transforms(self._robot, q)

    def place(self, name: str, position: Array, quaternion: Array) -> None:
        """Put an object of the world at (3,) m, quaternion wxyz; a name that the world does not have is ignored."""
        if name in self._objects:
            self._objects[name] = replace(self._objects[name], position=position, rotation=matrix_from_quaternion(quaternion))

    @property
    def transforms(self) -> Array:
        """The transforms of the links (L, 4, 4), from link_transforms."""
        return self._transforms

    def draw(self, name: str) -> Picture:
        """Return the picture of a camera: (height, width, 3) bytes, red, green, blue."""
        seen = Raster(self._view(name), self._solids(self.cameras[name].hidden))
        brightness = AMBIENT + DIFFUSE * np.maximum(seen.normal @ LIGHT, 0.0)
        picture: Picture = np.minimum(255.0 * seen.color * brightness[..., None], 255.0).astype(np.uint8)
        picture[np.isinf(seen.depth)] = BACKGROUND
        return picture

    def light(self, view: View, hidden: frozenset[int], pixels: Ints) -> Floats:
        """Return the brightness (K, 3) of red, green and blue in some pixels of a view, 0 to 255, without the `hidden` links.

        `pixels`: (K,), row * width + column.
        """
        solids = self._solids(hidden)
        packs = packed(solids)
        _, which, normal = cast(packs.volumes, packs.surfaces, view.rays())
        colors = np.array([*(solids[number].color for number in packs.numbers), (0.0, 0.0, 0.0)], np.float32)  # the last is of nothing
        seen = which.ravel()[pixels]
        brightness = AMBIENT + DIFFUSE * np.maximum(normal.reshape(-1, 3)[pixels] @ LIGHT, 0.0)
        found: Floats = np.minimum(255.0 * colors[seen] * brightness[:, None], 255.0)
        found[seen < 0] = BACKGROUND
        return found

    def _solids(self, hidden: frozenset[int]) -> list[Solid]:
        robot = [one.at(self._transforms) for one in self._link_solids if one.link not in hidden]
        return [*robot, *self._objects.values(), *self._around]

    def _view(self, name: str) -> View:
        camera = self.cameras[name]
        origin, rotation = camera_frame(camera, self._transforms)
        axes = rotation.T * np.array([[1.0], [-1.0], [1.0]])  # right, up, ahead
        return eye_camera(origin, axes, *self._size, camera.view_deg)


def _object_solid(item: WorldObject) -> Solid:
    red, green, blue = item.color[:3] if item.color else OTHER_COLOR
    return Solid(item.kind, item.size, item.position, item.rotation, (red, green, blue))
