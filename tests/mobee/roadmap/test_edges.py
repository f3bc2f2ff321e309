# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest

import mobee
from mobee.errors import InvalidValue, UnknownName
from mobee.roadmap.edges import between, check_edges, checked, points

STEP = 0.005


@pytest.fixture(scope="module")
def model() -> mobee.Model:
    return mobee.Model(mobee.load_robot("icub"), mobee.load_world("table"))


@pytest.fixture(scope="module")
def poses(model: mobee.Model) -> np.ndarray:
    """Postures of an arm about one in front of the body, many of which touch the table or the body between them."""
    robot, rng = model.robot, np.random.default_rng(3)
    q = np.repeat(robot.home[None], 30, axis=0)
    arm = robot.part("right_arm").slice
    low, high = robot.limits[arm].T
    q[:, arm] = np.clip(robot.home[arm] + 0.3 * rng.normal(size=(30, arm.stop - arm.start)) * (high - low), low, high)
    return q


EDGES = np.array([(a, b) for a in range(30) for b in range(a + 1, a + 6) if b < 30])


def test_an_edge_is_free_where_no_pose_along_it_touches(model: mobee.Model, poses: np.ndarray) -> None:
    found = checked(model, poses, EDGES, STEP, "right_palm")
    wanted = []
    for a, b in EDGES:
        count = int(np.ceil(np.linalg.norm(np.diff(points(model, poses[[a, b]], "right_palm")[0], axis=0)) / STEP))
        share = np.arange(count + 1)[:, None] / count
        wanted.append(not np.any(model.evaluate(poses[a] + (poses[b] - poses[a]) * share).count))
    np.testing.assert_array_equal(found.free, wanted)
    assert 10 < found.free.sum() < len(EDGES) - 10
    every = 30 + between(model, poses, EDGES, STEP, "right_palm").sum()
    assert found.poses < 0.8 * every  # no pose after the first that touches


def test_edges_between_free_poses_may_touch(model: mobee.Model, poses: np.ndarray) -> None:
    stands = np.asarray(model.evaluate(poses).count) == 0
    free = check_edges(model, poses, EDGES, STEP)
    assert not free[~stands[EDGES].all(axis=1)].any()
    assert (stands[EDGES].all(axis=1) & ~free).any()


def test_the_shape_that_moves_farthest_says_how_fine_the_steps_are(model: mobee.Model, poses: np.ndarray) -> None:
    fine = between(model, poses, EDGES, STEP)
    palm = between(model, poses, EDGES, STEP, "right_palm")
    assert (fine >= palm - 1).all() and fine.sum() > palm.sum()
    q = poses[0] + np.linspace(0.0, 1.0, fine[0] + 2)[:, None] * (poses[EDGES[0, 1]] - poses[0])
    assert np.linalg.norm(np.diff(points(model, q), axis=1), axis=2).max() < 1.6 * STEP  # on an arc, by a middle at that


def test_an_edge_is_as_free_in_the_world_as_it_is_now(model: mobee.Model, poses: np.ndarray) -> None:
    world = mobee.World()
    other = mobee.Model(model.robot, world)
    free = check_edges(other, poses, EDGES, STEP)
    edge = int(np.flatnonzero(free)[0])
    middle = other.evaluate(poses[EDGES[edge]].mean(axis=0)).position("right_palm")
    world.add("block", mobee.sphere(0.01), position=middle)
    after = check_edges(other, poses, EDGES, STEP)
    assert not after[edge] and not (after & ~free).any()
    world.set_role("block", "target")
    np.testing.assert_array_equal(check_edges(other, poses, EDGES, STEP), after)
    np.testing.assert_array_equal(check_edges(other, poses, EDGES, STEP, reaching="right_palm"), free)


def test_no_edges_are_no_trouble(model: mobee.Model, poses: np.ndarray) -> None:
    assert check_edges(model, poses, np.empty((0, 2), dtype=np.intp)).shape == (0,)
    assert check_edges(model, poses[:1], np.zeros((1, 2), dtype=np.intp)).shape == (1,)


def test_invalid_steps_and_markers_are_refused(model: mobee.Model, poses: np.ndarray) -> None:
    with pytest.raises(InvalidValue, match=r"step 0.0 m"):
        check_edges(model, poses, EDGES, 0.0)
    with pytest.raises(UnknownName, match="right_palm"):
        check_edges(model, poses, EDGES, marker="right_plam")


def test_any_number_of_threads_finds_the_same(model: mobee.Model, poses: np.ndarray) -> None:
    one = checked(model, poses, EDGES, STEP)
    for threads in (2, 3, 64):
        many = checked(model, poses, EDGES, STEP, threads=threads)
        np.testing.assert_array_equal(many.free, one.free)
        assert many.poses == one.poses
    assert check_edges(model, poses, np.empty((0, 2), dtype=np.intp), threads=2).shape == (0,)


@pytest.mark.parametrize("threads", [0, -1, 1.0, True, 10**6, None])
def test_invalid_numbers_of_threads_are_refused(model: mobee.Model, poses: np.ndarray, threads: object) -> None:
    with pytest.raises(InvalidValue, match="whole number from 1"):
        check_edges(model, poses, EDGES, STEP, threads=threads)
