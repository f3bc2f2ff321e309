# SPDX-License-Identifier: Apache-2.0
"""The geometry of a camera: from directions in its frame to pixels and back, and its frame when it is displaced on its link.

The distortion is that of Brown and Conrady.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mobee.arrays import Array
from mobee.errors import InvalidValue
from mobee.robot.robot import Camera

ROUNDS, ENOUGH = 30, 1e-12  # of Newton's method that inverts the distortion; its last step, times the focal length
SMALL = 1e-4  # rad: below it series are more exact than the formulas


@dataclass(frozen=True, slots=True)
class Lens:
    """The intrinsic parameters of a camera; the centres of pixels are at integers, and the origin is top left.

    `fx`, `fy`: focal lengths, px.  `cx`, `cy`: principal point, px.  `k1`, `k2`: radial, `p1`, `p2`: tangential distortion of Brown and
    Conrady, in OpenCV's order and sign.  A camera's frame has x to the right, y down and z along the direction of view.
    """

    fx: float
    fy: float
    cx: float
    cy: float
    k1: float = 0.0
    k2: float = 0.0
    p1: float = 0.0
    p2: float = 0.0

    def __post_init__(self) -> None:
        if not (np.isfinite(self.numbers).all() and min(self.fx, self.fy) > 0.0):
            raise InvalidValue(f"lens {self.numbers}: must be eight finite numbers fx fy cx cy k1 k2 p1 p2, the first two above 0")

    @classmethod
    def ideal(cls, view_deg: float, width: int, height: int) -> Lens:
        """Return a lens without distortion for pictures of width x height pixels; `view_deg`: vertical field of view [degrees]."""
        focal = 0.5 * height / float(np.tan(0.5 * np.deg2rad(view_deg)))
        return cls(focal, focal, 0.5 * width - 0.5, 0.5 * height - 0.5)

    @classmethod
    def of_matrix(cls, matrix: Array, distortion: Array) -> Lens:
        """Return the lens with a camera matrix (3, 3) px and the coefficients k1 k2 p1 p2 (4,), or (0,) without distortion.

        Raises InvalidValue for other shapes or for values that are not valid.
        """
        if np.shape(matrix) != (3, 3) or len(distortion) not in (0, 4):
            raise InvalidValue(f"a lens of {np.size(matrix)} and {len(distortion)} numbers: expected 9, and 4 or none")
        return cls(*(float(matrix[place]) for place in ((0, 0), (1, 1), (0, 2), (1, 2))), *(float(one) for one in distortion))

    @property
    def numbers(self) -> tuple[float, ...]:
        """The eight parameters fx, fy, cx, cy, k1, k2, p1, p2."""
        return self.fx, self.fy, self.cx, self.cy, self.k1, self.k2, self.p1, self.p2

    @property
    def matrix(self) -> Array:
        """The camera matrix (3, 3), px; it does not contain the distortion."""
        return np.array([[self.fx, 0.0, self.cx], [0.0, self.fy, self.cy], [0.0, 0.0, 1.0]])

    @property
    def distortion(self) -> tuple[float, ...]:
        """The coefficients k1 k2 p1 p2; empty for a lens without distortion."""
        given = self.k1, self.k2, self.p1, self.p2
        return given if any(given) else ()

    def distort(self, flat: Array) -> Array:
        """Return the distorted coordinates (..., 2) of points `flat` (..., 2), given as (x / z, y / z) in the camera's frame."""
        x, y = flat[..., 0], flat[..., 1]
        square = x * x + y * y
        radial = 1.0 + square * (self.k1 + square * self.k2)
        return np.stack(
            [
                x * radial + 2.0 * self.p1 * x * y + self.p2 * (square + 2.0 * x * x),
                y * radial + self.p1 * (square + 2.0 * y * y) + 2.0 * self.p2 * x * y,
            ],
            axis=-1,
        )

    def distortion_slope(self, flat: Array) -> Array:
        """Return the derivative (..., 2, 2) of `distort` at points `flat` (..., 2), given as (x / z, y / z) in the camera's frame."""
        x, y = flat[..., 0], flat[..., 1]
        square = x * x + y * y
        radial = 1.0 + square * (self.k1 + square * self.k2)
        slope = 2.0 * (self.k1 + 2.0 * square * self.k2)  # of `radial` by x, over x
        mixed = slope * x * y + 2.0 * (self.p1 * x + self.p2 * y)
        out = np.empty((*x.shape, 2, 2))
        out[..., 0, 0] = radial + slope * x * x + 2.0 * self.p1 * y + 6.0 * self.p2 * x
        out[..., 1, 1] = radial + slope * y * y + 6.0 * self.p1 * y + 2.0 * self.p2 * x
        out[..., 0, 1] = out[..., 1, 0] = mixed
        return out

    def undistort(self, flat: Array) -> Array:
        """Return the points (..., 2), (x / z, y / z), that `distort` maps to the coordinates `flat` (..., 2).

        They are found by Newton's method; NaN where there is no such point.
        """
        given = np.asarray(flat, dtype=np.float64)
        found, step = given.copy(), np.full(given.shape, np.inf)
        with np.errstate(all="ignore"):
            for _ in range(ROUNDS):
                slope, error = self.distortion_slope(found), self.distort(found) - given
                det = slope[..., 0, 0] * slope[..., 1, 1] - slope[..., 0, 1] ** 2
                step[..., 0] = (slope[..., 1, 1] * error[..., 0] - slope[..., 0, 1] * error[..., 1]) / det
                step[..., 1] = (slope[..., 0, 0] * error[..., 1] - slope[..., 0, 1] * error[..., 0]) / det
                found -= step
                if not np.nanmax(np.abs(step), initial=0.0) > ENOUGH:
                    break
            wrong = ~((np.abs(step).max(axis=-1) <= 1e-6) & self._shows(found))
        found[wrong] = np.nan
        return found

    def project(self, points: Array) -> Array:
        """Return the pixels (..., 2), column and row, of points (..., 3) m in the camera's frame.

        NaN for points behind the camera, and for those so far from its axis that the distortion would fold them back into the picture.
        """
        flat = points[..., :2] / np.where(points[..., 2:] > 0.0, points[..., 2:], np.nan)
        found: Array = self.distort(flat) * (self.fx, self.fy) + (self.cx, self.cy)
        if self.distortion:
            found[~self._shows(flat)] = np.nan
        return found

    def _shows(self, flat: Array) -> NDArray[np.bool_]:
        """Return whether points `flat` (..., 2), (x / z, y / z), are nearer to the axis than where the distortion first folds back."""
        slope = self.distortion_slope(flat)
        rising = (slope[..., 0, 0] > 0.0) & (slope[..., 0, 0] * slope[..., 1, 1] > slope[..., 0, 1] ** 2)
        root = 9.0 * self.k1**2 - 20.0 * self.k2  # the radius r (1 + k1 r^2 + k2 r^4) has its first maximum where 2 / r^2 is `fold`
        fold = -3.0 * self.k1 + np.sqrt(root) if root >= 0.0 else 0.0
        shown: NDArray[np.bool_] = rising & ((flat**2).sum(axis=-1) * max(fold, 0.0) < 2.0)
        return shown

    def projection_slope(self, points: Array) -> Array:
        """Return the derivative (..., 2, 3) [px/m] of `project` at points (..., 3) m in the camera's frame, z > 0."""
        ahead = points[..., 2]
        flat = points[..., :2] / ahead[..., None]
        by_flat = self.distortion_slope(flat) * np.array([[self.fx], [self.fy]]) / ahead[..., None, None]
        return np.concatenate([by_flat, -(by_flat @ flat[..., None])], axis=-1)

    def unproject(self, pixels: Array) -> Array:
        """Return the unit vectors (..., 3) in the camera's frame along the rays of pixels (..., 2); NaN where a pixel has no ray."""
        flat = self.undistort((pixels - np.array([self.cx, self.cy])) / np.array([self.fx, self.fy]))
        rays = np.concatenate([flat, np.ones((*flat.shape[:-1], 1))], axis=-1)
        found: Array = rays / np.linalg.norm(rays, axis=-1, keepdims=True)
        return found


DRAGONFLY = Lens(215.6, 215.1, 163.4, 111.2, -0.3675, 0.1323, -0.0004, -0.0002)
"""The lens of an iCub's eye at 320x240: the published example of the left camera in the documentation of the iCub's stereo calibration."""


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
    """Transform points (..., 3) m from the root frame into another frame; return their coordinates (..., 3) m in it.

    `position` (..., 3) m: origin of the frame, in the root frame. `rotation` (..., 3, 3): its columns are the frame's axes in the root
    frame.
    """
    found: Array = np.einsum("...ji,...j->...i", rotation, points - position)
    return found
