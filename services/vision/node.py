# SPDX-License-Identifier: Apache-2.0
"""Runs the locator: reads pairs of pictures, publishes the ball's position."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from bus_schema.messages import Camera, Geometry, Image, WorldObject
from mobee.errors import InvalidValue
from mobee.robot.robot import Robot
from mobee.vision.ball import Fix, Frame, Sighting, find_balls, locate
from mobee.vision.calibrated_ball import locate_calibrated
from mobee.vision.calibration.calibration import load_calibration
from mobee.vision.encoders import Moment
from mobee.vision.lens import Lens
from services.common.cameras import STEREO, frame_at_capture
from services.common.rate import Percentiles
from services.common.service import Service
from services.vision.config import Config

BALL = "ball"


class VisionNode:
    """Locates the ball when both pictures and both cameras of a tick are there; reads no other stream of the robot."""

    def __init__(self, service: Service, config: Config, robot: Robot) -> None:
        self._service, self._config, self._robot = service, config, robot
        self._mounts = dict(list(config.cameras_on(robot).items())[:STEREO])
        self._calibration = load_calibration(config.calibration) if config.calibration else None
        self._images: dict[str, Image] = {}
        self._cameras: dict[str, Camera] = {}
        self._place = service.bus.publisher(WorldObject, BALL)
        self._time = Percentiles()
        self._mark()
        service.mark, service.describe = self._mark, self._describe
        service.on_run(self._forget)
        service.on_clock(lambda clock: None)  # for the id of the run
        for name in self._mounts:
            service.on_newest(Camera, self._take_camera, name)
            service.on_newest(Image, self._take_image, name)

    def _take_camera(self, camera: Camera) -> None:
        self._cameras[camera.camera] = camera
        self._try_locate()

    def _take_image(self, image: Image) -> None:
        if len(image.data) != image.width * image.height * 3:
            self._service.bus.reject("length", f"picture of {image.camera}: {len(image.data)} bytes for {image.width} x {image.height}")
            return
        self._images[image.camera] = image
        self._try_locate()

    def _try_locate(self) -> None:
        """Locate the ball, once all four messages of a tick are there."""
        parts: list[Image | Camera] = [*self._images.values(), *self._cameras.values()]
        if len(parts) < 2 * len(self._mounts) or len({part.k_capture for part in parts}) > 1:
            return
        begin = time.perf_counter()
        self._pairs += 1
        try:
            self._locate()
        except (InvalidValue, np.linalg.LinAlgError) as error:
            self._service.bus.reject("camera", f"camera of tick {parts[0].k_capture}: {error}")
        self._forget()
        self._time.add(1e3 * (time.perf_counter() - begin))

    def _locate(self) -> None:
        first, second = self._mounts
        left, right = self._sightings(first), self._sightings(second)
        self._seen += bool(left) + bool(right)
        fix = self._fix(left, right)
        if fix is None:
            self._mismatched += bool(left and right)
            return
        self._located += 1
        camera = self._cameras[first]
        self._place.put(
            name=BALL,
            geometry=Geometry("sphere", [self._config.radius]),
            position=fix.position.tolist(),
            quaternion=[1.0, 0.0, 0.0, 0.0],
            covariance=fix.covariance.ravel().tolist(),
            role="target",
            t_capture=camera.t,
            valid_until=camera.t + round(1e9 * self._config.valid_for),
        )

    def _fix(self, left: Sequence[Sighting], right: Sequence[Sighting]) -> Fix | None:
        """Return the ball's place; with a calibration its covariance holds the noise of pixels, encoders and calibration."""
        first, second = self._mounts
        if self._calibration is None:
            return locate(left, right, (self._frame(first), self._frame(second)), self._config.radius)
        camera = self._cameras[first]
        lens = Lens.of_matrix(np.array(camera.intrinsics).reshape(3, 3), np.array(camera.distortion))
        rig = replace(self._calibration.rig(self._robot, self._mounts), lens=lens)
        variance = np.full(len(camera.q), self._config.encoder_noise**2 / camera.readings)
        moment = Moment(np.array(camera.q), np.array(camera.dq), variance)
        return locate_calibrated(rig, self._calibration, moment, (left, right), self._config.radius)

    def _sightings(self, name: str) -> list[Sighting]:
        image = self._images[name]
        picture = np.frombuffer(image.data, dtype=np.uint8).reshape(image.height, image.width, 3)
        return find_balls(picture, np.array(self._cameras[name].intrinsics).reshape(3, 3), self._cameras[name].distortion)

    def _frame(self, name: str) -> Frame:
        return frame_at_capture(self._robot, self._mounts[name], np.array(self._cameras[name].q))

    def _forget(self) -> None:
        self._images.clear()
        self._cameras.clear()

    def _mark(self) -> None:
        self._pairs = self._seen = self._located = self._mismatched = 0
        self._time.clear()

    def _describe(self) -> tuple[str, dict[str, float]]:
        numbers = {
            "pairs": self._pairs,
            "seen": self._seen,
            "located": self._located,
            "mismatched": self._mismatched,
            "look_ms_p50": self._time.at(50),
            "look_ms_p99": self._time.at(99),
        }
        return f"located the ball in {self._located} of {self._pairs} pairs", numbers
