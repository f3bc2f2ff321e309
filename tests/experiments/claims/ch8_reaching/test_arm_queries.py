from __future__ import annotations

import numpy as np
import pytest

from experiments.claims.ch8_reaching.arm_queries import LIMIT, SHIFT, TURN, Scene, answer, believed, make_scene, space, world_of
from experiments.kit.learning.arm import whole
from experiments.kit.learning.arm_planners import Straight
from mobee import Model, load_robot


@pytest.fixture(scope="module")
def scene():
    return make_scene(3, 6)


def test_a_scene_follows_from_its_seed(scene):
    again = make_scene(3, 6)
    for name in ("balls", "shifts", "turns", "starts", "goals", "is_hard"):
        assert np.array_equal(getattr(scene, name), getattr(again, name))
    assert not np.array_equal(make_scene(4, 2).balls, scene.balls)


def test_half_the_queries_are_hard_and_none_is_there_already(scene):
    assert scene.is_hard.sum() == 3
    assert all(space().state_of(q) != goal for q, goal in zip(scene.starts, scene.goals, strict=True))


def test_the_planners_are_as_mistaken_as_they_should_be(scene):
    assert np.linalg.norm(scene.shifts, axis=1) == pytest.approx(np.full(4, SHIFT))
    assert np.abs(scene.turns) == pytest.approx(np.full(4, TURN))


def test_going_straight_reaches_the_easy_goals_and_takes_its_time_for_the_hard_ones(scene):
    got = answer(scene, Straight(space()), 3)
    assert got.success[~scene.is_hard].all() and (got.seconds[got.success] < LIMIT).all()
    assert (got.seconds[~got.success] == LIMIT).all() and got.actions.min() >= 1


def test_hidden_cables_make_poses_sound_that_are_not():
    far = Scene(np.full((1, 3), 5.0), np.zeros((1, 3)), np.zeros(4), np.zeros((0, 4)), np.zeros(0, dtype=int), np.zeros(0, dtype=bool))
    samples = space().samples
    hard = [24, 51, 78]
    assert not believed(far, "true").sound(samples[hard]).any()
    assert believed(far, "no cables").sound(samples).all()


def test_a_ball_is_believed_where_calibration_puts_it():
    sample = space().samples[40]
    robot = load_robot("icub_2014")
    palm = Model(robot).evaluate(whole(sample)).position("left_palm")
    nowhere = np.zeros((0, 4)), np.zeros(0, dtype=int), np.zeros(0, dtype=bool)
    scene = Scene(palm[None], np.array([[0.0, 0.0, 1.0]]), np.zeros(4), *nowhere)
    assert not believed(scene, "true").sound(sample[None])[0]
    assert believed(scene, "miscalibrated").sound(sample[None])[0]
    assert len(Model(robot, world_of(palm[None])).evaluate(whole(sample)).table)


def test_a_motion_is_sound_only_if_all_of_it_is():
    lattice = space()
    nowhere = np.zeros((0, 4)), np.zeros(0, dtype=int), np.zeros(0, dtype=bool)
    start, end = lattice.samples[36], lattice.samples[44]
    ball = Model(load_robot("icub_2014")).evaluate(whole((start + end) / 2)).position("left_palm")
    belief = believed(Scene(ball[None], np.zeros((1, 3)), np.zeros(4), *nowhere), "no cables")
    assert belief.sound(np.array([start, end])).all()
    assert not belief.is_sound_motion(start, end)
