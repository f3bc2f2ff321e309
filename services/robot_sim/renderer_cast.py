"""Ray-casts boxes and spheres of the world.

A table fills the picture, and a rasteriser pays by the pixel; a ball of triangles is no circle.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mobee.arrays import Array

Picture = NDArray[np.uint8]
Floats = NDArray[np.float32]
SHADES = (0.72, 0.80, 1.0)  # of faces that look along x, y and z
AMBIENT = 0.6  # brightness of what is turned away from the light


@dataclass(frozen=True, slots=True, eq=False)
class CastBox:
    """A box with its pose in the root frame."""

    size: Array  # (3,) m
    position: Array  # (3,) m
    rotation: Array  # (3, 3)
    color: Array  # (3,) 0..255


@dataclass(frozen=True, slots=True, eq=False)
class CastSphere:
    """A sphere in the root frame."""

    radius: float  # m
    position: Array  # (3,) m
    color: Array  # (3,) 0..255


def pixel_rays(width: int, height: int, intrinsics: Array) -> Floats:
    """Direction through every pixel centre in the camera's frame with depth 1, shape (3, height, width)."""
    columns, rows = np.meshgrid(np.arange(width), np.arange(height))
    x = (columns - intrinsics[0, 2]) / intrinsics[0, 0]
    y = (rows - intrinsics[1, 2]) / intrinsics[1, 1]
    return np.stack([x, y, np.ones_like(x)]).astype(np.float32)


def paint_box(box: CastBox, picture: Picture, depth: Floats, rays: Floats, origin: Array, rotation: Array) -> None:
    """Paint what is nearer than `depth` (m along the axis of view), and lower `depth` there; both in place.

    `origin`, `rotation`: the camera's frame in the root frame, columns right, down, forward.
    """
    eye = (box.rotation.T @ (origin - box.position)).astype(np.float32)
    turn = (box.rotation.T @ rotation).astype(np.float32)
    half = (box.size / 2.0).astype(np.float32)
    directions = np.tensordot(turn, rays, axes=1)
    for axis in range(3):
        if abs(eye[axis]) > half[axis]:  # only a face that looks at the eye can be seen
            _paint_face(axis, box, picture, depth, directions, eye, half)


def _paint_face(axis: int, box: CastBox, picture: Picture, depth: Floats, directions: Floats, eye: Floats, half: Floats) -> None:
    plane = np.copysign(half[axis], eye[axis])
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        far = (plane - eye[axis]) / directions[axis]
        hit = (far > 0.0) & (far < depth)
        for other in {0, 1, 2} - {axis}:
            hit &= np.abs(eye[other] + far * directions[other]) <= half[other]
    picture[hit] = box.color * SHADES[axis]
    depth[hit] = far[hit]


def paint_sphere(ball: CastSphere, picture: Picture, depth: Floats, rays: Floats, origin: Array, rotation: Array, light: Array) -> None:
    """As paint_box; `light`: (3,) unit vector towards the light, root frame."""
    center = (rotation.T @ (ball.position - origin)).astype(np.float32)
    if center[2] <= ball.radius:  # behind the eye, or around it
        return
    along = np.tensordot(center, rays, axes=1)
    square = np.sum(rays * rays, axis=0)
    under = along * along - square * np.float32(center @ center - ball.radius**2)
    rows, columns = np.nonzero(under > 0.0)
    far = (along[rows, columns] - np.sqrt(under[rows, columns])) / square[rows, columns]
    nearer = (far > 0.0) & (far < depth[rows, columns])
    rows, columns, far = rows[nearer], columns[nearer], far[nearer]
    normals = (rays[:, rows, columns] * far - center[:, None]) / ball.radius
    shade = AMBIENT + (1.0 - AMBIENT) * np.clip((rotation.T @ light) @ normals, 0.0, 1.0)
    picture[rows, columns] = shade[:, None] * ball.color
    depth[rows, columns] = far
