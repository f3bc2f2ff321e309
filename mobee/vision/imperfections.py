# SPDX-License-Identifier: Apache-2.0
"""Imperfections of real cameras: their settings, and the errors of one robot's cameras, drawn with a seed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from mobee.arrays import Array
from mobee.robot.robot import Robot
from mobee.settings import Range, Settings
from mobee.vision.lens import DRAGONFLY, Lens

HEAD = "head"
"""Name of the part whose encoders have offsets."""
_STREAM = 0x65796573  # of random numbers, beside those of motors and encoders of the same seed


@dataclass(frozen=True, kw_only=True)
class CameraSettings(Settings):
    """Settings of imperfect cameras, equal for all cameras; the defaults are those of an iCub's Dragonfly cameras, as far as known.

    The lens is a published one (DRAGONFLY).  Exposure, noise, latency and jitter are assumed: typical values of such CCD cameras on
    FireWire.  The tolerances (`mount_*`, `encoder_offset`, `tag_*`) bound the errors of the kinematic model; `camera_errors` draws the
    errors of one robot within them.

    Args:
        width: columns of a picture.
        height: rows of a picture.
        lens: lens of every camera.
        exposure: s, time during which a picture collects light: motion within it is blurred.
        samples: number of renderings whose mean is the picture, each at another time of the exposure and another place within the pixels.
        gain: factor on the signal; the exposure is adapted such that the brightness is the same, so a gain of 2 collects half of the light.
        full_well: electrons of a white pixel at gain 1; their number has shot noise.
        read_noise: standard deviation of the readout, electrons.
        latency: s from the middle of the exposure to the arrival of the picture, as the driver assumes it for the time stamp.
        latency_error: s, bound of the difference of the true latency from the assumed one.
        jitter: standard deviation of the latency from picture to picture, s.
        mount_position: m, bound of the distance of a camera from its position in the model.
        mount_rotation: degrees, bound of the angle of a camera to its orientation in the model.
        encoder_offset: degrees, bound of the offset of each of the head's encoders.
        tag_position: m, bound of the distance of the palm's tag from its position in the model.
        tag_rotation: degrees, bound of the angle of the tag to its orientation in the model.
    """

    width: Annotated[int, Range(ge=16, le=1280)] = 320
    height: Annotated[int, Range(ge=16, le=1024)] = 240
    lens: Lens = DRAGONFLY
    exposure: Annotated[float, Range(ge=0.0, le=0.1)] = 0.010
    samples: Annotated[int, Range(ge=1, le=16)] = 4
    gain: Annotated[float, Range(gt=0.0, le=16.0)] = 2.0
    full_well: Annotated[float, Range(gt=0.0)] = 15_000.0
    read_noise: Annotated[float, Range(ge=0.0)] = 40.0
    latency: Annotated[float, Range(ge=0.0, le=1.0)] = 0.040
    latency_error: Annotated[float, Range(ge=0.0, le=0.5)] = 0.015
    jitter: Annotated[float, Range(ge=0.0, le=0.1)] = 0.001
    mount_position: Annotated[float, Range(ge=0.0, le=0.1)] = 0.02
    mount_rotation: Annotated[float, Range(ge=0.0, le=20.0)] = 2.0
    encoder_offset: Annotated[float, Range(ge=0.0, le=10.0)] = 1.0
    tag_position: Annotated[float, Range(ge=0.0, le=0.05)] = 0.005
    tag_rotation: Annotated[float, Range(ge=0.0, le=20.0)] = 2.0

    @property
    def deviations(self) -> Mapping[str, float]:
        """The standard deviation of each kind of error, along each axis; a calibration uses them in its prior.

        The keys are "position" [m] and "rotation" [rad] of a camera on its link, "encoder" [rad], "latency" [s], "tag_position" [m] and
        "tag_rotation" [rad].
        """
        ball = 1.0 / np.sqrt(5.0)  # of a coordinate of a point that is uniform in a ball, over the ball's radius
        return {
            "position": self.mount_position * ball,
            "rotation": float(np.deg2rad(self.mount_rotation)) * ball,
            "encoder": float(np.deg2rad(self.encoder_offset)) / np.sqrt(3.0),
            "latency": self.latency_error / np.sqrt(3.0),
            "tag_position": self.tag_position * ball,
            "tag_rotation": float(np.deg2rad(self.tag_rotation)) * ball,
        }


@dataclass(frozen=True, slots=True, eq=False)
class CameraErrors:
    """By how much one robot's cameras differ from its kinematic model.

    Attributes:
        mounts: dict from the name of a camera to (6,): displacement [m], then rotation vector [rad], both in the camera's own axes.  The
            true camera is that of the model, displaced and then rotated.
        encoders: (n,) rad, true position minus encoder value; 0 for all motors except those of the head.
        latency: s, true minus assumed latency: the true exposure was earlier than the time stamp of the picture by this time.
        tag: (6,), displacement [m] and rotation vector [rad] of the tag (an AprilTag on the palm, for calibration), in the tag's axes.
    """

    mounts: Mapping[str, Array]
    encoders: Array
    latency: float
    tag: Array

    @classmethod
    def none(cls, robot: Robot, cameras: Sequence[str]) -> CameraErrors:
        """Return errors that are all zero; `cameras`: names of the cameras."""
        return cls({name: np.zeros(6) for name in cameras}, np.zeros(len(robot.motors)), 0.0, np.zeros(6))


def camera_errors(settings: CameraSettings, robot: Robot, cameras: Sequence[str], seed: int) -> CameraErrors:
    """Draw the errors of one robot's cameras; `cameras`: their names; `seed`: of the draws.

    Displacements and rotations are uniform in balls, encoder offsets and latency are uniform in intervals, with the bounds of `settings`.
    """
    rng = np.random.default_rng([seed, _STREAM])

    def drawn(position: float, rotation_deg: float) -> Array:
        return np.concatenate([_in_ball(rng, position), _in_ball(rng, float(np.deg2rad(rotation_deg)))])

    mounts = {name: drawn(settings.mount_position, settings.mount_rotation) for name in cameras}
    encoders = np.zeros(len(robot.motors))
    if HEAD in robot.parts:
        where = robot.parts[HEAD].slice
        encoders[where] = np.deg2rad(rng.uniform(-settings.encoder_offset, settings.encoder_offset, len(robot.parts[HEAD])))
    latency = float(rng.uniform(-settings.latency_error, settings.latency_error))
    return CameraErrors(mounts, encoders, latency, drawn(settings.tag_position, settings.tag_rotation))


def _in_ball(rng: np.random.Generator, radius: float) -> Array:
    """Return a point (3,) that is uniform in a ball about 0."""
    direction = rng.standard_normal(3)
    found: Array = radius * rng.uniform() ** (1.0 / 3.0) * direction / np.linalg.norm(direction)
    return found
