# SPDX-License-Identifier: Apache-2.0
"""`mobee calibrate --live`: moves the head and an arm of the running robot, and reads its pictures."""

from __future__ import annotations

import json
import logging
import os
import signal
import time
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from bus_schema import keys
from bus_schema.messages import Camera, Image
from bus_schema.rpc import Config, Empty
from experiments.kit.command_line import Progress
from mobee.arrays import Array
from mobee.errors import ActionInterrupted
from mobee.model.model import Model
from mobee.robot.load import load_robot
from mobee.robot.robot import Robot
from mobee.vision.calibration.calibration import Calibration, Observation
from mobee.vision.calibration.observing import MOVING, RESTING, choose_postures, moved_parts
from mobee.vision.calibration.solve import calibrate
from mobee.vision.encoders import Moment
from mobee.vision.imperfections import CameraSettings
from mobee.vision.lens import Lens
from mobee.vision.rig import Rig
from mobee.vision.tag import find_tag
from mobee_cli.connect import connected
from mobee_cli.errors import UserError
from services.common import rpc
from services.common.bus_follow import BusFollower
from services.common.config import ServiceConfig
from services.common.exit_codes import ENVIRONMENT, FAILED
from services.common.hands import part_of
from services.common.service import Service
from services.common.worlds import world_around
from services.vision.config import Config as VisionConfig

WHO = f"mobee_calibrate_{os.getpid()}"
REST = 0.4  # s of wall-clock time for which the robot rests in a posture
TRIES = 5  # of a motion that a hold interrupts
FIRST_PICTURE = 15.0  # s for the first picture
RigOf = Callable[[Robot, str, CameraSettings], Rig]


class Shot(NamedTuple):
    """The pictures of all cameras at one time.

    `images`: picture of each camera. `cameras`: the `Camera` message of each picture, with the lens and the encoder values at that time.
    Keys of both: names of the cameras.
    """

    cameras: dict[str, Camera]
    images: dict[str, Image]


class Pictures:
    """Collects the pictures that arrive on the bus from the cameras of `rig` (the robot with its cameras, their lens, and a tag).

    `shots`: complete sets of pictures, in order of arrival; the caller may clear this list.
    """

    def __init__(self, service: Service, rig: Rig) -> None:
        self._names = tuple(rig.cameras)
        self._parts: dict[int, Shot] = {}
        self.shots: list[Shot] = []
        for name in self._names:
            service.on_each(Camera, lambda camera: self._note(camera.k_capture, 0, camera), name)
            service.on_each(Image, lambda image: self._note(image.k_capture, 1, image), name)

    def _note(self, k: int, which: int, message: Any) -> None:
        shot = self._parts.setdefault(k, Shot({}, {}))
        shot[which][message.camera] = message
        if len(shot.cameras) == len(shot.images) == len(self._names):
            self.shots.append(self._parts.pop(k))
        for old in [one for one in self._parts if one < k - 100]:
            del self._parts[old]


def calibrated_live(endpoint: str, marker: str, rig_of: RigOf, count: int, seed: int) -> Calibration:
    """Calibrate the robot of the system at `endpoint` by moving its hand with an AprilTag, and return the calibration.

    `marker`: name of the marker (point on a link) at the palm with the tag. `rig_of(robot, marker, settings)`: function that returns the
    robot with its cameras and the tag. `count`: number of postures. `seed`: chooses the postures.
    Raises UserError if no system runs, or if it sends no pictures.
    """
    with connected(endpoint) as session:
        robot, world = _robot_of(session, endpoint)
        settings = CameraSettings()
        rig, part = rig_of(robot, marker, settings), part_of(robot, marker)
        with Service(WHO, ServiceConfig(endpoint=endpoint, robot=robot.name), robot, session=session) as service:
            signal.signal(signal.SIGINT, signal.default_int_handler)
            logging.getLogger().setLevel(logging.CRITICAL)
            plant, pictures = BusFollower(service, robot), Pictures(service, rig)
            service.on_clock(lambda clock: None)
            service.ready()
            lens = _lens(service, pictures)
            rig = Rig(robot, rig.cameras, lens, rig.tag)
            with Progress() as progress:
                postures = choose_postures(rig, Model(robot, world_around(world, robot.name)), settings, part, count, seed)
                seen = _watch(service, plant, pictures, rig, part, postures, progress)
            plant.let_go()
    return calibrate(rig, seen, settings)


def _robot_of(session: Any, endpoint: str) -> tuple[Robot, str]:
    try:
        found = json.loads(rpc.call(session, WHO, keys.service_rpc("model", "config"), Empty, Config, tries=3).config)
    except rpc.CallFailed as failed:
        raise UserError(
            f"no model answers at {endpoint} ({failed}): `mobee launch eyes` starts a system to calibrate", ENVIRONMENT
        ) from None
    return load_robot(found["robot"]), found["world"]


def _lens(service: Service, pictures: Pictures) -> Lens:
    """Return the lens of the cameras, from the first picture."""
    give_up = time.monotonic() + FIRST_PICTURE
    while not pictures.shots:
        if time.monotonic() > give_up:
            raise UserError(
                f"no pictures of two cameras in {FIRST_PICTURE:g} s: `mobee launch eyes` starts a system that makes them", ENVIRONMENT
            )
        service.spin(time.monotonic() + 0.1)
    camera = next(iter(pictures.shots[0].cameras.values()))
    return Lens.of_matrix(np.array(camera.intrinsics).reshape(3, 3), np.array(camera.distortion))


def _watch(
    service: Service, plant: BusFollower, pictures: Pictures, rig: Rig, part: str, postures: Array, progress: Progress
) -> list[Observation]:
    """Move through postures (K, n) rad; return what was seen of the tag while the robot moved, and at rest."""
    found, parts = [], moved_parts(rig, part)
    for number, posture in enumerate(postures):
        progress.show(number / len(postures), "watching the hand")
        pictures.shots.clear()
        _move(plant, parts, posture)
        moving = len(pictures.shots)
        service.spin(time.monotonic() + REST)
        middle = [pictures.shots[int(moving * share)] for share in np.linspace(0.2, 0.5, MOVING)] if moving else []
        for shot in [*middle, *pictures.shots[max(moving, len(pictures.shots) - RESTING) :]]:
            if (one := _observation(rig, shot)) is not None:
                found.append(one)
    return found


def _move(plant: BusFollower, parts: Sequence[str], posture: Array) -> None:
    """Move parts to a posture (n,) rad at once, again after a hold; raises UserError if they are interrupted every time."""
    why = ""
    for _ in range(TRIES):
        try:
            plant.take(parts)
            plant.follow(parts, [posture], period=0.0)
            return
        except ActionInterrupted as interruption:
            why = str(interruption)
            plant.let_go()  # else the next attempt would begin by what was known before
    raise UserError(f"the robot was interrupted {TRIES} times: {why}. `mobee status` shows its state.", FAILED)


def _observation(rig: Rig, shot: Shot) -> Observation | None:
    corners = {}
    for name, image in shot.images.items():
        picture = np.frombuffer(image.data, np.uint8).reshape(image.height, image.width, 3)
        if (seen := find_tag(picture, rig.lens)) is not None:
            corners[name] = seen
    camera = next(iter(shot.cameras.values()))
    variance = np.full(len(camera.q), VisionConfig().encoder_noise ** 2 / camera.readings)
    return Observation(Moment(np.array(camera.q), np.array(camera.dq), variance), corners) if corners else None
