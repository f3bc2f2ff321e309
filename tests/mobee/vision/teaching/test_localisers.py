# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from mobee.errors import UnknownName
from mobee.model.kinematics import link_transforms
from mobee.robot.cameras import cameras_of
from mobee.robot.load import load_robot
from mobee.vision.imperfections import CameraSettings, camera_errors
from mobee.vision.lens import camera_frames, into
from mobee.vision.rig import Rig
from mobee.vision.teaching.cartesian_programs import CartesianPrograms
from mobee.vision.teaching.lessons import seeing_motors
from mobee.vision.teaching.localisers import CORRECTED, REGRESSIONS, eye_features, localiser, stereo_places

ROBOT = load_robot("icub")
RIG = Rig(ROBOT, cameras_of(ROBOT), CameraSettings().lens)
TRUE = RIG.parameters(camera_errors(CameraSettings(), ROBOT, list(RIG.cameras), seed=3))


@cache
def seen(count: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Inputs and places of things that a robot with imperfect cameras sees without noise."""
    rng, motors = np.random.default_rng(seed), seeing_motors(ROBOT)
    inputs, places = [], []
    while len(inputs) < count:
        q = np.repeat(ROBOT.home[None], 200, axis=0)
        low, high = ROBOT.limits[motors].T
        middle = ROBOT.home[motors]
        q[:, motors] = middle + 0.3 * rng.uniform(low - middle, high - middle, (200, len(motors)))
        at = rng.uniform([-0.45, -0.2, -0.05], [-0.25, 0.2, 0.2], (200, 3))
        transforms = link_transforms(ROBOT, RIG.posture(TRUE, q, 0.0 * q))
        frames = [camera_frames(camera, transforms, TRUE[RIG.where(name)]) for name, camera in RIG.cameras.items()]
        pixels = np.stack([RIG.lens.project(into(*frame, at)) for frame in frames], axis=1)
        inside = ((pixels > 5.0) & (pixels < (315.0, 235.0))).all(axis=(1, 2))
        inputs += [np.concatenate([pixels[k].ravel(), q[k, motors]]) for k in np.flatnonzero(inside)]
        places += list(at[inside])
    return np.array(inputs[:count]), np.array(places[:count])


def median(found: np.ndarray, places: np.ndarray) -> float:
    return float(np.median(np.linalg.norm(found - places, axis=1)))


def test_stereo_is_exact_with_the_true_cameras_and_wrong_with_those_of_the_model():
    inputs, places = seen(60, 1)
    assert np.abs(stereo_places(RIG, TRUE, inputs) - places).max() < 1e-9
    assert median(stereo_places(RIG, np.zeros(len(TRUE)), inputs), places) > 0.01


def test_corrected_stereo_learns_the_cameras_and_a_wrong_lesson_does_not_spoil_it():
    inputs, places = seen(60, 1)
    reported = places.copy()
    reported[7] += (0.3, 0.0, 0.0)
    learner = localiser(CORRECTED, RIG, 0)
    learner.fit(inputs, reported)
    held_out, there = seen(40, 2)
    uncalibrated = median(stereo_places(RIG, np.zeros(len(TRUE)), held_out), there)
    assert median(learner.predict(held_out), there) < 0.1 * uncalibrated


@pytest.mark.parametrize("name", REGRESSIONS)
def test_regressions_learn_places_of_poses_that_they_have_not_seen(name, monkeypatch):
    pytest.importorskip("sklearn")
    monkeypatch.setattr("mobee.vision.teaching.localisers.CartesianPrograms", lambda seed: CartesianPrograms(seed, generations=60))
    inputs, places = seen(150, 1)
    held_out, there = seen(60, 2)
    learner = localiser(name, RIG, 0)
    learner.fit(inputs, places)
    without_eyes = median(np.repeat(places.mean(axis=0)[None], len(there), axis=0), there)
    assert median(learner.predict(held_out), there) < 0.6 * without_eyes
    again = localiser(name, RIG, 0)
    again.fit(inputs, places)
    np.testing.assert_array_equal(again.predict(held_out), learner.predict(held_out))


def test_the_features_of_the_eyes_are_inputs_and_a_place_that_turning_an_eye_does_not_change():
    inputs = np.zeros((2, 13))
    inputs[:, 0:4:2], inputs[:, 1:4:2] = RIG.lens.cx, RIG.lens.cy
    inputs[:, 12] = 0.2  # vergence
    inputs[1, 11] = 0.1  # version, and the thing is as far to the other side in both pictures
    inputs[1, 0:4:2] -= RIG.lens.fx * np.tan(0.1)
    features = eye_features(inputs, RIG.lens)
    np.testing.assert_array_equal(features[:, :13], inputs)
    np.testing.assert_allclose(features[0, 13:], (5.0, 0.0, 0.0), atol=1e-9)
    np.testing.assert_allclose(features[1, 13:], features[0, 13:], atol=1e-9)


def test_an_unknown_localiser_names_the_nearest():
    with pytest.raises(UnknownName, match="Gaussian process"):
        localiser("gaussian proces", RIG, 0)


def test_evolution_finds_a_formula_that_no_linear_regression_has():
    rng = np.random.default_rng(0)
    x, fresh = rng.standard_normal((200, 3)), rng.standard_normal((100, 3))

    def truth(rows: np.ndarray) -> np.ndarray:
        return np.stack([rows[:, 0] * rows[:, 1], np.sin(rows[:, 2])], axis=1)

    programs = CartesianPrograms(seed=1, generations=200).fit(x, truth(x))
    assert np.abs(programs.predict(fresh) - truth(fresh)).mean() < 0.1 * np.abs(truth(fresh)).mean()
    text = " ".join(programs.formulas(["a", "b", "c"])[:6])
    assert "a" in text and "b" in text and "c" in text
