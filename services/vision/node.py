# SPDX-License-Identifier: Apache-2.0
"""Runs the locator: finds the coloured targets of the world's file in pairs of pictures, and publishes their poses in the root frame."""

from __future__ import annotations

import time
from collections import Counter
from dataclasses import replace

import numpy as np

from bus_schema.messages import Camera, Clock, Geometry, Image, WorldObject
from mobee.arrays import Array
from mobee.errors import InvalidValue
from mobee.model.kinematics import quaternion_from_matrix
from mobee.rendering.scene import Picture
from mobee.robot.robot import Robot
from mobee.vision.calibration.calibration import load_calibration
from mobee.vision.encoders import Moment
from mobee.vision.imperfections import CameraSettings
from mobee.vision.lens import Lens
from mobee.vision.objects.detectors import detector_of
from mobee.vision.objects.placing import Eyes, eyes_at, locate_all
from mobee.vision.objects.track import Track, Tracker, TrackSettings
from mobee.vision.objects.watch import PictureWatch
from mobee.vision.rig import Rig
from services.common.cameras import STEREO
from services.common.rate import Percentiles
from services.common.service import Service
from services.vision.config import Config

DIGITS = 3  # of published sizes, m: the model need not make a new shape in each look


class VisionNode:
    """Locates objects in the pictures of two cameras, when both pictures and both `Camera` messages of a tick have arrived.

    Apart from these messages it reads only the clock.
    """

    def __init__(self, service: Service, config: Config, robot: Robot) -> None:
        self._service, self._config = service, config
        mounts = dict(list(config.cameras_on(robot).items())[:STEREO])
        calibration = load_calibration(config.calibration) if config.calibration else None
        self._rig = Rig(robot, mounts, CameraSettings().lens) if calibration is None else calibration.rig(robot, mounts)
        self._x: Array = np.zeros(len(self._rig.names)) if calibration is None else calibration.x
        self._uncertainty = None if calibration is None else calibration.covariance
        self._things = config.things()
        self._solids = [item for item in config.load_world().objects.values() if item.role == "obstacle"]
        self._detect = detector_of(config.detector, self._things)
        self._tracker = Tracker(self._things, TrackSettings(most=config.most))
        self._publishers = {
            name: service.bus.publisher(WorldObject, name)
            for thing in self._things
            for name in (thing.name, *(f"{thing.name}_{number}" for number in range(2, config.most + 1)))
        }
        self._images: dict[str, Image] = {}
        self._cameras: dict[str, Camera] = {}
        self._time, self._latency = Percentiles(), Percentiles()
        self._mark()
        self._new_run()
        service.mark, service.describe = self._mark, self._describe
        service.on_run(self._new_run)
        service.on_clock(self._note_clock)
        for name in mounts:
            service.on_newest(Camera, self._take_camera, name)
            service.on_newest(Image, self._take_image, name)

    def _new_run(self) -> None:
        self._forget_pair()
        self._tracker.forget()
        self._watches = {name: PictureWatch(self._config.max_age) for name in self._rig.cameras}
        self._gaze: Array | None = None  # rotation (3, 3) of the first camera at the last look
        self._used = -np.inf  # s, bus clock, when the last usable pair came
        self._trouble: dict[str, str] = {}  # of each camera, at its newest picture
        self._stale: set[str] = set()

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
        """Locate all things, as soon as the messages Image and Camera of every camera have arrived, all of the same tick."""
        parts: list[Image | Camera] = [*self._images.values(), *self._cameras.values()]
        if len(parts) < 2 * len(self._rig.cameras) or len({part.k_capture for part in parts}) > 1:
            return
        begin = time.perf_counter()
        self._pairs += 1
        try:
            self._locate()
        except (InvalidValue, np.linalg.LinAlgError) as error:
            self._service.bus.reject("camera", f"camera of tick {parts[0].k_capture}: {error}")
        self._forget_pair()
        self._time.add(1e3 * (time.perf_counter() - begin))

    def _locate(self) -> None:
        pictures = {name: self._picture(name) for name in self._rig.cameras}
        eyes = self._eyes()
        if not self._are_usable(pictures):
            return
        stamp = next(iter(self._cameras.values())).t
        found = locate_all(self._things, {name: self._detect(one) for name, one in pictures.items()}, eyes, self._solids)
        self._located += len(found)
        self._tracker.update(1e-9 * stamp, found, self._turned(eyes))
        self._used = self._now
        for track in self._tracker.tracks:
            self._publish(track, stamp)

    def _picture(self, name: str) -> Picture:
        image = self._images[name]
        return np.frombuffer(image.data, dtype=np.uint8).reshape(image.height, image.width, 3)

    def _eyes(self) -> Eyes:
        """Return the poses and the lens of the two cameras at the time stamp of the newest message Camera.

        Raises InvalidValue if this message does not have one position and velocity for each motor of the robot.
        """
        camera = self._cameras[next(iter(self._rig.cameras))]
        motors = len(self._rig.robot.motors)
        if len(camera.q) != motors or len(camera.dq) != motors:
            raise InvalidValue(f"posture: {len(camera.q)} positions and {len(camera.dq)} velocities, expected {motors}")
        lens = Lens.of_matrix(np.array(camera.intrinsics).reshape(3, 3), np.array(camera.distortion))
        variance = np.full(motors, self._config.encoder_noise**2 / camera.readings)
        moment = Moment(np.array(camera.q), np.array(camera.dq), variance)
        jitter = CameraSettings().jitter if camera.exposure else 0.0
        return eyes_at(replace(self._rig, lens=lens), self._x, moment, self._uncertainty, jitter)

    def _are_usable(self, pictures: dict[str, Picture]) -> bool:
        """Return whether both pictures show what is there now; counts and reports what is wrong."""
        for name, picture in pictures.items():
            camera = self._cameras[name]
            found = self._watches[name].trouble(picture, 1e-9 * camera.t, self._now, np.array(camera.q), camera.exposure > 0.0)
            if found is not None:
                self._failures[found] += 1
            if found is not None and self._trouble.get(name) != found:
                self._service.bus.event("warning", "camera", f"pictures of {name} are not used: {found}")
            self._trouble[name] = found or ""
        return not any(self._trouble.values())

    def _turned(self, eyes: Eyes) -> float:
        """Return the angle [rad] by which the gaze has turned since the last look (pair of pictures)."""
        gaze, before = eyes.eyes[0].rotation, self._gaze
        self._gaze = gaze
        return 0.0 if before is None else float(np.arccos(np.clip(0.5 * (np.trace(before.T @ gaze) - 1.0), -1.0, 1.0)))

    @property
    def _now(self) -> float:
        return 1e-9 * self._service.bus.t

    def _publish(self, track: Track, stamp: int) -> None:
        """Publish an object, or withdraw it when it was not seen for too long."""
        if track.t - track.seen > self._config.valid_for:
            self._withdraw(track, f"was not seen for {self._config.valid_for:g} s")
            return
        self._stale.discard(track.name)
        until = round(1e9 * (track.seen + self._config.valid_for))
        self._put(track, until)
        if track.seen == track.t:
            self._latency.add(1e-6 * (self._service.bus.now() - stamp))

    def _withdraw(self, track: Track, why: str) -> None:
        if track.name not in self._stale:
            self._stale.add(track.name)
            self._put(track, 0)
            self._service.bus.event("warning", "stale", f"{track.name} {why}: it is not in the model's world until it is seen again")

    def _put(self, track: Track, valid_until: int) -> None:
        self._publishers[track.name].put(
            name=track.name,
            geometry=Geometry(track.thing.kind, np.round(track.size, DIGITS).tolist()),
            position=track.position.tolist(),
            quaternion=quaternion_from_matrix(track.rotation).tolist(),
            covariance=track.covariance.ravel().tolist(),
            role="target",
            t_capture=round(1e9 * track.seen),
            valid_until=valid_until,
        )

    def _note_clock(self, clock: Clock) -> None:
        """Withdraw all objects if no usable pictures come any more."""
        if 1e-9 * clock.t - self._used > self._config.blind_after:
            for track in self._tracker.tracks:
                trouble = [f"{name} is {found}" for name, found in self._trouble.items() if found]
                self._withdraw(track, f"is not seen any more: {' and '.join(trouble) or 'no pictures come'}")

    def _forget_pair(self) -> None:
        self._images.clear()
        self._cameras.clear()

    def _mark(self) -> None:
        self._pairs = self._located = 0
        self._failures: Counter[str] = Counter()
        self._time.clear()
        self._latency.clear()

    def _describe(self) -> tuple[str, dict[str, float]]:
        tracks = self._tracker.tracks
        numbers = {
            "pairs": self._pairs,
            "located": self._located,
            "objects": len(tracks) - len(self._stale),
            **{f"{name}_pictures": self._failures[name] for name in ("late", "old", "dark", "frozen")},
            "look_ms_p50": self._time.at(50),
            "look_ms_p99": self._time.at(99),
            "latency_ms_p50": self._latency.at(50),
            "latency_ms_p95": self._latency.at(95),
        }
        ages = [f"{one.name} {'stale' if one.name in self._stale else f'{self._now - one.seen:.1f} s ago'}" for one in tracks]
        return f"{', '.join(ages) or 'nothing seen'}; {self._pairs} pairs of pictures", numbers
