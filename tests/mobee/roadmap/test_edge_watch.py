# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest

import mobee
from mobee.roadmap.edges import EdgeWatch, apart, check_edges

STEP = 0.005
COUNT = 40


@pytest.fixture
def model(icub: mobee.Robot) -> mobee.Model:
    return mobee.Model(icub, mobee.load_world("table"))


@pytest.fixture(scope="module")
def poses(icub: mobee.Robot) -> np.ndarray:
    rng = np.random.default_rng(4)
    q = np.repeat(icub.home[None], COUNT, axis=0)
    arm = icub.part("right_arm").slice
    low, high = icub.limits[arm].T
    q[:, arm] = np.clip(icub.home[arm] + 0.2 * rng.normal(size=(COUNT, len(low))) * (high - low), low, high)
    return q


EDGES = np.array([(a, b) for a in range(COUNT) for b in range(a + 1, min(a + 5, COUNT))])


@pytest.mark.parametrize("shape", [mobee.box(0.1, 0.05, 0.2), mobee.capsule(0.02, 0.2)], ids=lambda one: one.kind)
def test_after_a_change_the_edges_are_as_if_all_were_checked(model: mobee.Model, poses: np.ndarray, shape: mobee.Geometry) -> None:
    watch = EdgeWatch(model, poses, EDGES, STEP)
    rng = np.random.default_rng(1)
    palm = model.evaluate(poses).position("right_palm")
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    model.world.add("block", shape, position=palm[3], rotation=turn)
    again = []
    for k in range(3):
        again.append(len(watch.update()))
        np.testing.assert_array_equal(watch.free, check_edges(model, poses, EDGES, STEP))
        model.world.move("block", position=palm[13 * k] + 0.02 * rng.normal(size=3))
    model.world.remove("block")
    watch.update()
    np.testing.assert_array_equal(watch.free, check_edges(model, poses, EDGES, STEP))
    assert 0 < min(again) and max(again) < len(EDGES)


def test_without_a_change_nothing_is_checked_again(model: mobee.Model, poses: np.ndarray) -> None:
    watch = EdgeWatch(model, poses, EDGES, STEP)
    assert len(watch.update()) == 0
    model.world.add("far", mobee.sphere(0.1), position=(5.0, 0.0, 0.0))
    model.world.add("ghost", mobee.sphere(3.0), role="ghost")
    assert len(watch.update()) == 0


def test_a_ghost_made_solid_counts_and_so_does_a_carried_object(model: mobee.Model, poses: np.ndarray) -> None:
    palm = model.evaluate(poses).position("right_palm")
    model.world.move("ball", position=palm[0])
    model.world.set_role("ball", "ghost")
    watch = EdgeWatch(model, poses, EDGES, STEP)
    for change in (
        lambda: model.world.set_role("ball", "target"),
        lambda: model.attach("ball", "r_hand", poses[0]),
    ):
        change()
        assert len(watch.update()) > 0
        np.testing.assert_array_equal(watch.free, check_edges(model, poses, EDGES, STEP))


def test_what_a_carried_object_may_touch_is_checked_again(model: mobee.Model, poses: np.ndarray) -> None:
    """A pole reaches from the hand to where no shape of the robot is near; a block appears at its end."""
    pose = model.evaluate(poses[0])
    palm, along = pose.position("right_palm"), pose.rotation("right_palm")[:, 2]
    model.world.add("pole", mobee.capsule(0.01, 0.8), position=palm + 0.45 * along, rotation=pose.rotation("right_palm"))
    model.attach("pole", "r_hand", poses[0])
    watch = EdgeWatch(model, poses, EDGES, STEP)
    model.world.add("block", mobee.sphere(0.05), position=palm + 0.8 * along)
    watch.update()
    np.testing.assert_array_equal(watch.free, check_edges(model, poses, EDGES, STEP))


def test_the_distance_from_a_volume_is_exact() -> None:
    world = mobee.World()
    for name, shape in (
        ("a", mobee.box(0.2, 0.4, 0.6)),
        ("b", mobee.cylinder(0.1, 0.4)),
        ("c", mobee.capsule(0.1, 0.4)),
        ("d", mobee.sphere(0.3)),
    ):
        world.add(name, shape, position=(0.1, 0.2, 0.3), rotation=[[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    places = np.array([0.1, 0.2, 0.3]) + np.array([[0.0, 0.0, 0.0], [0.3, 0.0, 0.0], [0.0, 0.3, 0.0], [0.0, 0.0, 0.5], [0.3, 0.0, 0.6]])
    wanted = {
        "a": [0.0, 0.1, 0.2, 0.2, np.hypot(0.1, 0.3)],
        "b": [0.0, 0.2, 0.2, 0.3, np.hypot(0.2, 0.4)],
        "c": [0.0, 0.2, 0.2, 0.2, np.hypot(0.3, 0.4) - 0.1],
        "d": [0.0, 0.0, 0.0, 0.2, np.hypot(0.3, 0.6) - 0.3],
    }
    for name, distances in wanted.items():
        np.testing.assert_allclose(apart(places, world.objects[name]), distances, atol=1e-12)
