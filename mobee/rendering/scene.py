# SPDX-License-Identifier: Apache-2.0
"""The scene that cameras see: the visuals of the robot's links (or their solids, if they have none), and the objects of the world."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mobee._core.rays import Chosen, Lamp, cast, shade
from mobee.arrays import Array, Ints
from mobee.model.kinematics import link_transforms, matrix_from_quaternion
from mobee.model.world import World, WorldObject
from mobee.rendering.camera import Camera as View
from mobee.rendering.camera import Floats, eye_camera
from mobee.rendering.link_solids import LinkSolid, link_solids
from mobee.rendering.solid import Color, Packed, Solid, packed
from mobee.robot.cameras import camera_frame, cameras_of
from mobee.robot.robot import Robot
from mobee.robot.visual import Camera

Picture = NDArray[np.uint8]

BACKGROUND = (168, 174, 182)
OTHER_COLOR: Color = (0.6, 0.6, 0.55)
LAMP = Lamp((0.37, -0.24, 0.90), ambient=0.65, diffuse=0.4, nothing=BACKGROUND)  # behind, left of and above the robot


@dataclass(frozen=True, slots=True, eq=False)
class Pixels:
    """A selection of K pixels of a view; the ray of each pixel is computed once, also if the pixel is selected several times.

    `chosen`: the pixels whose rays are computed, in the form that the compiled core reads; None: all pixels of the view. The computed rays
    are numbered from 0, row by row. `rays`: (K,), for each selected pixel the number of its ray.
    """

    chosen: Chosen | None
    rays: Ints

    @classmethod
    def some(cls, height: int, width: int, places: Ints) -> Pixels:
        """Select pixels of a view of height x width pixels; `places`: (K,) indices row * width + column, which may repeat."""
        mask = np.zeros(height * width, np.bool_)
        mask[places] = True
        return cls(Chosen.of(mask.reshape(height, width)), (np.cumsum(mask) - 1)[places])

    @classmethod
    def every(cls, height: int, width: int) -> Pixels:
        """Select all pixels of a view of height x width pixels, row by row."""
        return cls(None, np.arange(height * width))


class Scene:
    """Draws what cameras see of a robot and a world; it has its own copies of the links' poses and the objects."""

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
        """Make the scene with the robot at home and the objects at their present places.

        Args:
            robot: the robot.
            world: its objects.
            cameras: by name; None: those of the robot.
            width: columns of a picture.
            height: rows of a picture.
            worn: further solids that are drawn on links, such as a tag.
            around: further solids that do not move, in the root frame, such as a room.
        """
        self._robot, self._size = robot, (width, height)
        self.cameras = dict(cameras_of(robot) if cameras is None else cameras)
        self._link_solids = (*link_solids(robot), *worn)
        self._around = list(around)
        self._objects = {item.name: _object_solid(item) for item in world.objects.values()}
        self._transforms = link_transforms(robot, robot.home)
        self._shown: dict[frozenset[int], _Shown] = {}  # by hidden links
        self._every = Pixels.every(height, width)

    def intrinsics(self, name: str) -> Array:
        """Return the camera matrix (3, 3) px of the camera `name`; centres of pixels are at integers, and the origin is top left."""
        view = self._view(name)
        left, up = view.corner * view.scale
        return np.array([[view.scale, 0.0, -left - 0.5], [0.0, view.scale, up - 0.5], [0.0, 0.0, 1.0]])

    def pose(self, q: Array) -> None:
        """Move the robot's links to their poses at q (n,) rad."""
        self._transforms = link_transforms(self._robot, q)

    def place(self, name: str, position: Array, quaternion: Array) -> None:
        """Move an object of the world; a name that the world does not have is ignored.

        `position`: (3,) m, root frame. `quaternion`: (4,), wxyz.
        """
        if name in self._objects:
            self._objects[name] = replace(self._objects[name], position=position, rotation=matrix_from_quaternion(quaternion))

    @property
    def transforms(self) -> Array:
        """The present transforms of all links, (L, 4, 4), which map a point's position at zero pose to its present one, root frame."""
        return self._transforms

    def draw(self, name: str) -> Picture:
        """Return the picture of the camera `name`, (height, width, 3) bytes red, green, blue."""
        width, height = self._size
        brightness = np.zeros((height * width, 3), np.float32)
        self.light(self._view(name), self.cameras[name].hidden, self._every, brightness)
        picture: Picture = brightness.astype(np.uint8)
        return picture.reshape(height, width, 3)

    def light(self, view: View, hidden: frozenset[int], pixels: Pixels, brightness: Floats) -> None:
        """Draw K pixels of a view: add what they show to `brightness` (K, 3), in place: red, green and blue, 0 to 255.

        `view`: place, axes and field of view of the camera. `hidden`: indices of links that are not drawn, such as the link of the camera.
        `pixels`: the K pixels.
        """
        shown = self._packed(hidden)
        packs = shown.at(self._transforms, self._objects)
        _, which, normal = cast(packs.volumes, packs.surfaces, view.rays(), pixels.chosen)
        shade(which, normal, pixels.rays, shown.colors, LAMP, brightness)

    def objects_at(self, view: View, hidden: frozenset[int], pixels: Pixels) -> Ints:
        """Return the index of the world object that each of K pixels of a view shows, (K,); -1: no object.

        Objects are numbered in the order of the world. `view`: place, axes and field of view of the camera. `hidden`: indices of links that
        are not drawn. `pixels`: the K pixels.
        """
        shown = self._packed(hidden)
        packs = shown.at(self._transforms, self._objects)
        which = cast(packs.volumes, packs.surfaces, view.rays(), pixels.chosen)[1]
        found: Ints = shown.objects[which.ravel()[pixels.rays]]
        return found

    def _packed(self, hidden: frozenset[int]) -> _Shown:
        if hidden not in self._shown:
            self._shown[hidden] = _Shown([one for one in self._link_solids if one.link not in hidden], self._objects, self._around)
        return self._shown[hidden]

    def _view(self, name: str) -> View:
        camera = self.cameras[name]
        origin, rotation = camera_frame(camera, self._transforms)
        axes = rotation.T * np.array([[1.0], [-1.0], [1.0]])  # right, up, ahead
        return eye_camera(origin, axes, *self._size, camera.view_deg)


