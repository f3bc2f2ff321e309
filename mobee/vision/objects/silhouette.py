# SPDX-License-Identifier: Apache-2.0
"""Silhouettes of spheres, upright cylinders and boxes: where lines in the picture's plane touch them."""

from __future__ import annotations

import numpy as np

from mobee.arrays import Array
from mobee.vision.objects.thing import Kind

RIM = 48  # points of a circle
SCALED: dict[Kind, tuple[tuple[int, ...], ...]] = {"sphere": ((0, 1, 2),), "cylinder": ((0, 1), (2,)), "box": ((0,), (1,), (2,))}
"""The axes along which each length of a kind of shape scales it."""

_ANGLES = 2.0 * np.pi * (np.arange(RIM) + 0.5) / RIM
_CIRCLE = np.stack([np.cos(_ANGLES), np.sin(_ANGLES)], axis=1)
_CORNERS = 0.5 * np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])


def upright(yaw: float) -> Array:
    """Return the rotation (3, 3) about the vertical by an angle [rad]."""
    c, s = np.cos(yaw), np.sin(yaw)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def surface(kind: Kind, size: Array) -> Array:
    """Return points (m, 3) m of a shape in its own axes: the corners of a box, the rims of a cylinder, six points of a sphere."""
    if kind == "box":
        found: Array = _CORNERS * size
        return found
    if kind == "sphere":
        return float(size[0]) * np.concatenate([np.eye(3), -np.eye(3)])
    rim = size[0] * _CIRCLE
    return np.concatenate([np.column_stack([rim, np.full(RIM, sign * 0.5 * size[1])]) for sign in (-1.0, 1.0)])


def touching(kind: Kind, size: Array, position: Array, rotation: Array, directions: Array) -> tuple[Array, Array]:
    """Return where the silhouette of a shape is farthest along directions in the plane at distance 1 of a camera.

    Args:
        kind: of the shape.
        size: its lengths, m.
        position: of its middle (3,) m in the camera's frame; the whole shape must be ahead.
        rotation: (3, 3), of its axes into the camera's.
        directions: unit vectors (K, 2).

    Returns:
        Points (K, 3) m of the shape, from its middle in the camera's axes, and how far their images are along the directions (K,).
    """
    if kind == "sphere":
        return _touching_sphere(float(size[0]), position, directions)
    offsets = surface(kind, size) @ rotation.T
    points = position + offsets
    along = (points[:, :2] / points[:, 2:]) @ directions.T  # (m, K)
    farthest = along.argmax(axis=0)
    return offsets[farthest], along[farthest, np.arange(len(directions))]


def _touching_sphere(radius: float, position: Array, directions: Array) -> tuple[Array, Array]:
    """Return the same for a sphere: the plane through the camera with the normal (n, -h) touches it where n.x - h z = -r sqrt(1 + h^2)."""
    a, z = directions @ position[:2], position[2]
    square = z * z - radius * radius
    h = (a * z + radius * np.sqrt(np.maximum(a * a + square, 0.0))) / square
    normal = np.column_stack([directions, -h]) / np.sqrt(1.0 + h * h)[:, None]
    return radius * normal, h
