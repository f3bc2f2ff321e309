# SPDX-License-Identifier: Apache-2.0
"""Trains the network of a learned detector on rendered pictures.

The network learns, by least squares, to predict from the surroundings of a pixel which share of the pixel each thing (an object to be
found) covers. Its output therefore estimates the mean share over all pixels that have the same surroundings. Pixels are drawn from the
edges and the inside of things and from the rest of the picture. The network first learns from half of the pictures. Then it learns from all
of them, and also from pixels at which it was wrong.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter

from mobee.arrays import Ints
from mobee.errors import NotInstalled
from mobee.model.world import World
from mobee.rendering.camera import Floats
from mobee.rendering.scene import Picture
from mobee.robot.robot import Robot
from mobee.vision.objects.learned.network import APART, MIDDLE, SIDE, Network, network_of
from mobee.vision.objects.learned.pictures import Labelled, labelled_pictures
from mobee.vision.objects.thing import Thing

PICTURES = 200
HIDDEN = (16, 16)  # units
EDGE, INSIDE, OUTSIDE, WRONG = 150, 50, 200, 200  # pixels of a picture, at most: of each thing, of each, of the rest, and mistakes
NEAR_EDGE = 5  # px: side of the square around a pixel in which the share changes
MISTAKE = 0.3  # error of a share
ROUNDS = ((12, 3e-3), (30, 2e-3), (12, 4e-4))  # passes over all pixels, and the step of Adam; the first before mistakes are collected
BATCH = 256
OTHERS = 1_000_003  # added to the seed

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
    """Return the pixels of a picture from which it learns, as row * width + column: some at edges, some inside things, some outside."""
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
