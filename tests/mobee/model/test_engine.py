# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import mobee
from mobee.arrays import Array
from mobee.errors import UnknownName
from mobee.model.engine import MAX_HANDS, NO_HANDS, Hand, Hands
from mobee.model.model import engine_of
from mobee.robot.robot import Motor, Robot
from tests.mobee.model.random_scenes import loaded, plain_contacts, posed, random_robot, random_world

ROUNDING = 1e-9  # m: what overlaps by less may count or not


def who_reaches(rng: np.random.Generator, robot: Robot) -> Hands:
    """No hand to two hands, each with the fields of some link before it."""
    found = []
    for _ in range(rng.integers(MAX_HANDS + 1)):
        link = fields = int(rng.integers(len(robot.links)))
        while fields > 0 and rng.random() < 0.5:
            fields = robot.joints[fields - 1].parent
        found.append(Hand(link, fields))
    return tuple(found)


def assert_same(robot: Robot, q: Array, world: mobee.World, reaching: Hands = NO_HANDS) -> int:
    """The contacts of the engine are those of all tested pairs, one by one; returns how many."""
    table, _ = engine_of(robot).contacts(q[None], world.snapshot, reaching)
    numbers, reals = plain_contacts(robot, q, world, reaching)
    found = {tuple(row): real for row, real in zip(table.numbers[:, 1:4].tolist(), table.reals, strict=True)}
    expected = {tuple(row): real for row, real in zip(numbers.tolist(), reals, strict=True)}
    assert len(found) == len(table)
    assert [pair for pair in expected.keys() ^ found.keys() if (expected.get(pair, found.get(pair)))[0] > ROUNDING] == []
    both = sorted(expected.keys() & found.keys())
    if both:
        depths = np.array([(found[pair][0], expected[pair][0]) for pair in both])
        assert depths[:, 0] == pytest.approx(depths[:, 1], abs=1e-7)
    return len(both)


@settings(max_examples=100)
@given(st.integers(0, 2**32), st.integers(0, 8), st.integers(0, 12), st.sampled_from([0, 1, 5, 40]))
def test_contacts_are_those_of_all_tested_pairs_one_by_one(seed: int, joints: int, shapes: int, objects: int) -> None:
    rng = np.random.default_rng(seed)
    robot = random_robot(rng, joints, shapes)
    world = random_world(rng, robot, objects)
    for q in posed(rng, robot, 3):
        assert_same(robot, q, world, who_reaches(rng, robot))


@pytest.mark.parametrize("name", ["icub", "icub_2014", "katana"])
@pytest.mark.parametrize("objects", [0, 1, 99, 100, 101, 500])
def test_contacts_of_shipped_robots_agree_with_the_reference(name: str, objects: int, rng: np.random.Generator) -> None:
    robot = loaded(name)
    world = random_world(rng, robot, objects, scale=0.6)
    touched = sum(assert_same(robot, q, world, who_reaches(rng, robot)) for q in posed(rng, robot, 3))
    assert touched > 0 or objects < 99


def test_contacts_stand_in_order(rng: np.random.Generator) -> None:
    robot = loaded("icub")
    table, _ = engine_of(robot).contacts(posed(rng, robot, 20), random_world(rng, robot, 150, 0.6).snapshot, NO_HANDS)
    rows = table.numbers[:, :4].tolist()
    assert len(rows) > 500
    assert rows == sorted(rows)
    assert set(table.pose.tolist()) == set(range(20))


def test_a_batch_is_its_poses_one_by_one_to_the_last_bit(rng: np.random.Generator) -> None:
    robot = loaded("icub")
    model = mobee.Model(robot, random_world(rng, robot, 150, 0.6))
    q = posed(rng, robot, 3, 5)
    batch = model.evaluate(q)
    for index, one in enumerate(q.reshape(15, -1)):
        pose, mine = model.evaluate(one), batch.table.pose == index
        assert np.array_equal(pose.transforms, batch.transforms.reshape(15, *pose.transforms.shape)[index])
        assert np.array_equal(pose.projection, batch.projection.reshape(15, -1)[index])
        assert np.array_equal(pose.projection_of_part, batch.projection_of_part.reshape(15, -1)[index])
        assert np.array_equal(pose.table.numbers[:, 1:], batch.table.numbers[mine, 1:])
        assert np.array_equal(pose.table.reals, batch.table.reals[mine])


