# SPDX-License-Identifier: Apache-2.0
"""Frames of cameras that are displaced and rotated on their links."""

from __future__ import annotations

import numpy as np

from mobee.arrays import Array
from mobee.robot.visual import Camera

SMALL = 1e-4  # rad: below it series are more exact than the formulas


def rotation_of(vector: Array) -> Array:
    """Return the rotation (3, 3) that belongs to a rotation vector (3,) rad (Rodrigues' formula)."""
    angle = float(np.linalg.norm(vector))
    skew = skew_of(vector)
    first = np.sinc(angle / np.pi)
    second = 0.5 * np.sinc(0.5 * angle / np.pi) ** 2
    found: Array = np.eye(3) + first * skew + second * skew @ skew
    return found


def right_slope(vector: Array) -> Array:
    """Return the right Jacobian J (3, 3) of rotations at a rotation vector v = `vector` (3,) rad.

    For small d, rotation_of(v + d) = rotation_of(v) rotation_of(J d).
    """
    angle = float(np.linalg.norm(vector))
    skew = skew_of(vector)
    second = 0.5 * np.sinc(0.5 * angle / np.pi) ** 2
    third = 1.0 / 6.0 if angle < SMALL else (angle - np.sin(angle)) / angle**3
    found: Array = np.eye(3) - second * skew + third * skew @ skew
    return found


def skew_of(vector: Array) -> Array:
    """Return the skew-symmetric matrix (..., 3, 3) of vectors v (..., 3): its product with w is the cross product v x w."""
    v = np.asarray(vector)
    found = np.zeros((*v.shape, 3))
    found[..., 0, 1], found[..., 0, 2], found[..., 1, 2] = -v[..., 2], v[..., 1], -v[..., 0]
    found[..., 1, 0], found[..., 2, 0], found[..., 2, 1] = v[..., 2], -v[..., 1], v[..., 0]
    return found


def mounted(position: Array, rotation: Array, mount: Array) -> tuple[Array, Array]:
    """Return position (..., 3) m and rotation (..., 3, 3) of a frame after it is displaced and then rotated by `mount` (6,).

    `mount`: displacement [m] and rotation vector [rad], both in the axes of the given frame.
    """
    return position + rotation @ mount[:3], rotation @ rotation_of(mount[3:])


def camera_frames(camera: Camera, transforms: Array, mount: Array) -> tuple[Array, Array]:
    """Return the optical centre (..., 3) m and rotation (..., 3, 3) of a camera in the root frame.

    The columns of the rotation are the directions right, down and ahead. `transforms`: (..., L, 4, 4) of all links, from `link_transforms`.
    `mount`: (6,), displacement [m] and rotation vector [rad] by which the true camera differs from the camera of the model, in the axes of
    the latter.
    """
    position, rotation = mounted(camera.position, camera.rotation, mount)
    link = transforms[..., camera.link, :3, :]
    return (link[..., :3] @ position) + link[..., 3], link[..., :3] @ rotation


def into(position: Array, rotation: Array, points: Array) -> Array:
    """Transform points (..., 3) m from the root frame into a frame at `position` (..., 3) m with `rotation` (..., 3, 3)."""
    found: Array = np.einsum("...ji,...j->...i", rotation, points - position)
    return found
