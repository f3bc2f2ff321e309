# SPDX-License-Identifier: Apache-2.0
"""Pictures of imperfect cameras: where things are in them, noise, motion blur, and the tag on the palm."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
import pytest

from mobee import InvalidValue, UnknownName, World, load_world, sphere
from mobee.rendering.scene import Scene, clutter, room
from mobee.vision.ball import find_balls
from mobee.vision.encoders import Moment, Readings, moment_at
from mobee.vision.imperfections import CameraErrors, Cameras, CameraSettings, camera_errors
from mobee.vision.lens import DRAGONFLY
from mobee.vision.objects.detectors import detector_of
from mobee.vision.objects.placing import eyes_at, locate_all
from mobee.vision.objects.thing import things_in
from mobee.vision.rig import see_tag
from mobee.vision.tag import CELLS, FAMILY, NUMBER, Tag, aligned, find_tag, tag_solids
from tests.mobee.vision.calibration.synthetic import MODEL, RIG, ROBOT, postures

SETTINGS = CameraSettings(samples=4)
ERRORS = camera_errors(SETTINGS, ROBOT, list(RIG.cameras), seed=2)
TRUE = RIG.parameters(ERRORS)
STILL = np.zeros((1, len(ROBOT.motors)))


def cameras(settings: CameraSettings, errors: CameraErrors, world: World, seed: int = 0) -> Cameras:
    around = [*room(seed), *clutter(MODEL.world.objects.values(), seed)]
    worn = tag_solids(Tag("left_palm"), ROBOT, errors.tag)
    return Cameras(Scene(ROBOT, world, RIG.cameras, worn=worn, around=around), settings, errors, seed)


def test_the_tag_is_found_to_a_tenth_of_a_pixel_where_cameras_and_hand_really_are() -> None:
    eyes, off = cameras(SETTINGS, ERRORS, MODEL.world), []
    for q in postures()[:4]:
        for name in RIG.cameras:
            corners = find_tag(eyes.expose(name, [q] * SETTINGS.samples), DRAGONFLY)
            if corners is not None:
                off.append(corners - see_tag(RIG, name, TRUE, q[None], STILL).pixels[0])
    assert len(off) >= 6
    assert np.sqrt(np.mean(np.square(off))) < 0.15
    assert np.abs(np.mean(off, axis=(0, 1))).max() < 0.06


def test_among_red_things_the_ball_is_the_one_on_which_both_cameras_agree() -> None:
    q, ball = ROBOT.home, np.array([-0.35, 0.0, 0.02])
    world = World()
    world.add("ball", sphere(0.03), position=ball, color=(1, 0, 0))
    eyes = cameras(SETTINGS, ERRORS, world)
    pictures = [eyes.expose(name, [q] * SETTINGS.samples) for name in RIG.cameras]
    red = [(picture[..., 0] > 120) & (picture[..., 1:].max(axis=-1) < 60) for picture in pictures]
    things = things_in(load_world("table"))
    detect = detector_of("color", things)
    seen = {name: detect(picture) for name, picture in zip(RIG.cameras, pictures, strict=True)}
    (fix,) = locate_all(things, seen, eyes_at(RIG, TRUE, Moment(q, np.zeros(len(q)), np.full(len(q), 1e-6))))
    np.testing.assert_allclose(fix.position, ball, atol=0.006)
    assert min(mask.sum() for mask in red) > 1.2 * np.pi * (DRAGONFLY.fx * 0.03 / 0.4) ** 2  # there is more red than the ball's


def test_noise_has_the_variance_of_electrons_and_its_seed() -> None:
    exact = CameraSettings(read_noise=0.0, full_well=1e12, samples=1)
    noisy = CameraSettings(samples=1)
    q = ROBOT.home
    clean = cameras(exact, ERRORS, World()).expose("left", [q]).astype(float)
    eyes = cameras(noisy, ERRORS, World(), seed=0)
    pictures = np.array([eyes.expose("left", [q]) for _ in range(3)]).astype(float)
    np.testing.assert_array_equal(pictures[0], cameras(noisy, ERRORS, World(), seed=0).expose("left", [q]))
    per_electron = 255.0 * noisy.gain / noisy.full_well
    flat = (clean > 60) & (clean < 200)
    wanted = np.sqrt(per_electron * clean[flat] + (per_electron * noisy.read_noise) ** 2 + 1.0 / 12.0)
    measured = (pictures[:, flat] - clean[flat]) / wanted
    assert measured.std() == pytest.approx(1.0, abs=0.05)
    assert abs(measured.mean()) < 0.05


def test_motion_within_the_exposure_blurs_and_its_middle_stays() -> None:
    q = postures()[0]
    aside = np.zeros(len(q))
    aside[ROBOT.motor_index("eyes_version")] = np.deg2rad(0.4)
    eyes = cameras(SETTINGS, ERRORS, World())
    still = eyes.expose("left", [q] * 4).astype(float)
    moved = eyes.expose("left", [q + share * aside for share in (-0.75, -0.25, 0.25, 0.75)]).astype(float)
    sharp = [np.abs(np.diff(one.mean(axis=2), axis=1)).max() for one in (still, moved)]
    assert sharp[1] < 0.95 * sharp[0]
    first, second = (find_tag(one.astype(np.uint8), DRAGONFLY) for one in (still, moved))
    assert first is not None and second is not None
    np.testing.assert_allclose(first.mean(axis=0), second.mean(axis=0), atol=0.3)


def test_the_drawn_cells_are_those_of_opencv() -> None:
    dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, FAMILY))
    image = cv2.aruco.generateImageMarker(dictionary, NUMBER, len(CELLS), borderBits=1)
    assert ["".join("#" if cell == 0 else "." for cell in row) for row in image] == list(CELLS)


def test_a_picture_without_the_tag_has_none_and_one_that_differs_is_not_aligned(rng: np.random.Generator) -> None:
    empty = rng.integers(0, 255, (240, 320, 3), dtype=np.uint8)
    assert find_tag(empty, DRAGONFLY) is None
    corners = np.array([[100.0, 100.0], [130.0, 100.0], [130.0, 130.0], [100.0, 130.0]])
    pattern = np.array([[0.0 if cell == "#" else 1.0 for cell in row] for row in CELLS])
    assert aligned(empty[..., 0].astype(np.float32), DRAGONFLY, np.pad(pattern, 1, constant_values=1.0), 1, corners) is None


@pytest.mark.parametrize("find", [lambda given: find_tag(given, DRAGONFLY), lambda given: find_balls(given, DRAGONFLY.matrix)])
@pytest.mark.parametrize(
    "given",
    [
        np.zeros((24, 32), np.uint8), np.zeros((24, 32, 1), np.uint8), np.zeros((24, 32, 4), np.uint8), np.zeros((0, 32, 3), np.uint8),
        np.zeros((24, 32, 3)), [[[0, 0, 0]]], None,
    ],
    ids=["grey", "one channel", "RGBA", "empty", "floats", "list", "none"],
)  # fmt: skip
def test_what_is_no_picture_in_colour_is_refused(find: Any, given: Any) -> None:
    with pytest.raises(InvalidValue, match=r"the picture is .*; it must be an array \(height, width, 3\) of uint8"):
        find(given)


def test_balls_are_found_with_the_matrix_of_a_camera_only() -> None:
    with pytest.raises(InvalidValue, match=r"intrinsics of shape \(\): .* `lens.matrix`"):
        find_balls(np.zeros((24, 32, 3), np.uint8), DRAGONFLY)  # type: ignore[arg-type]


def test_a_tag_needs_a_marker_and_a_size() -> None:
    with pytest.raises(UnknownName):
        Tag("third_palm").frame(ROBOT)
    with pytest.raises(InvalidValue):
        Tag("left_palm", size=0.0)


def test_encoders_at_a_stamp_follow_a_line_through_the_readings(rng: np.random.Generator) -> None:
    times = np.arange(20) * 0.01
    found = moment_at(times, np.outer(times, [2.0, -1.0]) + [0.1, 0.2], 0.1, np.array([0.01, 0.02]))
    np.testing.assert_allclose(found.q, [0.3, 0.1])
    np.testing.assert_allclose(found.dq, [2.0, -1.0])
    np.testing.assert_allclose(found.variance, np.array([0.01, 0.02]) ** 2 / 7.0)
    readings = Readings({"torso": slice(0, 1), "head": slice(1, 2)}, 2)
    for t in times:
        readings.note("torso", t, np.array([2.0 * t]))
        readings.note("head", t + 0.004, np.array([-t]))
    q, dq, count = readings.at(0.1)
    np.testing.assert_allclose(q, [0.2, -0.096], atol=1e-12)
    np.testing.assert_allclose(dq, [2.0, -1.0])
    assert count == 7
    with pytest.raises(InvalidValue, match="readings"):
        readings.at(9.0)
