# SPDX-License-Identifier: Apache-2.0
"""The scene that cameras see: the links of the robot, the objects of the world, and a room and clutter around them.

A link is drawn as its visuals, or as its solids if it has none. Room and clutter are drawn on demand: backgrounds in which objects cannot
be found by colour alone.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mobee._core.rays import Chosen, Lamp, cast, shade
from mobee.arrays import Array, Ints
from mobee.model.kinematics import link_transforms, matrix_from_quaternion
from mobee.model.world import World
from mobee.model.world_object import WorldObject
from mobee.rendering.camera import Camera as View
from mobee.rendering.camera import Floats, eye_camera
from mobee.rendering.mesh import Piece, mesh_of
from mobee.rendering.solid import Color, LinkSolid, Packed, Solid, SolidKind, link_solids, packed
from mobee.robot.cameras import camera_frame, cameras_of
from mobee.robot.robot import Camera, Robot

Picture = NDArray[np.uint8]

BACKGROUND = (168, 174, 182)
OTHER_COLOR: Color = (0.6, 0.6, 0.55)
LAMP = Lamp((0.37, -0.24, 0.90), ambient=0.65, diffuse=0.4, nothing=BACKGROUND)  # behind, left of and above the robot

_STREAM = 0x726F6F6D  # of random numbers
FAR, HALF, FLOOR, CEILING = 2.2, 2.5, -0.95, 1.6  # m: the wall ahead, the walls aside, and the heights of floor and ceiling
BEFORE, SHEET = 0.01, 0.001  # m, of pictures before their wall, and the thickness of paper
PICTURES, THINGS, SHEETS = 14, 16, 22  # on each wall; before the walls; on a table
RED: Color = (0.78, 0.10, 0.10)
EDGE = 0.03  # m, at the edge of a table that stays free


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
        """Draw K pixels of a view: add the colour that each pixel shows (red, green, blue, 0 to 255) to `brightness` (K, 3), in place.

        The sum of several calls makes a picture with motion blur. `view`: place, axes and field of view of the camera. `hidden`: indices of
        links that are not drawn, such as the link of the camera. `pixels`: the K pixels.
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
        """Place the solids of links and world objects, and return all solids; each call returns the same tables, with new places.

        `transforms`: (L, 4, 4), pose of each link in the root frame. `objects`: the objects' solids at their new places, by name.
        """
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


def room(seed: int, colors: Sequence[Color] = (RED,)) -> list[Solid]:
    """Return the solids of a room: a floor, three walls with pictures on them, and things near the walls, out of the robot's reach.

    `colors`: colours (red, green, blue, 0 to 1) of the objects that vision has to find. On average, a quarter of the pictures and things
    have one of them; a sphere never has one. `seed`: seed of the random choices.
    """
    rng = np.random.default_rng([seed, _STREAM])
    low, high = FLOOR, CEILING
    solids = [
        _wall((-FAR, -HALF, low), (0.0, 2.0 * HALF, 0.0), (0.0, 0.0, high - low), (0.62, 0.64, 0.60)),
        _wall((-FAR, -HALF, low), (2.0 * FAR, 0.0, 0.0), (0.0, 0.0, high - low), (0.55, 0.58, 0.64)),
        _wall((-FAR, HALF, low), (2.0 * FAR, 0.0, 0.0), (0.0, 0.0, high - low), (0.66, 0.61, 0.55)),
        _wall((-FAR, -HALF, low), (2.0 * FAR, 0.0, 0.0), (0.0, 2.0 * HALF, 0.0), (0.42, 0.38, 0.34)),
    ]
    for _ in range(PICTURES):
        wide, tall = rng.uniform(0.15, 0.6, 2)
        z = rng.uniform(FLOOR + 0.4, CEILING - 0.4)
        ahead, aside = rng.uniform(-HALF + 0.4, HALF - 0.4), rng.uniform(-FAR + 0.4, 0.5)
        solids.append(_wall((-FAR + BEFORE, ahead, z), (0.0, wide, 0.0), (0.0, 0.0, tall), _color(rng, colors)))
        side = float(rng.choice((-1.0, 1.0))) * (HALF - BEFORE)
        solids.append(_wall((aside, side, z), (wide, 0.0, 0.0), (0.0, 0.0, tall), _color(rng, colors)))
    for _ in range(THINGS):
        at = np.array([rng.uniform(-FAR + 0.3, -1.2), rng.uniform(-1.6, 1.6), rng.uniform(FLOOR + 0.3, 0.6)])
        solids.append(_thing(rng, at, rng.uniform(0.03, 0.15), colors))
    return solids


