# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import sys

import numpy as np
import pytest

import mobee
from mobee.roadmap.ompl import OmplMissing, prm, prm_star, query, rrt_connect
from tests.mobee.planar import planar_arm

pytest.importorskip("ompl")

HOME = np.zeros(3)
BEHIND = np.array([1.6, 0.0, 0.0])
POST = (0.5, 0.5, 0.0)  # m, between the two poses
INSIDE = np.array([np.pi / 4, 0.0, 0.0])  # touches the post


def model() -> mobee.Model:
    world = mobee.World()
    world.add("post", mobee.sphere(0.1), position=POST)
    return mobee.Model(planar_arm(), world)


def between(path: np.ndarray) -> np.ndarray:
    return np.concatenate([one + np.linspace(0, 1, 30)[:, None] * (other - one) for one, other in zip(path, path[1:], strict=False)])


def test_rrt_connect_finds_a_path_around_an_obstacle_and_the_same_for_a_seed():
    known = model()
    assert known.evaluate(between(np.array([HOME, BEHIND]))).count.any()
    path = rrt_connect(known, HOME, BEHIND, seed=1)
    assert np.allclose(path[0], HOME) and np.allclose(path[-1], BEHIND)
    assert not known.evaluate(between(path)).count.any()
    assert np.array_equal(path, rrt_connect(known, HOME, BEHIND, seed=1))


def test_motors_that_may_not_move_stay_where_they_are():
    path = rrt_connect(model(), [0.0, 0.2, 0.0], [[0.4, 0.2, 1.0], [0.3, 0.2, -1.0]], motors=["m0", "m2"])
    assert np.allclose(path[:, 1], 0.2)


@pytest.mark.parametrize("planner", [prm, prm_star])
def test_a_roadmap_of_a_robot_that_always_has_contacts_is_given_up(planner, monkeypatch):
    monkeypatch.setattr("mobee.roadmap.ompl.INVALID", 200)
    world = mobee.World()
    world.add("block", mobee.box(2.0, 2.0, 0.2), position=(0.0, 0.0, 0.0))
    with pytest.raises(mobee.MobeeError, match="200 random poses, one after the other, are not valid"):
        planner(mobee.Model(planar_arm(), world), milestones=5)


def test_without_a_path_the_result_is_none():
    world = mobee.World()
    world.add("wall", mobee.box(0.2, 0.2, 0.2), position=(0.4, 0.35, 0.0))
    world.add("other", mobee.box(0.2, 0.2, 0.2), position=(0.4, -0.35, 0.0))
    goal = [3.0, 0.0, 0.0]
    assert rrt_connect(mobee.Model(planar_arm(), world), HOME, goal, motors=["m0"], extensions=50) is None


@pytest.mark.parametrize("ends", [(HOME, INSIDE), (INSIDE, HOME), (HOME, np.empty((0, 3)))])
def test_from_or_to_a_contact_no_search_begins(ends, monkeypatch):
    monkeypatch.setattr("mobee.roadmap.ompl._space", lambda *_: pytest.fail("OMPL waits 20 s for a goal that is valid"))
    assert rrt_connect(model(), *ends) is None


def test_goals_with_contacts_are_left_out():
    assert np.allclose(rrt_connect(model(), HOME, [INSIDE, BEHIND])[-1], BEHIND)


@pytest.mark.parametrize("planner", [prm, prm_star])
def test_roadmaps_hold_only_poses_and_motions_without_contacts(planner):
    known = model()
    grown = planner(known, motors=["m0", "m1"], milestones=25, seed=2)
    assert len(grown.q) >= 25 and len(grown.edges) > 25 and (grown.edges[:, 0] < grown.edges[:, 1]).all()
    assert not known.evaluate(grown.q).count.any() and (grown.q[:, 2] == 0.0).all()
    for first, second in grown.edges[:10]:
        assert not known.evaluate(between(grown.q[[first, second]])).count.any()
    again = planner(known, motors=["m0", "m1"], milestones=25, seed=2)
    assert np.array_equal(grown.q, again.q) and np.array_equal(grown.edges, again.edges)


def test_a_query_is_over_the_joints_alone():
    path = query(model(), ["m0", "m1"], HOME)(np.zeros(2), np.array([[1.6, 0.0]]))
    assert path.shape[1] == 2 and np.allclose(path[-1], [1.6, 0.0])


@pytest.mark.parametrize(
    ("call", "complaint"),
    [
        (lambda: rrt_connect(model(), [0.0], BEHIND), "all 3 motors of planar"),
        (lambda: rrt_connect(model(), HOME, BEHIND, motors=["m7"]), "m7"),
        (lambda: rrt_connect(model(), HOME, BEHIND, step=0.0), "step"),
        (lambda: rrt_connect(model(), [HOME, HOME], BEHIND), "start has shape"),
        (lambda: prm(model(), milestones=0), "whole number, 1 or more"),
        (lambda: prm(model(), milestones=2.5), "whole number, 1 or more"),
        (lambda: prm(model(), neighbours=2.5), "whole number, 1 or more"),
    ],
)
def test_bad_input_is_refused(call, complaint):
    with pytest.raises(mobee.MobeeError, match=complaint):
        call()


def test_without_ompl_it_says_how_to_get_it(monkeypatch):
    monkeypatch.setitem(sys.modules, "ompl", None)
    with pytest.raises(OmplMissing, match=r'pip install "mobee\[planning\]"'):
        rrt_connect(model(), HOME, BEHIND)
