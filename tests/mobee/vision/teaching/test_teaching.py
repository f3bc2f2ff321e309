# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from experiments.kit.two_robots import BALL, ICUB, KATANA, motors_of, two_robots, watching
from mobee.errors import InvalidValue
from mobee.model.model import Model
from mobee.model.world_file import load_world
from mobee.robot.cameras import cameras_of
from mobee.vision.calibration.observing import Watcher
from mobee.vision.imperfections import CameraErrors, CameraSettings
from mobee.vision.rig import Rig
from mobee.vision.teaching.lessons import Lessons, gaze_postures, seeing_motors, split_by_pose, teacher_postures, watch_teacher
from mobee.vision.teaching.localisers import stereo_places

SETTINGS = CameraSettings(samples=1)
RIG = Rig(two_robots(), cameras_of(two_robots()), SETTINGS.lens)
LOW, HIGH = np.array([-0.45, -0.15, 0.0]), np.array([-0.3, 0.15, 0.15])


@pytest.fixture(scope="module")
def model() -> Model:
    world = load_world("table")
    world.set_role("ball", "ghost")
    return Model(two_robots(), world)


def test_the_katana_holds_the_ball_in_the_volume_and_the_icub_sees_it_without_contact(model):
    postures = teacher_postures(RIG, model, BALL, watching(), (LOW, HIGH), 5, seed=0)
    places = BALL.place(RIG, model.evaluate(postures).transforms)
    assert ((places > LOW) & (places < HIGH)).all() and (model.evaluate(postures).count == 0).all()
    gazes = gaze_postures(RIG, model, BALL, postures[0], 0.3, (320, 240), 6, np.random.default_rng(0))
    assert len(gazes) == 6 and (model.evaluate(gazes).count == 0).all()
    others = np.setdiff1d(np.arange(len(postures[0])), seeing_motors(two_robots()))
    np.testing.assert_array_equal(gazes[:, others], np.repeat(postures[:1, others], 6, axis=0))
    assert np.ptp(gazes[:, seeing_motors(two_robots())], axis=0).min() > 0.01


def test_a_volume_out_of_reach_is_refused(model, monkeypatch):
    monkeypatch.setattr("mobee.vision.teaching.lessons.ROUNDS", 1)
    with pytest.raises(InvalidValue, match="larger volume"):
        teacher_postures(RIG, model, BALL, watching(), (LOW + 3.0, HIGH + 3.0), 1, seed=0)


def test_lessons_hold_what_a_robot_with_perfect_cameras_triangulates(model):
    pytest.importorskip("trimesh")
    errors = CameraErrors.none(two_robots(), list(RIG.cameras))
    watcher = Watcher(RIG, model, SETTINGS, errors, seed=0, has_clutter=False)
    watcher.move(watching(), ICUB, 0.0)
    postures = teacher_postures(RIG, model, BALL, watching(), (LOW, HIGH), 3, seed=0)
    lessons = Lessons.of(two_robots(), watch_teacher(watcher, BALL, KATANA, postures, 3, 0.3, seed=0))
    assert len(lessons) >= 4 and lessons.inputs.shape == (len(lessons), 13)
    assert np.linalg.norm(lessons.reported - lessons.true, axis=1).max() < 0.005  # noise of the Katana's encoders
    found = stereo_places(RIG, np.zeros(len(RIG.names)), lessons.inputs)
    assert np.median(np.linalg.norm(found - lessons.true, axis=1)) < 0.01


@given(st.lists(st.integers(0, 9), min_size=12, max_size=60).filter(lambda poses: len(set(poses)) > 2), st.integers(0, 99))
def test_no_pose_is_both_learned_from_and_held_out(poses, seed):
    given_poses = np.array(poses)
    learned, held_out = split_by_pose(given_poses, 0.2, seed)
    assert sorted([*learned, *held_out]) == list(range(len(poses)))
    assert not set(given_poses[learned]) & set(given_poses[held_out]) and len(held_out) and len(learned)


def test_only_the_joined_robot_has_fields_between_the_two():
    robot = two_robots()
    katana = np.array([shape.name.startswith("katana_") for shape in robot.shapes])
    first, second = katana[robot.field_pairs].T
    assert (first != second).sum() > 100
    assert motors_of(ICUB) == slice(0, 41) and motors_of(KATANA) == slice(41, 47)
