# SPDX-License-Identifier: Apache-2.0
"""Rendered pictures with labels, on which a detector is trained and judged: things at random positions before a robot's cameras.

A thing is an object that vision can recognise. Each picture has the share of each thing in each pixel.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from time import process_time

import numpy as np

from mobee.arrays import Array
from mobee.errors import InvalidValue
from mobee.model.kinematics import link_transforms
from mobee.model.world import World
from mobee.rendering.camera import Floats
from mobee.rendering.scene import Picture, Scene, clutter, room
from mobee.robot.cameras import cameras_of
from mobee.robot.robot import Robot
from mobee.vision.exposure import Cameras
from mobee.vision.imperfections import HEAD, CameraErrors, CameraSettings
from mobee.vision.lens import camera_frames
from mobee.vision.objects.detection import Detection, Detector, outlined
from mobee.vision.objects.thing import Thing

_STREAM = 0x6C6561726E  # of random numbers
LOOKS = 4  # pictures in each room
SAMPLES = 2  # moments of the exposure
DISTANCES = (0.22, 0.65)  # m from a camera, along its axis
ASIDE = np.array([0.6, 0.45])  # largest slope of the ray to a thing, to the right and down
ON_BOX, TRIES = 0.6, 40  # share of the pictures in which all things stand on boxes of the world; postures that are tried for one
MOVED = 0.15  # share of its range by which each motor but those of the head is away from home, at most
BRIGHTNESS = (0.6, 1.1)  # factor on the picture
NEAR = 2.0  # px between the middles of a true outline and of one that counts as the same
WHOLE = 0.99  # share of an outline within the picture, and of its hull that is filled, of a thing that must be found


@dataclass(frozen=True, slots=True, eq=False)
class Labelled:
    """A labelled picture.

    `picture`: (H, W, 3). `shares`: (H, W, N), the share of each pixel that each of N things covers, 0 to 1.
    """

    picture: Picture
    shares: Floats


def labelled_pictures(robot: Robot, world: World, things: Sequence[Thing], count: int, seed: int) -> Iterator[Labelled]:
    """Yield `count` pictures from the robot's cameras, with distortion and noise, each with random posture, positions and brightness.

    `things`: the objects that vision has to recognise, all of them objects of `world`; they get random positions before the camera. The
    background is a random room with decoration, and paper lies on the boxes of the world. About a quarter of the decoration and of the
    papers have the colour of one of the things. `seed`: seed of all random draws. Raises InvalidValue if the robot has no camera.
    """
    cameras = cameras_of(robot)
    if not cameras:
        raise InvalidValue(f"{robot.name} has no camera: a detector is trained on pictures of the robot's cameras")
    rng = np.random.default_rng([seed, _STREAM])
    settings, colors = CameraSettings(samples=SAMPLES), tuple(thing.color for thing in things)
    numbers = [list(world.objects).index(thing.name) for thing in things]
    for number in range(count):
        if number % LOOKS == 0:
            drawn = int(rng.integers(2**31))
            around = [*room(drawn, colors), *clutter(world.objects.values(), drawn, colors)]
            scene = Scene(robot, world, cameras, around=around)
            eyes = Cameras(scene, settings, CameraErrors.none(robot, list(cameras)), drawn)
        name = list(cameras)[int(rng.integers(len(cameras)))]
        on_box = rng.uniform() < ON_BOX
        for _ in range(TRIES):
            q = _posture(robot, rng)
            frame = camera_frames(cameras[name], link_transforms(robot, q), np.zeros(6))
            places = _places(world, things, frame, rng)
            if all(lifted for _, lifted in places.values()) or not on_box:
                break
        for thing, (at, _) in places.items():
            yaw = rng.uniform(-np.pi, np.pi)
            scene.place(thing, at, np.array([np.cos(0.5 * yaw), 0.0, 0.0, np.sin(0.5 * yaw)]))
        postures = [q] * SAMPLES
        brightness = rng.uniform(*BRIGHTNESS)
        picture = np.clip(brightness * eyes.expose(name, postures) + 0.5, 0.0, 255.0).astype(np.uint8)
        yield Labelled(picture, eyes.shares(name, postures, len(world.objects))[..., numbers])


def _posture(robot: Robot, rng: np.random.Generator) -> Array:
    """Return a posture (n,) rad: the head anywhere, the other motors near home."""
    low, high = robot.limits.T
    q = robot.home + MOVED * (high - low) * rng.uniform(-1.0, 1.0, len(low))
    if HEAD in robot.parts:
        where = robot.parts[HEAD].slice
        q[where] = rng.uniform(low[where], high[where])
    found: Array = np.clip(q, low, high)
    return found


def _places(
    world: World, things: Sequence[Thing], frame: tuple[Array, Array], rng: np.random.Generator
) -> Mapping[str, tuple[Array, bool]]:
    """Return a place (3,) m of each thing ahead of a camera, on the top of a box of the world if it would be below, and whether it was."""
    position, rotation = frame
    found = {}
    for thing in things:
        lifted = False
        slopes = ASIDE * rng.uniform(-1.0, 1.0, 2)
        at = position + rng.uniform(*DISTANCES) * rotation @ np.array([*slopes, 1.0])
        half = thing.size[0] if thing.kind == "sphere" else 0.5 * thing.size[-1]
        for item in world.objects.values():
            if item.kind == "box" and item.role == "obstacle":
                local, sides = item.rotation.T @ (at - item.position), 0.5 * np.array(item.size)
                if (np.abs(local[:2]) < sides[:2]).all() and local[2] < sides[2] + half:
                    at = item.position + item.rotation @ np.array([*local[:2], sides[2] + half])
                    lifted = True
        found[thing.name] = at, lifted
    return found


@dataclass(frozen=True, slots=True)
class Quality:
    """The quality of a detector on labelled pictures.

    `pictures`: number of pictures. `found`: by name of the thing, the share of its wholly visible outlines that were found; NaN if there
    were no such outlines. An outline is found if the middle of a detection of the thing is less than 2 px from the middle of the outline.
    `error`: median of this distance over the found outlines, px. `false_regions`: number of detections per picture whose middle does not
    show the thing. `seconds`: processor time per picture.
    """

    pictures: int
    found: dict[str, float]
    error: float
    false_regions: float
    seconds: float


def judge(detect: Detector, names: Sequence[str], pictures: Sequence[Labelled]) -> Quality:
    """Measure the quality of a detector on labelled pictures.

    `names`: names of the N things, in the order of the last axis of `Labelled.shares` (H, W, N).
    """
    errors: dict[str, list[float]] = {name: [] for name in names}
    false, seconds = 0, 0.0
    for one in pictures:
        begin = process_time()
        detections = list(detect(one.picture))
        seconds += process_time() - begin
        for number, name in enumerate(names):
            own = [detection for detection in detections if detection.name == name]
            false += sum(not _shows(one, detection, number) for detection in own)
            for true in outlined(name, one.shares[..., number]):
                if true.confidence > WHOLE:
                    errors[name].append(min((float(np.linalg.norm(found.centre - true.centre)) for found in own), default=np.inf))
    near = np.array([error for some in errors.values() for error in some if error < NEAR])
    return Quality(
        len(pictures),
        {name: float(np.mean(np.array(some) < NEAR)) if some else float("nan") for name, some in errors.items()},
        float(np.median(near)) if len(near) else float("nan"),
        false / len(pictures),
        seconds / len(pictures),
    )


def _shows(one: Labelled, detection: Detection, number: int) -> bool:
    """Return whether a picture shows a thing in the middle of a detection."""
    column, row = np.round(detection.centre).astype(int)
    return bool(one.shares[row, column, number] >= 0.5)