def test_many_contacts_fit(rng: np.random.Generator) -> None:
    """Several times what one pass through the room holds."""
    robot, world = loaded("katana"), mobee.World()
    for index in range(50):
        world.add(f"around{index}", mobee.sphere(10.0))
    numbers, _ = plain_contacts(robot, robot.home, world)
    assert len(numbers) >= 50 * 4
    q = np.tile(robot.home, (100, 1))
    table, torque = engine_of(robot).contacts(q, world.snapshot, NO_HANDS)
    assert np.array_equal(table.numbers[:, 0], np.repeat(np.arange(100), len(numbers)))
    assert np.array_equal(table.numbers[:, 1:4], np.tile(numbers, (100, 1)))
    assert np.array_equal(torque, np.tile(torque[0], (100, 1)))


@pytest.mark.parametrize("shape", [(0,), (3, 0)])
def test_no_poses_have_no_contacts(shape: tuple[int, ...]) -> None:
    robot = loaded("katana")
    pose = mobee.Model(robot).evaluate(np.empty((*shape, len(robot.motors))))
    assert len(pose.table) == 0
    assert pose.projection.shape == (*shape, len(robot.motors))
    assert pose.transforms.shape == (*shape, len(robot.links), 4, 4)
    assert pose.count.shape == shape


def test_a_robot_may_consist_of_a_motor_that_moves_nothing(rng: np.random.Generator) -> None:
    nothing = random_robot(rng, joints=0, shapes=0)
    model = mobee.Model(nothing, random_world(rng, nothing, 5))
    pose = model.evaluate(np.zeros(len(nothing.motors)))
    assert isinstance(nothing.motor_table[0], Motor)
    assert len(pose.table) == 0
    assert np.array_equal(pose.transforms, np.eye(4)[None])
    assert np.array_equal(pose.projection, np.zeros(len(nothing.motors)))


@pytest.mark.parametrize("given", ["strided", "transposed", "float32", "integers", "list"])
def test_poses_may_come_as_any_array_of_numbers(given: str) -> None:
    robot = loaded("katana")
    q = np.zeros((4, len(robot.motors)))
    q[:, 1] = [0, 1, 0, 1]
    same = {
        "strided": np.repeat(q, 2, axis=0)[::2],
        "transposed": np.ascontiguousarray(q.T).T,
        "float32": q.astype(np.float32),
        "integers": q.astype(int),
        "list": q.tolist(),
    }[given]
    model = mobee.Model(robot)
    assert np.array_equal(model.evaluate(same).transforms, model.evaluate(q).transforms)


def test_a_world_may_shrink_grow_and_change_between_evaluations(rng: np.random.Generator) -> None:
    """The room that evaluations leave to the next ones never mixes two worlds."""
    robot = loaded("katana")
    model, q = mobee.Model(robot, random_world(rng, robot, 3, 0.4)), posed(rng, robot)
    for turn in range(60):
        world = model.world
        names = list(world.objects)
        draw = rng.random()
        if draw < 0.5 or not names:
            kind = (mobee.sphere(0.1), mobee.box(0.2, 0.2, 0.2), mobee.capsule(0.05, 0.3))[rng.integers(3)]
            world.add(f"new{turn}", kind, position=rng.uniform(-0.4, 0.4, 3))
        elif draw < 0.7:
            world.remove(names[rng.integers(len(names))])
        elif draw < 0.85:
            world.attach(
                names[rng.integers(len(names))], robot.links[rng.integers(len(robot.links))], (rng.uniform(-0.2, 0.2, 3), np.eye(3))
            )
        elif world.objects[names[0]].link is not None:
            world.follow(model.evaluate(robot.home))
            world.detach(names[0])
        fresh, kept = mobee.Model(robot, world).evaluate(q), model.evaluate(q)
        assert np.array_equal(fresh.table.numbers, kept.table.numbers)
        assert np.array_equal(fresh.table.reals, kept.table.reals)
        assert_same(robot, q, world)


def test_evaluations_leave_one_room_behind_not_one_each(rng: np.random.Generator) -> None:
    robot = loaded("katana")
    engine = engine_of(robot)
    small, large = random_world(rng, robot, 2).snapshot, random_world(rng, robot, 300).snapshot
    for snapshot in (small, large) * 20:
        engine.contacts(robot.home[None].copy(), snapshot, NO_HANDS)
    assert len(engine._rooms) == 1


def test_an_object_attached_to_an_unknown_link_is_refused() -> None:
    world = mobee.World()
    world.add("ball", mobee.sphere(0.1))
    world.attach("ball", "tail", ((0.0, 0.0, 0.0), np.eye(3)))
    with pytest.raises(UnknownName, match="tail"):
        engine_of(loaded("katana")).contacts(loaded("katana").home[None], world.snapshot, NO_HANDS)
