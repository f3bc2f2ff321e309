# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from mobee.robot.load import load_robot
from mobee.robot.pairs_2014 import Element, near_root, neighbours, recorded_neighbours
from mobee.robot.robot import Robot


def bones(count: int, part: str = "arm") -> list[Element]:
    """A chain joint, link, joint, link, ... under a root link."""
    return [Element(-1, "link", "", -1)] + [Element(k, "joint" if k % 2 == 0 else "link", part, -1) for k in range(count)]


def test_a_recorded_descent_ends_where_a_link_and_a_joint_with_shapes_have_been_passed() -> None:
    chain = bones(6)
    assert {frozenset((1, k)) for k in (2, 3)} <= recorded_neighbours(chain, set(range(1, 7)))
    assert frozenset((1, 4)) not in recorded_neighbours(chain, set(range(1, 7)))
    assert frozenset((1, 4)) in recorded_neighbours(chain, {1, 2, 4, 5, 6})  # joint 3 bears nothing, so the descent continues


def test_a_descent_continues_past_elements_of_its_first_kind() -> None:
    chain = bones(6)  # 1 joint, 2 link, 3 joint, 4 link, 5 joint, 6 link
    near = neighbours(chain, set(range(1, 7)))
    assert {frozenset((1, k)) for k in (2, 3)} <= near
    assert frozenset((1, 4)) not in near
    assert frozenset((2, 4)) in near
    assert frozenset((2, 6)) not in near  # joint 5 ended it
    assert frozenset((1, 4)) in neighbours(chain, {1, 2, 4, 5, 6})  # joint 3 bears no solid


def test_elements_on_one_parent_are_neighbours_with_their_children() -> None:
    root = Element(-1, "link", "", -1)
    elements = [root, Element(0, "link", "a", -1), Element(0, "joint", "b", -1), Element(2, "link", "b", -1), Element(3, "joint", "b", -1)]
    near = recorded_neighbours(elements, {1, 2, 3, 4})
    assert {frozenset((1, 2)), frozenset((1, 3))} <= near
    assert frozenset((1, 4)) not in near
    assert {frozenset((1, 2)), frozenset((1, 3)), frozenset((1, 4))} <= neighbours(elements, {1, 2, 3, 4})


def test_the_base_reaches_up_to_the_second_change_between_link_and_joint() -> None:
    tags = ("joint", "link", "joint", "link", "joint", "link")
    assert [near_root((-1, 0, 1, 2, 3, 4), tags, index) for index in range(6)] == [True, True, True, True, False, False]


def linked(robot: Robot, role: str) -> set[frozenset[str]]:
    pairs = robot.solid_pairs if role == "solid" else robot.field_pairs
    return {frozenset((robot.links[robot.shapes[i].link], robot.links[robot.shapes[j].link])) for i, j in pairs}


def test_the_published_robot_spares_neighbours_and_its_hands_but_not_its_arms() -> None:
    robot = load_robot("icub_2014")
    fields, solids = linked(robot, "field"), linked(robot, "solid")
    assert frozenset(("l_shoulder_3", "l_forearm")) not in fields | solids
    assert frozenset(("chest", "l_shoulder_3")) not in fields
    assert not any(pair <= {link for link in robot.links if link.startswith("l_thumb")} for pair in fields | solids)
    for first, second in (("chest", "l_forearm"), ("l_forearm", "r_forearm"), ("head", "r_forearm")):
        assert frozenset((first, second)) in fields
    assert frozenset(("root_link", "chest")) not in fields


def test_the_published_robot_gives_a_reason_for_what_it_spares() -> None:
    robot = load_robot("icub_2014")
    reasons = {frozenset(robot.links[k] for k in pair): reason for pair, reason in robot.untested.items()}
    assert reasons[frozenset(("l_hand", "l_pinky_0_link"))] == "same hand (noSelfCollision)"
    assert reasons[frozenset(("l_shoulder_3", "l_forearm"))] == "neighbours (rule of 2014)"
    assert frozenset(("chest", "l_forearm")) not in reasons
