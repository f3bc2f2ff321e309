# SPDX-License-Identifier: Apache-2.0
"""Trains the network of a learned detector on rendered pictures, and measures the quality of a detector on such pictures.

A labelled picture shows things (objects that vision can recognise) at random positions before a robot's cameras, and has the share of each
thing in each pixel. The network learns, by least squares, to predict this share from the surroundings of a pixel. Its output therefore
estimates the mean share over all pixels that have the same surroundings. Pixels are drawn from the edges and the inside of things and from
the rest of the picture. The network first learns from half of the pictures. Then it learns from all of them, and also from pixels at which
it was wrong.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from time import process_time
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter

from mobee.arrays import Array, Ints
from mobee.errors import InvalidValue, NotInstalled
from mobee.model.kinematics import link_transforms
from mobee.model.world import World
from mobee.rendering.camera import Floats
from mobee.rendering.scene import Picture, Scene, clutter, room
from mobee.robot.cameras import cameras_of
from mobee.robot.robot import Robot
from mobee.vision.imperfections import HEAD, CameraErrors, Cameras, CameraSettings
from mobee.vision.lens import camera_frames
from mobee.vision.objects.detection import Detection, Detector, outlined
from mobee.vision.objects.learned.network import APART, MIDDLE, SIDE, Network, network_of
from mobee.vision.objects.thing import Thing

PICTURES = 200
HIDDEN = (16, 16)  # units
EDGE, INSIDE, OUTSIDE, WRONG = 150, 50, 200, 200  # pixels of a picture, at most: of each thing, of each, of the rest, and mistakes
NEAR_EDGE = 5  # px: side of the square around a pixel in which the share changes
MISTAKE = 0.3  # error of a share
ROUNDS = ((12, 3e-3), (30, 2e-3), (12, 4e-4))  # passes over all pixels, and the step of Adam; the first before mistakes are collected
BATCH = 256
OTHERS = 1_000_003  # added to the seed
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

Report = Callable[[float, str], None]


def train(
    robot: Robot,
    world: World,
    things: Sequence[Thing],
    pictures: int = PICTURES,
    seed: int = 0,
    report: Report = lambda share, text: None,
) -> Network:
    """Train a network that detects things.

    Args:
        robot: the robot whose cameras see the things.
        world: contains the things, and the boxes on which they may stand.
        things: the things to be found.
        pictures: number of rendered pictures from which the network learns.
        seed: seed of the random pictures, pixels and weights.
        report: called with the share of the work that is done (0 to 1) and a text about the present step.

    Raises:
        NotInstalled: scikit-learn, ONNX or OpenCV is not installed.
        InvalidValue: the robot has no camera.
    """
    regressor, rng = _regressor(seed), np.random.default_rng([seed, 0x706978656C])
    shown: list[Labelled] = []
    inputs: list[Floats] = []
    outputs: list[Floats] = []
    for number, one in enumerate(labelled_pictures(robot, world, things, pictures, seed)):
        report(0.4 * number / pictures, "drawing pictures")
        shown.append(one)
        _take(one, _chosen(one.shares, rng), inputs, outputs)
    half = (len(shown) + 1) // 2
    report(0.4, "learning")
    _fit(regressor, inputs[:half], outputs[:half], *ROUNDS[0])
    shares = _network(regressor, things).shares()
    for number, one in enumerate(shown):
        report(0.45 + 0.1 * number / len(shown), "collecting mistakes")
        wrong = np.flatnonzero(np.abs(shares(one.picture).transpose(1, 2, 0) - one.shares).max(axis=2).ravel() > MISTAKE)
        _take(one, rng.permutation(wrong)[:WRONG], inputs, outputs)
    for done, (passes, step) in zip((0.55, 0.85), ROUNDS[1:], strict=True):
        report(done, "learning again")
        _fit(regressor, inputs, outputs, passes, step)
    return _network(regressor, things)


def held_out(robot: Robot, world: World, things: Sequence[Thing], pictures: int, seed: int) -> Iterator[Labelled]:
    """Yield test pictures for a network that `train` made with the same arguments.

    These pictures are drawn with another seed than those from which the network learned. Their number is a fifth of `pictures`, at least 1.
    `pictures` and `seed` are the arguments that were given to `train`.
    """
    return labelled_pictures(robot, world, things, max(1, pictures // 5), seed + OTHERS)


def _chosen(shares: Floats, rng: np.random.Generator) -> Ints:
    """Return the pixels of a picture that are used for training, as indices row * width + column.

    They are drawn at random: up to EDGE at the edges of each thing and up to INSIDE in its interior, and up to OUTSIDE elsewhere. `shares`:
    (H, W, N), the share of each pixel that each of N things covers.
    """
    anything = np.zeros(shares.shape[:2], np.bool_)
    found = []
    for number in range(shares.shape[2]):
        share = shares[..., number]
        edge = maximum_filter(share, NEAR_EDGE) != -maximum_filter(-share, NEAR_EDGE)
        inside = (share > 0.5) & ~edge
        anything |= edge | inside
        found += [rng.permutation(np.flatnonzero(edge))[:EDGE], rng.permutation(np.flatnonzero(inside))[:INSIDE]]
    outside = np.flatnonzero(~anything)
    return np.concatenate([*found, rng.choice(outside, min(OUTSIDE, len(outside)), replace=False)])


def _take(one: Labelled, pixels: Ints, inputs: list[Floats], outputs: list[Floats]) -> None:
    inputs.append(surroundings(one.picture, pixels))
    outputs.append(one.shares.reshape(-1, one.shares.shape[2])[pixels])


def surroundings(picture: Picture, pixels: Ints) -> Floats:
    """Return the inputs of the network for M pixels of a picture, (M, 150), in the order that `network_of` describes.

    `pixels`: (M,) numbers row * width + column. Brightness is scaled to -1 to 1.
    """
    reach = SIDE // 2 * APART
    height, width = picture.shape[:2]
    padded = np.zeros((height + 2 * reach, width + 2 * reach, 3), np.float32)
    padded[reach:-reach, reach:-reach] = picture / np.float32(MIDDLE) - np.float32(1.0)
    rows, columns = np.divmod(pixels, width)
    steps = np.arange(SIDE) - SIDE // 2
    offsets = np.stack([steps, APART * steps]) + reach
    down, right = rows[:, None, None, None] + offsets[:, :, None], columns[:, None, None, None] + offsets[:, None, :]
    found: NDArray[np.float32] = padded[down, right]  # (M, 2, 5, 5, 3)
    return found.transpose(0, 1, 4, 2, 3).reshape(len(pixels), -1)


def _fit(regressor: Any, inputs: list[Floats], outputs: list[Floats], passes: int, step: float) -> None:
    """Let a regressor continue learning, for some passes over all pixels."""
    regressor.set_params(max_iter=passes, learning_rate_init=step, n_iter_no_change=passes)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # that it has not converged after so many passes
        regressor.fit(np.concatenate(inputs), np.concatenate(outputs))


def _network(regressor: Any, things: Sequence[Thing]) -> Network:
    first, second, third = zip(regressor.coefs_, regressor.intercepts_, strict=True)
    return network_of(things, first, second, third)


def _regressor(seed: int) -> Any:
    try:
        from sklearn.neural_network import MLPRegressor
    except ImportError:
        raise NotInstalled('training a detector needs scikit-learn: pip install "mobee[vision]"') from None
    return MLPRegressor(hidden_layer_sizes=HIDDEN, batch_size=BATCH, random_state=seed, warm_start=True)


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
    """Return for each thing, by its name, a random position (3,) m in front of a camera, and whether it was lifted onto a box.

    If the position is inside, below or too closely above a box (obstacle) of the world, the thing is lifted to stand on the box. `frame`:
    the camera's position (3,) m and rotation (3, 3), root frame.
    """
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

    `names`: names of the N things, in the order of the last axis of `Labelled.shares` (H, W, N). Raises InvalidValue if there are no
    pictures.
    """
    if not pictures:
        raise InvalidValue("no pictures: a detector is judged on at least one")
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
