# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import gc
from typing import Any

import numpy as np
import pytest

import mobee
from mobee.arrays import Array
from mobee.errors import InvalidValue
from mobee.model.pose import Pose
from mobee.robot.robot import Robot
from tests.mobee.model.random_scenes import Rng, loaded, posed, random_robot, random_world

STEPS = (1e-5, 1e-4, 1e-3, 1e-2, 0.1, 1.0)  # rad or m a motor


def same(one: Pose, other: Pose) -> bool:
    """To the last bit."""
    columns = (one.table.numbers, other.table.numbers), (one.table.reals, other.table.reals), (one.projection, other.projection)
    return all(np.array_equal(a, b) for a, b in columns)


def walk(rng: Rng, robot: Robot, step: float, count: int, motors: float = 1.0) -> Array:
    """Steps of one size by a share of the motors, within the limits."""
    low, high = robot.limits.T
    moving = rng.random(len(low)) < motors
    path = [rng.uniform(low, high)]
    for _ in range(count - 1):
        path.append(np.clip(path[-1] + step * moving * rng.normal(size=len(low)), low, high))
    return np.array(path)


@pytest.mark.parametrize("step", STEPS)
@pytest.mark.parametrize("name", ["icub", "katana"])
def test_a_track_of_a_shipped_robot_has_the_contacts_of_single_poses(name: str, step: float, rng: Rng) -> None:
    model = mobee.Model(loaded(name), random_world(rng, loaded(name), 60))
    track = model.track()
    for motors in (1.0, 0.1):
        for q in walk(rng, model.robot, step, 60, motors):
            assert same(track.evaluate(q), model.evaluate(q))


@pytest.mark.parametrize("seed", range(30))
def test_a_track_of_any_robot_in_any_world_has_the_contacts_of_single_poses(seed: int) -> None:
    rng = np.random.default_rng(seed)
    robot = random_robot(rng, int(rng.integers(0, 12)), int(rng.integers(0, 25)))
    model = mobee.Model(robot, random_world(rng, robot, int(rng.choice([0, 3, 150]))))
    track = model.track(skin=float(rng.choice([1e-3, 0.02, 0.5])))
    for step in rng.permutation(STEPS):
        for q in walk(rng, robot, step, 30, float(rng.choice([1.0, 0.3]))):
            assert same(track.evaluate(q), model.evaluate(q))


@pytest.mark.parametrize("seed", range(12))
def test_edits_of_the_world_take_effect_at_once(seed: int) -> None:
    rng = np.random.default_rng(seed)
    robot = random_robot(rng, 8, 16)
    model = mobee.Model(robot, random_world(rng, robot, 12))
    track = model.track()
    for index, q in enumerate(walk(rng, robot, float(rng.choice(STEPS[:4])), 300)):
        if index > 0 and rng.random() < 0.2:
            edit(rng, model, index)
        pose = track.evaluate(q)
        model.world.follow(pose)
        assert same(pose, model.evaluate(q))


def edit(rng: Rng, model: mobee.Model, index: int) -> None:
    """One of the edits that the world knows."""
    world, draw = model.world, int(rng.integers(6))
    free = [name for name, thing in world.objects.items() if thing.link is None]
    carried = [name for name in world.objects if name not in free]
    if draw == 0 or len(free) < 3:
        world.add(f"new{index}", mobee.sphere(0.1), position=rng.uniform(-1.0, 1.0, 3))
    elif draw == 1:
        world.remove(free[0])
    elif draw == 2:
        world.move(free[1], position=world.objects[free[1]].position + rng.normal(size=3) * rng.choice([1e-3, 0.3]))
    elif draw == 3:
        world.set_role(free[2], ("obstacle", "target", "ghost")[rng.integers(3)])
    elif draw == 4 and carried:
        world.detach(carried[0])
    else:
        world.attach(free[0], model.robot.links[rng.integers(len(model.robot.links))])