def clutter(objects: Iterable[WorldObject], seed: int, colors: Sequence[Color] = (RED,)) -> list[Solid]:
    """Return sheets and discs of paper, 1 mm thick, that lie on the obstacles of kind "box" among the world's `objects`.

    They are only drawn and have no contacts. `colors`: colours (red, green, blue, 0 to 1) of the objects that vision has to find. On
    average, a quarter of the sheets and discs have one of them. `seed`: seed of the random choices.
    """
    rng = np.random.default_rng([seed, _STREAM, 1])
    solids = []
    for item in objects:
        if item.kind != "box" or item.role != "obstacle":
            continue
        half = 0.5 * np.array(item.size)
        for number in range(SHEETS):
            wide, long = rng.uniform(0.02, 0.12, 2)
            aside = rng.uniform(-1.0, 1.0, 2) * np.maximum(half[:2] - 0.5 * np.hypot(wide, long) - EDGE, 0.0)
            at = item.position + item.rotation @ np.array([*aside, half[2] + (number + 1) * 0.1 * SHEET])
            if rng.uniform() < 0.4:
                solids.append(Solid("cylinder", (0.5 * wide, SHEET), at, item.rotation, _color(rng, colors)))
            else:
                solids.append(_block(at, (wide, long, SHEET), _color(rng, colors), item.rotation @ _turned(rng)))
    return solids


def _thing(rng: np.random.Generator, at: Array, size: float, colors: Sequence[Color]) -> Solid:
    kinds: tuple[tuple[SolidKind, tuple[float, ...]], ...] = (
        ("sphere", (0.5 * size,)),
        ("cylinder", (0.4 * size, size)),
        ("box", (size, 0.7 * size, 1.3 * size)),
        ("capsule", (0.3 * size, size)),
    )
    kind, numbers = kinds[int(rng.integers(len(kinds)))]
    color = _color(rng, colors)
    if kind == "sphere" and color in colors:  # a red sphere is a ball, wherever it is
        color = (0.15, 0.35, 0.62)
    return Solid(kind, numbers, at, _turned(rng), color)


def _wall(corner: tuple[float, float, float], one: tuple[float, float, float], other: tuple[float, float, float], color: Color) -> Solid:
    """Return a parallelogram at a corner (3,) m with two edges (3,) m."""
    a, u, v = np.array(corner), np.array(one), np.array(other)
    mesh = mesh_of(Piece(np.array([a, a + u, a + u + v, a + v]), np.array([[0, 1, 2], [0, 2, 3]], dtype=np.intp)))
    return Solid("mesh", (), np.zeros(3), np.eye(3), color, mesh=mesh)


def _block(at: Array | tuple[float, float, float], size: tuple[float, float, float], color: Color, turned: Array | None = None) -> Solid:
    return Solid("box", size, np.array(at), np.eye(3) if turned is None else turned, color)


def _color(rng: np.random.Generator, colors: Sequence[Color]) -> Color:
    if rng.uniform() < 0.25:
        return colors[0] if len(colors) == 1 else colors[int(rng.integers(len(colors)))]
    red, green, blue = (float(one) for one in rng.uniform(0.1, 0.9, 3))
    return red, green, blue


def _turned(rng: np.random.Generator) -> Array:
    """Return a rotation (3, 3) about the vertical by a random angle."""
    angle = rng.uniform(0.0, 2.0 * np.pi)
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