class _Shown:
    """What a camera sees, packed once: later only the places of links and objects are written."""

    def __init__(self, worn: Sequence[LinkSolid], objects: Mapping[str, Solid], around: Sequence[Solid]) -> None:
        solids = [*(one.solid for one in worn), *objects.values(), *around]
        self._packs = packed(solids)
        numbers, convex = np.array(self._packs.numbers, dtype=np.intp), len(self._packs.volumes)
        self._volumes, self._surfaces = (part[part < len(worn)] for part in (numbers[:convex], numbers[convex:]))
        self._links = np.array([one.link for one in worn], dtype=np.intp)
        self._positions = np.array([one.solid.position for one in worn]).reshape(-1, 3, 1)
        self._rotations = np.array([one.solid.rotation for one in worn]).reshape(-1, 3, 3)
        of_world = numbers - len(worn)
        is_object = (of_world >= 0) & (of_world < len(objects))
        self.objects = np.append(np.where(is_object, of_world, -1), -1)  # the number of each; the last is nothing
        self.colors = (np.float32(255.0) * np.array([solids[number].color for number in numbers], np.float32)).reshape(-1, 3)

    def at(self, transforms: Array, objects: Mapping[str, Solid]) -> Packed:
        """Return the solids where links, by their transforms (L, 4, 4), and objects are."""
        links = transforms[self._links]
        positions = (links[:, :3, :3] @ self._positions)[..., 0] + links[:, :3, 3]
        rotations = links[:, :3, :3] @ self._rotations
        for table, own in ((self._packs.volumes, self._volumes), (self._packs.surfaces, self._surfaces)):
            table["center"][: len(own)], table["rotation"][: len(own)] = positions[own], rotations[own]
        for row, solid in zip(self._packs.volumes[len(self._volumes) :], objects.values(), strict=False):  # objects are volumes
            row["center"], row["rotation"] = solid.position, solid.rotation
        return self._packs


def _object_solid(item: WorldObject) -> Solid:
    red, green, blue = item.color[:3] if item.color else OTHER_COLOR
    return Solid(item.kind, item.size, item.position, item.rotation, (red, green, blue))
