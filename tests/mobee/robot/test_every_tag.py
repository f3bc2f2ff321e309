# SPDX-License-Identifier: Apache-2.0
"""One file holds every tag and every attribute of the grammar; each does what thesis 2.3.1 and robots/README.md say."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from mobee.robot.robot import Robot, Shape
from mobee.robot.xml.node import Node, read_xml
from mobee.robot.xml.read import KNOWN, read_robot

FILE = Path(__file__).parents[2] / "fuzz" / "seeds" / "every_tag.xml"


@pytest.fixture(scope="module")
def robot() -> Robot:
    return read_robot(FILE)


def shape(robot: Robot, name: str) -> Shape:
    return next(one for one in robot.shapes if one.name == name)


def test_the_file_holds_every_tag_and_attribute_and_is_read_without_a_warning(recwarn: pytest.WarningsRecorder) -> None:
    used: dict[str, set[str]] = {}

    def collect(node: Node) -> None:
        used.setdefault(node.tag, set()).update(node.attributes)
        for child in node:
            collect(child)

    collect(read_xml(FILE))
    assert used == {tag: set(known) for tag, known in KNOWN.items()}
    read_robot(FILE)
    assert len(recwarn) == 0


def test_parts_and_motors(robot: Robot) -> None:
    assert list(robot.parts) == ["torso", "arm", "other_arm"]
    assert robot.motors[:2] == ("yaw", "lift")
    yaw = robot.motor_table[0]
    np.testing.assert_allclose(np.rad2deg([*yaw.limits, yaw.home, yaw.max_velocity, yaw.max_acceleration]), [-90, 90, 10, 30, 100])
    assert yaw.max_torque == 5
    assert (yaw.zone_ends_at_home, robot.motor_table[1].zone_ends_at_home) == (True, False)


def test_a_motor_drives_each_of_its_joints_from_its_own_interval_onto_theirs(robot: Robot) -> None:
    matrix, offset = robot.coupling
    names = [joint.name for joint in robot.joints]
    for motor, yaw, follower in ((-90, -45, 30), (0, 0, 15), (90, 45, 0)):
        q = np.zeros(len(robot.motors))
        q[0] = np.deg2rad(motor)
        angles = matrix @ q + offset
        np.testing.assert_allclose(np.rad2deg(angles[[names.index("yaw"), names.index("follower")]]), [yaw, follower], atol=1e-12)
    lift = robot.joints[names.index("lift")]
    assert lift.kind == "prismatic"
    np.testing.assert_allclose(lift.limits, [0, 0.3])


def test_links_and_joints_carry_their_skeleton(robot: Robot) -> None:
    solid, field, joint, joint_field = (shape(robot, name) for name in ("pedestal", "pedestal_field", "yaw", "yaw_field"))
    assert (solid.size, field.size, joint.size, joint_field.size) == ((0.05, 0.1), (0.1, 0.1), (0.02, 0.1), (0.05, 0.1))
    assert {robot.shapes.index(one) for one in (solid, field)} <= robot.base_shapes
    assert robot.shapes.index(joint) not in robot.base_shapes
    assert robot.links[:2] == ("pedestal", "chest")
    limb = shape(robot, "chest_link")
    np.testing.assert_allclose(limb.position, [0.1, 0, 0.1])
    assert limb.size == (0.01, 0.2)


def test_volumes_stand_where_their_attributes_say(robot: Robot) -> None:
    start = np.array([0, 0, 0.1])  # of the link in which they stand
    block, ball, wedge = (shape(robot, name) for name in ("block", "ball", "wedge"))
    assert (block.size, block.role, ball.role) == ((0.1, 0.2, 0.3), "solid", "field")
    np.testing.assert_allclose(block.position, [0.1, 0.2, 0.3])
    np.testing.assert_allclose(block.rotation[:, 1], [1, 0, 0], atol=1e-12)  # height along (hx, hy, hz)
    np.testing.assert_allclose(ball.position, start + [0.1, 0.2, 0.3])
    np.testing.assert_allclose(wedge.position, start + [0.3, 0, 0])
    assert wedge.vertices is not None and len(wedge.vertices) == 4
    cylinder, capsule = shape(robot, "can"), shape(robot, "pill")
    assert (cylinder.kind, cylinder.size, cylinder.role) == ("cylinder", (0.1, 0.2), "field")
    assert (capsule.kind, capsule.size, capsule.role) == ("capsule", (0.1, 0.2), "solid")
    np.testing.assert_allclose(capsule.rotation[:, 2], [0, 0, 1], atol=1e-12)
    assert cylinder.part == capsule.part == "torso"


def test_a_marker_has_a_place_a_normal_and_an_orientation(robot: Robot) -> None:
    tip = robot.markers["tip"]
    np.testing.assert_allclose(tip.position, [0.1, 0, 0.1])
    np.testing.assert_allclose(tip.normal, [0, 1, 0])
    np.testing.assert_allclose(tip.rotation, np.eye(3), atol=1e-12)


def test_a_clause_holds_rows_of_its_part_and_negate_flips_one(robot: Robot) -> None:
    (clause,) = robot.clauses
    np.testing.assert_allclose(clause.a[:, :2], [[0, -1.7], [0, -1]])
    np.testing.assert_allclose(np.rad2deg(clause.b), [-90, 45])
    assert clause.part == "arm"


def test_ignored_links_are_never_tested_and_the_reason_is_the_line(robot: Robot) -> None:
    chest, other = robot.links.index("chest"), robot.links.index("other_arm_0")
    line = next(k for k, text in enumerate(FILE.read_text().splitlines(), 1) if 'second="other_arm_0"' in text)
    assert robot.untested[frozenset((chest, other))] == f"the file says so, line {line}"
    links = {frozenset((robot.shapes[i].link, robot.shapes[j].link)) for i, j in (*robot.solid_pairs, *robot.field_pairs)}
    assert frozenset((chest, other)) not in links
    assert frozenset((chest, robot.links.index("other_arm_1"))) in links


def test_everything_is_found_again_in_the_file(robot: Robot) -> None:
    lines = FILE.read_text().splitlines()
    things = {
        ("robot", "every_tag"): "<ZeroPositionKinematicTree",
        ("part", "arm"): '<bodypart name="arm"',
        ("motor", "lift"): '<motor name="lift"',
        ("joint", "yaw"): '<joint name="yaw"',
        ("link", "chest"): 'moves="chest"',
        ("link", "pedestal"): '<link name="pedestal"',
        ("marker", "tip"): '<marker name="tip"',
        ("shape", "ball"): '<sphere name="ball"',
        ("shape", "pedestal_field"): '<link name="pedestal"',
        ("clause", "0"): "<constraintList>",
    }
    for thing, text in things.items():
        file, line = re.fullmatch(r"(.*):(\d+)", robot.where[thing]).groups()
        assert file == str(FILE)
        assert text in lines[int(line) - 1]
    assert {("joint", joint.name) for joint in robot.joints} <= robot.where.keys()
    assert {("shape", one.name) for one in robot.shapes} <= robot.where.keys()
    assert {("link", link) for link in robot.links} <= robot.where.keys()
    assert {("motor", motor) for motor in robot.motors} <= robot.where.keys()
