# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest

from experiments.claims.ch8_reaching.prm_vs_mdp import QUERY_TIMEOUT, SHIFT, TURN, Scene, answer, believed, make_scene, space, world_of
from experiments.kit.learning.arm import whole
from experiments.kit.learning.arm_planners import Straight
from mobee import Model, load_robot


@pytest.fixture(scope="module")
def scene():
    return make_scene(3, 6)


def test_balls_and_joints_have_errors_of_the_stated_size(scene):
    assert np.linalg.norm(scene.shifts, axis=1) == pytest.approx(np.full(4, SHIFT))
    assert np.abs(scene.turns) == pytest.approx(np.full(4, TURN))


def test_straight_motions_reach_the_easy_goals_and_failed_queries_last_as_long_as_the_limit(scene):
    got = answer(scene, Straight(space()), 3)
    assert got.success[~scene.is_hard].all() and (got.seconds[got.success] < QUERY_TIMEOUT).all()
    assert (got.seconds[~got.success] == QUERY_TIMEOUT).all() and got.actions.min() >= 1


def test_without_cables_the_hard_states_are_believed_to_be_sound():
    far = Scene(np.full((1, 3), 5.0), np.zeros((1, 3)), np.zeros(4), np.zeros((0, 4)), np.zeros(0, dtype=int), np.zeros(0, dtype=bool))
    samples = space().samples
    hard = [24, 51, 78]
    assert not believed(far, "true").sound(samples[hard]).any()
    assert believed(far, "no cables").sound(samples).all()


def test_a_miscalibrated_belief_has_the_ball_elsewhere():
    sample = space().samples[40]
    robot = load_robot("icub_2014")
    palm = Model(robot).evaluate(whole(sample)).position("left_palm")
    nowhere = np.zeros((0, 4)), np.zeros(0, dtype=int), np.zeros(0, dtype=bool)
    scene = Scene(palm[None], np.array([[0.0, 0.0, 1.0]]), np.zeros(4), *nowhere)
    assert not believed(scene, "true").sound(sample[None])[0]
    assert believed(scene, "miscalibrated").sound(sample[None])[0]
    assert len(Model(robot, world_of(palm[None])).evaluate(whole(sample)).table)


def test_a_motion_past_a_ball_is_not_sound_though_its_ends_are():
    lattice = space()
    nowhere = np.zeros((0, 4)), np.zeros(0, dtype=int), np.zeros(0, dtype=bool)
    start, end = lattice.samples[36], lattice.samples[44]
    ball = Model(load_robot("icub_2014")).evaluate(whole((start + end) / 2)).position("left_palm")
    belief = believed(Scene(ball[None], np.zeros((1, 3)), np.zeros(4), *nowhere), "no cables")
    assert belief.sound(np.array([start, end])).all()
    assert not belief.sound_motion(start, end)


def test_half_of_the_queries_are_hard_and_none_begins_in_its_goal(scene):
    assert scene.is_hard.sum() == 3
    assert all(space().state_of(q) != goal for q, goal in zip(scene.starts, scene.goals, strict=True))
