# SPDX-License-Identifier: Apache-2.0
"""Pictures of imperfect cameras: distortion, motion blur, noise, and cameras whose positions differ from the model."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np
from numpy.typing import NDArray

from mobee.arrays import Array
from mobee.rendering.camera import Camera as View
from mobee.rendering.camera import Floats
from mobee.rendering.scene import Picture, Pixels, Scene
from mobee.vision.imperfections import CameraErrors, CameraSettings
from mobee.vision.lens import camera_frames

NOISE_TABLE = 4_000_003  # numbers, at least those of the largest picture
MARGIN = 2  # px around the part of the plane that the lens shows
UPWARDS = np.array([[1.0], [-1.0], [1.0]])  # a camera's right, down and ahead as the right, up and ahead of a picture


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
        """Return for each pixel of the picture, row by row, the pixel of the sample's `view` that it shows: height * width selected pixels.

        The view has no distortion; the selection of its pixels distorts the picture as the lens does. `sample`: number of the sample (one
        of the renderings of which the picture is the mean), from 0.
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

        `postures`: positions of all motors (n,) rad in the simulation, at each of the `moments`. The offsets of the encoders,
        `errors.encoders` (n,) rad, are added to these positions before the robot is drawn. So the picture shows the head at a posture that
        differs from the simulated one.
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

        `name` and `postures` are those of `expose`: the camera, and the positions of all motors (n,) rad at each of the `moments`.
        `objects`: number of objects.
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
