# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from dataclasses import replace

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
        pieces = max(int(np.ceil(np.abs(poses[b] - poses[a]).max())), 1)  # of at most 1 rad
        ends = poses[a] + (poses[b] - poses[a]) * np.linspace(0.0, 1.0, pieces + 1)[:, None]
        chords = np.linalg.norm(np.diff(points(model, ends, "right_palm")[0], axis=0), axis=1)
        count = int(np.ceil(pieces * chords.max() / STEP))
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


def test_an_edge_with_a_large_turn_is_checked_along_its_arc(model: mobee.Model) -> None:
    robot = model.robot
    ends = np.repeat(robot.home[None], 2, axis=0)
    yaw = robot.motor_index("torso_yaw")
    low, high = robot.limits[yaw]
    ends[:, yaw] = low, high
    count = int(between(model, ends, np.array([[0, 1]]), STEP, "right_palm")[0])
    q = ends[0] + np.linspace(0.0, 1.0, count + 2)[:, None] * (ends[1] - ends[0])
    assert high - low > 1.5
    assert (
        np.linalg.norm(np.diff(points(model, q, "right_palm")[0], axis=0), axis=1).max() < 1.05 * STEP
    )  # a chord of 1 rad is 4 % shorter than its arc


def test_an_obstacle_is_found_in_a_whole_turn() -> None:
    robot = mobee.load_robot("icub")
    yaw = robot.motor_index("torso_yaw")
    motors = tuple(
        replace(motor, limits=np.array([-np.pi, np.pi])) if number == yaw else motor for number, motor in enumerate(robot.motor_table)
    )
    turning, world = replace(robot, motor_table=motors), mobee.World()
    ends = np.repeat(robot.home[None], 2, axis=0)
    ends[:, yaw] = -3.141, 3.141  # nearly the same place
    middle = ends[0] + 0.37 * (ends[1] - ends[0])
    world.add("post", mobee.sphere(0.01), position=mobee.Model(turning).evaluate(middle).position("right_palm"))
    model = mobee.Model(replace(turning, solid_pairs=turning.solid_pairs[:0]), world)  # without self-contacts
    assert not np.any(model.evaluate(ends).table.kind == 0)
    assert not check_edges(model, ends, np.array([[0, 1]]), 0.001, "right_palm")[0]
