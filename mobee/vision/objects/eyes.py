# SPDX-License-Identifier: Apache-2.0
"""The positions of the cameras at the stamp of a picture, and their uncertainty, for all cameras together."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mobee.arrays import Array
from mobee.model.kinematics import link_transforms, point_jacobian
from mobee.vision.encoders import Moment
from mobee.vision.lens import Lens
from mobee.vision.mount import camera_frames, right_slope, rotation_of
from mobee.vision.rig import Rig

NEGLIGIBLE = 1e-12  # share of the largest variance below which a direction is left out


@dataclass(frozen=True, slots=True, eq=False)
class Eye:
    """A camera in the root frame.

    `position`: (3,) m, of the optical centre. `rotation`: (3, 3) with the columns right, down, ahead. `lens`: lens of the camera.
    """

    position: Array
    rotation: Array
    lens: Lens


@dataclass(frozen=True, slots=True, eq=False)
class Eyes:
    """The E cameras of a robot at one stamp (time of a picture), with the uncertainty of their poses.

    `names`: the cameras; `eyes` and the rows below have the same order. An uncertainty is a factor F (6 E, r): F F' is the covariance of
    the pose errors of all cameras together. F has six rows for each camera: the displacement of its optical centre along x, y and z of the
    root frame [m], then its rotation about the directions x, y and z of the root frame, through the optical centre [rad]. There are two
    such factors, each with its own r. `noise`: for the errors that are new in each picture (of encoders and stamp). `bias`: for the errors
    that stay the same while the gaze does not change (of the calibration).
    """

    names: tuple[str, ...]
    eyes: tuple[Eye, ...]
    noise: Array
    bias: Array


def eyes_at(rig: Rig, x: Array, moment: Moment, uncertainty: Array | None = None, jitter: float = 0.0) -> Eyes:
    """Return the cameras of a rig, with their uncertainty, at the stamp (time) of a picture.

    Args:
        rig: the robot and its cameras.
        x: the calibration's parameters (P,).
        moment: encoder values at the stamp, with velocities and variances.
        uncertainty: covariance (P, P) of the parameters; None: they are exact.
        jitter: standard deviation of the error of the stamp, s.
    """
    transforms = link_transforms(rig.robot, rig.posture(x, moment.q, moment.dq))
    eyes, motions, slopes = [], [], []
    for name, camera in rig.cameras.items():
        mount = x[rig.where(name)]
        position, rotation = camera_frames(camera, transforms, mount)
        by_posture = point_jacobian(rig.robot, transforms, camera.link, position)
        by_parameters = np.zeros((6, len(x)))
        first = rig.where(name).start
        by_parameters[:3, first : first + 3] = rotation @ rotation_of(mount[3:]).T
        by_parameters[3:, first + 3 : first + 6] = rotation @ right_slope(mount[3:])
        by_parameters[:, rig.where("encoder")] = by_posture[:, list(rig.head)]
        by_parameters[:, rig.where("latency")] = -(by_posture @ moment.dq)[:, None]
        eyes.append(Eye(position, rotation, rig.lens))
        motions.append(by_posture)
        slopes.append(by_parameters)
    motion, slope = np.concatenate(motions), np.concatenate(slopes)
    late = jitter * (motion @ moment.dq)
    noise = _factor((motion * moment.variance) @ motion.T + np.outer(late, late))
    bias = np.zeros((len(slope), 0)) if uncertainty is None else _factor(slope @ uncertainty @ slope.T)
    return Eyes(tuple(rig.cameras), tuple(eyes), noise, bias)


def _factor(covariance: Array) -> Array:
    """Return F (n, r) with F F' = covariance."""
    scale = np.sqrt(np.maximum(np.diag(covariance), 1e-30))  # displacements and turns have different units
    values, vectors = np.linalg.eigh(covariance / np.outer(scale, scale))
    kept = values > NEGLIGIBLE * max(values.max(), 1e-30)
    factor: Array = scale[:, None] * vectors[:, kept] * np.sqrt(values[kept])
    return factor
