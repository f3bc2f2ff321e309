# SPDX-License-Identifier: Apache-2.0
"""Imperfect cameras: their settings, the errors of one robot's cameras, drawn with a seed, and the pictures that they take.

The pictures have distortion, motion blur and noise, and the cameras are not where the model has them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from mobee.arrays import Array
from mobee.rendering.camera import Camera as View
from mobee.rendering.camera import Floats
from mobee.rendering.scene import Picture, Pixels, Scene
from mobee.robot.robot import Robot
from mobee.settings import Range, Settings
from mobee.vision.lens import DRAGONFLY, Lens, camera_frames

HEAD = "head"
"""Name of the part whose encoders have offsets."""
_STREAM = 0x65796573  # of random numbers, beside those of motors and encoders of the same seed
NOISE_TABLE = 4_000_003  # numbers, at least those of the largest picture
MARGIN = 2  # px around the part of the plane that the lens shows
UPWARDS = np.array([[1.0], [-1.0], [1.0]])  # a camera's right, down and ahead as the right, up and ahead of a picture


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
        gain: factor on the signal. The brightness of a picture does not depend on it: the light is assumed to be weaker by this factor, so
            at a gain of 2 a pixel collects half of the electrons, and the picture has more noise.
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


class Sensor:
    """Computes the picture of an imperfect camera from exact renderings: adds the distortion of its lens and the noise of its chip.

    A pixel is the mean of `settings.samples` samples. Each sample is rendered at another time of the exposure and at another place within
    the pixel.
    """

    def __init__(self, settings: CameraSettings) -> None:
        self._settings = settings
        width, height, lens = settings.width, settings.height, settings.lens
        offsets = _spread(settings.samples)
        columns, rows = np.meshgrid(np.arange(width), np.arange(height))
        pixels = np.stack([columns, rows], axis=-1).reshape(-1, 2)
        focal, center = np.array([lens.fx, lens.fy]), np.array([lens.cx, lens.cy])
        flat = [lens.undistort((pixels + offset - center) / focal) for offset in offsets]
        self._scale = float(focal.max())
        every = np.concatenate(flat)
        low = np.nanmin(every, axis=0) - MARGIN / self._scale
        size = np.ceil((np.nanmax(every, axis=0) - low) * self._scale).astype(int) + MARGIN
        self._width, self._height = int(size[0]), int(size[1])
        self._corners = [low - offset / self._scale for offset in offsets]  # of each sample's plane: left and top
        self._pixels: list[Pixels] = []
        for corner, places in zip(self._corners, flat, strict=True):
            at = np.floor((places - corner) * self._scale)
            inside = np.isfinite(at).all(axis=1)
            at = np.where(inside[:, None], at, 0.0).astype(np.intp).clip(0, size - 1)
            self._pixels.append(Pixels.some(self._height, self._width, at[:, 1] * self._width + at[:, 0]))

    def moments(self) -> Array:
        """Return the times (samples,) s of the samples, relative to the middle of the exposure."""
        count = self._settings.samples
        return self._settings.exposure * ((np.arange(count) + 0.5) / count - 0.5)

    def view(self, sample: int, position: Array, rotation: Array) -> View:
        """Return the view (the renderer's camera, without distortion) with which one sample of the picture is drawn.

        `sample`: number of the sample (one of the renderings of which the picture is the mean), from 0.
        `position` (3,) m and `rotation` (3, 3): those of the camera in the root frame. The columns of the rotation are the directions
        right, down and ahead of the camera.
        """
        left, top = self._corners[sample]
        return View(rotation.T * UPWARDS, np.array([left, -top]), self._scale, self._width, self._height, position)

    def pixels(self, sample: int) -> Pixels:
        """Return the selection of pixels of a sample's rendering from which the distorted picture is made.

        The rendering (see `view`) has no distortion. For each pixel of the picture, row by row, one pixel of the rendering is selected: the
        one that the lens maps to it. So height * width pixels are selected, some perhaps several times. `sample`: number of the sample
        (one of the renderings of which the picture is the mean), from 0.
        """
        return self._pixels[sample]

    def develop(self, light: Floats, rng: np.random.Generator) -> Picture:
        """Return the picture (height, width, 3) from the light of an exposure, with noise: bytes in the order red, green, blue.

        `light`: (height * width, 3), for each pixel the brightness (0 to 255), summed over the samples (`CameraSettings.samples`) of the
        exposure. `rng`: draws the noise.
        """
        settings = self._settings
        electrons = light * np.float32(settings.full_well / settings.gain / 255.0 / settings.samples)
        deviation = np.sqrt(electrons + np.float32(settings.read_noise**2))  # of shot and read noise, both nearly normal
        first = int(rng.integers(NOISE_TABLE - electrons.size))
        electrons += deviation * _noise_table(NOISE_TABLE)[first : first + electrons.size].reshape(electrons.shape)
        electrons *= np.float32(255.0 * settings.gain / settings.full_well)
        picture: NDArray[np.uint8] = np.clip(electrons + 0.5, 0.0, 255.0).astype(np.uint8)
        return picture.reshape(settings.height, settings.width, 3)


@cache
def _noise_table(size: int) -> Floats:
    """Return standard normal numbers, from which each picture takes a piece: drawing them costs more than the rest of the picture."""
    return np.random.default_rng(0x6E6F697365).standard_normal(size, dtype=np.float32)


class Cameras:
    """The imperfect cameras of one robot in a scene, which take pictures."""

    def __init__(self, scene: Scene, settings: CameraSettings, errors: CameraErrors, seed: int) -> None:
        """Make the cameras of a scene; `seed`: of the noise in the pictures. `errors`: how the cameras differ from the model."""
        self.settings, self.errors = settings, errors
        self._scene = scene
        self._sensor = Sensor(settings)
        self._rng = np.random.default_rng([seed, 0x6E6F697365])

    @property
    def moments(self) -> Array:
        """The times (samples,) s, relative to the middle of the exposure, at which `expose` needs the robot's posture."""
        return self._sensor.moments()

    def expose(self, name: str, postures: Sequence[Array]) -> Picture:
        """Return the picture of a camera (height, width, 3), bytes red, green, blue; `name`: name of the camera.

        `postures`: positions of all motors (n,) rad in the simulation, one array for each of the `moments` (times during the exposure). The
        offsets of the encoders, `errors.encoders` (n,) rad, are added to these positions before the robot is drawn. So the picture shows
        the head at a posture that differs from the simulated one.
        """
        camera, scene = self._scene.cameras[name], self._scene
        light = np.zeros((self.settings.height * self.settings.width, 3), np.float32)
        for sample, q in enumerate(postures):
            scene.pose(q + self.errors.encoders)
            frame = camera_frames(camera, scene.transforms, self.errors.mounts[name])
            scene.light(self._sensor.view(sample, *frame), camera.hidden, self._sensor.pixels(sample), light)
        return self._sensor.develop(light, self._rng)

    def shares(self, name: str, postures: Sequence[Array], objects: int) -> Floats:
        """Return which share of each pixel each object covers, 0 to 1, (height, width, objects), for the first `objects` of the world.

        `name`: name of the camera. `postures`: the positions of all motors (n,) rad at each of the moments (`moments`) of one exposure; the
        shares are means over these moments. `objects`: number of objects.
        """
        camera, scene = self._scene.cameras[name], self._scene
        found = np.zeros((self.settings.height * self.settings.width, objects), np.float32)
        for sample, q in enumerate(postures):
            scene.pose(q + self.errors.encoders)
            frame = camera_frames(camera, scene.transforms, self.errors.mounts[name])
            which = scene.objects_at(self._sensor.view(sample, *frame), camera.hidden, self._sensor.pixels(sample))
            for number in range(objects):
                found[:, number] += which == number
        return found.reshape(self.settings.height, self.settings.width, objects) / np.float32(self.settings.samples)


def _spread(count: int) -> Array:
    """Return places (count, 2) within a pixel, from its middle, evenly spread (a Kronecker sequence)."""
    if count == 1:
        return np.zeros((1, 2))
    steps = np.array([0.7548776662466927, 0.5698402909980532])  # powers of the inverse of the plastic number
    spread = np.mod(0.5 + np.arange(count)[:, None] * steps, 1.0) - 0.5
    found: Array = spread - spread.mean(axis=0)
    return found
