# SPDX-License-Identifier: Apache-2.0
"""The things that a robot can recognise: name, kind of shape, usual size and colour, and the outline of each shape in a picture."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from mobee.arrays import Array
from mobee.model.world import World
from mobee.rendering.solid import Color

Kind = Literal["sphere", "cylinder", "box"]
KINDS: tuple[Kind, ...] = get_args(Kind)
TOLERANCE = 0.1  # relative standard deviation of a size from the usual one
RIM = 48  # points of a circle
SCALED: dict[Kind, tuple[tuple[int, ...], ...]] = {"sphere": ((0, 1, 2),), "cylinder": ((0, 1), (2,)), "box": ((0,), (1,), (2,))}
"""The axes (0, 1, 2) that each length of a shape scales: a cylinder has a radius (axes 0 and 1) and a height (axis 2)."""
_ANGLES = 2.0 * np.pi * (np.arange(RIM) + 0.5) / RIM
_CIRCLE = np.stack([np.cos(_ANGLES), np.sin(_ANGLES)], axis=1)
_CORNERS = 0.5 * np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])


@dataclass(frozen=True, slots=True)
class Thing:
    """A kind of object that vision can recognise by shape, size and colour; a world may have several objects of the kind.

    `kind`: "sphere", "cylinder" or "box". `size` in m: sphere (radius,); cylinder (radius, height); box (x, y, z), full edges. Cylinders
    and boxes stand upright. `color`: red, green, blue, 0 to 1. `tolerance`: relative standard deviation of each length from `size`; 0: the
    size is known exactly.
    """

    name: str
    kind: Kind
    size: tuple[float, ...]
    color: Color
    tolerance: float = TOLERANCE


def things_in(world: World) -> list[Thing]:
    """Return a `Thing` (name, shape, size, colour) for each target of a world that is a sphere, cylinder or box and has a colour.

    A target is an object with the role "target". The positions of the objects are not used.
    """
    kinds: dict[str, Kind] = {kind: kind for kind in KINDS}
    return [
        Thing(item.name, kinds[item.kind], item.size, item.color[:3])
        for item in world.objects.values()
        if item.role == "target" and item.kind in kinds and item.color is not None
    ]


def upright(yaw: float) -> Array:
    """Return the rotation (3, 3) about the vertical axis z by the angle `yaw` [rad]."""
    c, s = np.cos(yaw), np.sin(yaw)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def surface(kind: Kind, size: Array) -> Array:
    """Return points (m, 3) m on the surface of a shape, in its own axes, relative to its middle.

    They are the corners of a box, points of both rims of a cylinder (its axis is z), or six points of a sphere. `size`: lengths of the
    shape [m] in the order of `Thing.size`.
    """
    if kind == "box":
        found: Array = _CORNERS * size
        return found
    if kind == "sphere":
        return float(size[0]) * np.concatenate([np.eye(3), -np.eye(3)])
    rim = size[0] * _CIRCLE
    return np.concatenate([np.column_stack([rim, np.full(RIM, sign * 0.5 * size[1])]) for sign in (-1.0, 1.0)])


def touching(kind: Kind, size: Array, position: Array, rotation: Array, directions: Array) -> tuple[Array, Array]:
    """Return the points of a shape whose images are farthest along given directions; they lie on its silhouette.

    Args:
        kind: kind of the shape.
        size: the lengths of the shape [m], in the order of `Thing.size`.
        position: (3,) m, middle of the shape in the camera's frame; the whole shape must be ahead of the camera.
        rotation: (3, 3), from the shape's axes to the camera's frame.
        directions: unit vectors (K, 2) in the image plane x / z, y / z.

    Returns:
        One point of the shape for each direction, relative to its middle, in the camera's frame, (K, 3) m; and the scalar product of the
        point's image (x / z, y / z) with the direction, (K,).
    """
    if kind == "sphere":
        return _touching_sphere(float(size[0]), position, directions)
    offsets = surface(kind, size) @ rotation.T
    points = position + offsets
    along = (points[:, :2] / points[:, 2:]) @ directions.T  # (m, K)
    farthest = along.argmax(axis=0)
    return offsets[farthest], along[farthest, np.arange(len(directions))]


def _touching_sphere(radius: float, position: Array, directions: Array) -> tuple[Array, Array]:
    """Return what `touching` returns, for a sphere of the given radius [m].

    The plane through the camera with the normal (n, -h) touches the sphere where n.x - h z = -r sqrt(1 + h^2); n: a direction, x and z: the
    position of the middle, r: the radius. h is the second value that is returned.
    """
    a, z = directions @ position[:2], position[2]
    square = z * z - radius * radius
    h = (a * z + radius * np.sqrt(np.maximum(a * a + square, 0.0))) / square
    normal = np.column_stack([directions, -h]) / np.sqrt(1.0 + h * h)[:, None]
    return radius * normal, h
