# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest

import mobee
from mobee.model import fcl_engine as rules
from mobee.model.engine import Hand
from mobee.model.world import World
from mobee.robot.robot import Joint, Motor, Part, Robot, Shape

BASE, UPPER, LOWER, OBJECT = 0, 1, 2, 3


@pytest.fixture
def robot() -> Robot:
    """A base with a solid, an upper link with a field and a lower one with a solid; neighbours are not tested."""
    joints = tuple(Joint(f"j{i}", i, "revolute", np.eye(3)[2], np.zeros(3), np.array([-1.0, 1.0])) for i in range(2))
    roles = ("solid", "field", "solid")
    shapes = tuple(Shape(f"s{i}", i, "sphere", (0.1,), np.zeros(3), np.eye(3), role, "arm") for i, role in enumerate(roles))
    return Robot(
        name="three",
        links=("base", "upper", "lower"),
        joints=joints,
        motor_table=tuple(Motor(f"m{i}", "arm", np.array([-1.0, 1.0]), 0.0, ((i, 1.0, 0.0),)) for i in range(2)),
        parts={"arm": Part("arm", ("m0", "m1"), 0)},
        markers={},
        shapes=shapes,
        clauses=(),
        field_pairs=np.empty((0, 2), dtype=np.intp),
        solid_pairs=np.array([[BASE, LOWER]]),
        base_shapes=frozenset({BASE}),
        untested={frozenset({0, 1}): "neighbours", frozenset({1, 2}): "neighbours"},
    )


def pairs_of(robot: Robot, world: World, reaching: Hand | None = None) -> set[tuple[int, int, str]]:
    columns = rules.tested_pairs(robot, world.snapshot, () if reaching is None else (reaching,))
    return {(int(a), int(b), ("solid", "field")[kind]) for a, b, kind in zip(*columns, strict=True)}


def world_with(role: str, link: str | None = None) -> World:
    world = mobee.World()
    world.add("thing", mobee.sphere(0.1), role=role)
    if link is not None:
        world.attach("thing", link, (np.zeros(3), np.eye(3)))
    return world


def test_without_a_world_the_robots_own_pairs_are_tested(robot):
    assert pairs_of(robot, mobee.World()) == {(BASE, LOWER, "solid")}


def test_an_obstacle_meets_all_but_the_base(robot):
    assert pairs_of(robot, world_with("obstacle"), Hand(2, 2)) == {
        (BASE, LOWER, "solid"),
        (UPPER, OBJECT, "field"),
        (LOWER, OBJECT, "solid"),
    }


def test_a_target_spares_the_hand_that_reaches(robot):
    assert pairs_of(robot, world_with("target"), Hand(2, 2)) == {(BASE, LOWER, "solid"), (UPPER, OBJECT, "field")}
    assert (LOWER, OBJECT, "solid") in pairs_of(robot, world_with("target"))
    assert pairs_of(robot, world_with("target"), Hand(2, 1)) == {(BASE, LOWER, "solid")}
    assert pairs_of(robot, world_with("target"), Hand(1, 1)) == {(BASE, LOWER, "solid")}


@pytest.mark.parametrize("link", [None, "lower"])
def test_a_ghost_meets_nothing(robot, link):
    assert pairs_of(robot, world_with("ghost", link)) == {(BASE, LOWER, "solid")}


def test_a_carried_object_meets_the_links_that_its_link_meets(robot):
    assert pairs_of(robot, world_with("obstacle", "lower")) == {(BASE, LOWER, "solid"), (BASE, OBJECT, "solid")}


def test_a_carried_object_meets_free_objects_but_ignores_targets_during_a_reach(robot):
    world = world_with("obstacle", "lower")
    world.add("ball", mobee.sphere(0.1), role="target")
    assert (OBJECT, OBJECT + 1, "solid") in pairs_of(robot, world)
    assert (OBJECT, OBJECT + 1, "solid") not in pairs_of(robot, world, Hand(LOWER, LOWER))


def test_two_carried_objects_meet_where_their_links_do(robot):
    world = world_with("obstacle", "lower")
    world.add("hat", mobee.sphere(0.1))
    for link, meet in (("base", True), ("upper", False), ("lower", False)):
        world.attach("hat", link, (np.zeros(3), np.eye(3)))
        assert ((OBJECT, OBJECT + 1, "solid") in pairs_of(robot, world)) is meet
