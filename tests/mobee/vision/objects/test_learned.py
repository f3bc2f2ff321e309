# SPDX-License-Identifier: Apache-2.0
"""A detector that is trained on rendered pictures: its outlines, its file, and files that are refused."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import onnx
import pytest

from mobee import InvalidValue, load_world
from mobee.rendering.scene import Scene, clutter, room
from mobee.vision.imperfections import CameraErrors, Cameras, CameraSettings
from mobee.vision.objects.detection import outlined
from mobee.vision.objects.detectors import detector_of, require_detector
from mobee.vision.objects.learned.network import KEY, Network, load_network, network_of
from mobee.vision.objects.learned.training import HIDDEN, judge, surroundings, train
from services.vision.config import Config
from tests.mobee.vision.calibration.synthetic import RIG, ROBOT
from tests.mobee.vision.objects.drawn import BALL, THINGS

WORLD = load_world("things")


def layers(rng: np.random.Generator, outputs: int) -> list[tuple[np.ndarray, np.ndarray]]:
    sizes = [150, *HIDDEN, outputs]
    return [
        (0.1 * rng.standard_normal((a, b)).astype(np.float32), 0.1 * rng.standard_normal(b).astype(np.float32))
        for a, b in zip(sizes[:-1], sizes[1:], strict=True)
    ]


@pytest.fixture
def network(rng: np.random.Generator) -> Network:
    return network_of(THINGS, *layers(rng, len(THINGS)))


def test_opencv_computes_for_the_picture_what_was_trained_for_its_pixels(rng: np.random.Generator) -> None:
    first, second, third = layers(rng, len(THINGS))
    picture = rng.integers(0, 256, (20, 30, 3), dtype=np.uint8)
    hidden = np.maximum(surroundings(picture, np.arange(600)) @ first[0] + first[1], 0.0)
    expected = np.clip(np.maximum(hidden @ second[0] + second[1], 0.0) @ third[0] + third[1], 0.0, 1.0)
    found = network_of(THINGS, first, second, third).shares()(picture)
    np.testing.assert_allclose(found.reshape(3, -1).T, expected, atol=1e-4)
    assert 0.1 < np.mean((expected > 0.0) & (expected < 1.0))


def test_a_detector_is_not_judged_without_pictures() -> None:
    with pytest.raises(InvalidValue, match="at least one"):
        judge(lambda picture: [], [BALL.name], [])


def test_a_trained_detector_finds_the_outline_of_the_ball_in_a_picture_that_it_has_not_seen(tmp_path: Path) -> None:
    path = train(ROBOT, WORLD, THINGS, pictures=24, seed=1).save(tmp_path / "things.onnx")
    require_detector(str(path), THINGS)
    settings = CameraSettings()
    around = [*room(77), *clutter(WORLD.objects.values(), 77)]
    eyes = Cameras(Scene(ROBOT, WORLD, RIG.cameras, around=around), settings, CameraErrors.none(ROBOT, list(RIG.cameras)), 77)
    q = ROBOT.home.copy()
    q[list(RIG.head)] = [-0.454, 0.0, 0.0, -0.314, 0.0, 0.192]
    postures = [q] * settings.samples
    shares = eyes.shares("left", postures, len(WORLD.objects))
    (true,) = outlined("ball", shares[..., list(WORLD.objects).index("ball")])
    found = [one for one in detector_of(str(path), THINGS)(eyes.expose("left", postures)) if one.name == "ball"]
    nearest = min(found, key=lambda one: float(np.linalg.norm(one.centre - true.centre)))
    assert true.confidence > 0.95 and np.linalg.norm(nearest.centre - true.centre) < 0.5
    angles, radii = zip(*(polar(one.outline - true.centre) for one in (nearest, true)), strict=True)
    assert np.abs(radii[0] - np.interp(angles[0], angles[1], radii[1], period=2.0 * np.pi)).max() < 1.0
    assert abs(radii[0].mean() - radii[1].mean()) < 0.5


def polar(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return np.arctan2(points[:, 1], points[:, 0]), np.hypot(points[:, 0], points[:, 1])


def test_a_file_keeps_what_it_was_trained_for_and_is_refused_for_other_things(network: Network, tmp_path: Path) -> None:
    path = network.save(tmp_path / "things.onnx")
    assert load_network(path).things == THINGS
    Config(robot="icub", world="things", detector=str(path)).check_robot(ROBOT)
    with pytest.raises(InvalidValue, match=r"Only the file has: box .*; cup .* Only the world has: none\. Train .* mobee detector train"):
        Config(robot="icub", world="table", detector=str(path)).check_robot(ROBOT)
    with pytest.raises(InvalidValue, match=r"Only the world has: ball \(sphere, 0.05 m, colour 0.9 0.05 0.05\)"):
        require_detector(str(path), [replace(BALL, size=(0.05,))])


def test_a_damaged_or_foreign_file_is_refused_in_one_line(network: Network, tmp_path: Path, rng: np.random.Generator) -> None:
    model = onnx.load_model_from_string(network.model)
    del model.metadata_props[:]
    bare = model.SerializeToString()
    onnx.helper.set_model_props(model, {KEY: '{"format": "mobee detector 1", "things": [{"name": "ball"}]}'})
    fewer = onnx.load_model_from_string(network_of(THINGS[:2], *layers(rng, 3)).model)  # three outputs, of two things
    contents = {
        "text.onnx": b"no network",
        "empty.onnx": b"",
        "cut.onnx": network.model[: len(network.model) // 2],
        "bare.onnx": bare,
        "things.onnx": model.SerializeToString(),
        "fewer.onnx": fewer.SerializeToString(),
    }
    for name, content in contents.items():
        (tmp_path / name).write_bytes(content)
    for name in (*contents, "none.onnx"):
        with pytest.raises(InvalidValue) as refused:
            require_detector(str(tmp_path / name), THINGS)
        assert name in str(refused.value) and "\n" not in str(refused.value)