def test_the_link_that_reaches_spares_its_target_from_the_moment_it_is_named(rng: Rng) -> None:
    model = mobee.Model(loaded("icub"))
    track, q = model.track(), model.robot.home
    model.world.add("ball", mobee.sphere(0.05), position=model.evaluate(q).position("left_palm"), role="target")
    touched = []
    for marker in (None, "left_palm", None):
        for _ in range(4):
            pose = track.evaluate(q, marker)
            assert same(pose, model.evaluate(q, reaching=marker))
        touched.append(any("ball" in (c.first, c.second) and c.first_link == model.robot.marker("left_palm").link for c in pose.contacts))
    assert touched == [True, False, True]


def test_a_path_given_at_once_is_its_poses_one_by_one(rng: Rng) -> None:
    model = mobee.Model(loaded("icub"), mobee.load_world("table"))
    path = walk(rng, model.robot, 1e-3, 200)
    assert same(model.track().evaluate(path), model.evaluate(path))
    track, one = model.track(), model.evaluate(path)
    alone = [track.evaluate(q) for q in path]
    assert np.array_equal(np.concatenate([pose.table.reals for pose in alone]), one.table.reals)
    assert np.array_equal(np.array([pose.projection for pose in alone]), one.projection)


def test_two_tracks_of_one_model_do_not_disturb_each_other(rng: Rng) -> None:
    model = mobee.Model(loaded("icub"), mobee.load_world("table"))
    tracks = model.track(), model.track(skin=0.05)
    paths = walk(rng, model.robot, 1e-3, 50), walk(rng, model.robot, 1e-3, 50)
    for both in zip(*paths, strict=True):
        for track, q in zip(tracks, both, strict=True):
            assert same(track.evaluate(q), model.evaluate(q))


def test_the_contacts_of_a_pose_stay_when_the_robot_moves_on(rng: Rng) -> None:
    model = mobee.Model(loaded("icub"), mobee.load_world("table"))
    track, path = model.track(), walk(rng, model.robot, 1e-2, 30)
    kept = [track.evaluate(q) for q in path]
    gc.collect()
    assert all(same(pose, model.evaluate(q)) for pose, q in zip(kept, path, strict=True))


def test_a_tracked_pose_knows_its_links_and_the_forces_of_its_parts(rng: Rng) -> None:
    model = mobee.Model(loaded("icub"), mobee.load_world("table"))
    track = model.track()
    for q in posed(rng, model.robot, 5):
        tracked, single = track.evaluate(q), model.evaluate(q)
        assert np.array_equal(tracked.transforms, single.transforms)
        assert np.array_equal(tracked.projection_of_part, single.projection_of_part)


def test_objects_are_attached_where_a_tracked_pose_that_the_world_follows_has_brought_the_link() -> None:
    model = mobee.Model(loaded("icub"))
    model.world.add("tool", mobee.sphere(0.03))
    moved = model.robot.home + 0.1
    model.world.follow(model.track().evaluate(moved))
    link = model.robot.links[model.robot.marker("left_palm").link]
    model.world.attach("tool", link)
    assert model.evaluate(moved).objects["tool"].position == pytest.approx(np.zeros(3), abs=1e-12)


@pytest.mark.parametrize("skin", [0.0, -0.01, float("nan"), float("inf"), "2 cm", None])
def test_a_skin_that_is_no_distance_is_refused(skin: Any) -> None:
    with pytest.raises(InvalidValue, match="skin"):
        mobee.Model(loaded("katana")).track(skin=skin)


def test_an_invalid_pose_is_refused_and_the_track_continues(rng: Rng) -> None:
    model = mobee.Model(loaded("katana"))
    track, q = model.track(), model.robot.home
    track.evaluate(q)
    with pytest.raises(InvalidValue, match="finite"):
        track.evaluate(np.full(len(q), np.nan))
    assert same(track.evaluate(q + 1e-3), model.evaluate(q + 1e-3))


def test_the_reference_engine_is_tracked_without_a_list() -> None:
    model = mobee.Model(loaded("katana"), engine="fcl")
    q = model.robot.home
    assert same(model.track().evaluate(q), model.evaluate(q))
