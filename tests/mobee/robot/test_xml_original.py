# SPDX-License-Identifier: Apache-2.0
"""Files of 2010 to 2014, rule by rule; tests/experiments/claims/robot_files compares whole files with a second reading of the program."""

from __future__ import annotations

import re
import warnings
from pathlib import Path

import numpy as np
import pytest

from mobee.check import check_file
from mobee.errors import RobotFileError
from mobee.model.world_file import load_world
from mobee.robot.load import load_robot
from mobee.robot.robot import Robot

HEAD, TAIL = '<ZeroPositionKinematicTree version="1.0" robotName="old">', "</ZeroPositionKinematicTree>"
EYE = '<motor name="eye"><joint z="1" minPos="0" maxPos="50"/></motor>'
PART = (
    '<bodypart name="arm">',
    '<motor name="eye" minPos="-10" maxPos="90" home="20"><joint z="1" minPos="-10" maxPos="90">',
    "INSIDE",
    "</joint></motor>",
    EYE,
    "</bodypart>",
)


def old(folder: Path, inside: str = "", *more: str) -> Path:
    path = folder / "old.xml"
    path.write_text("\n".join([HEAD, *(line.replace("INSIDE", inside) for line in PART), *more, TAIL]), encoding="utf-8")
    return path


def load(path: Path) -> tuple[Robot, list[str]]:
    """The robot, and what its reader warns of, without the name of the file."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        robot = load_robot(path)
    return robot, [str(warning.message).removeprefix(f"{path}:") for warning in caught]


def test_a_motor_that_is_named_again_is_the_one_that_was_defined_before(tmp_path: Path) -> None:
    robot, said = load(old(tmp_path))
    assert (robot.motors, said) == (("eye",), [])
    (motor,) = robot.motor_table
    assert [joint for joint, _, _ in motor.joints] == [0, 1]
    matrix, offset = robot.coupling
    np.testing.assert_allclose(np.rad2deg(matrix @ [np.deg2rad(40)] + offset), [40, 25])


def test_attributes_of_a_second_element_of_a_motor_are_ignored_with_a_warning(tmp_path: Path) -> None:
    robot, said = load(old(tmp_path, EYE.replace('"eye"', '"eye" minPos="-500" maxPos="90"')))
    np.testing.assert_allclose(np.rad2deg(robot.limits), [[-10, 90]])
    assert said == ["4: <motor>: the motor 'eye' is defined in line 3; what is said of it here does not count (minPos). Remove it"]


def test_volumes_and_markers_stand_at_the_start_of_their_link_and_do_not_turn_with_their_joint(tmp_path: Path) -> None:
    link = '<link x="0.3"><sphere radius="0.1" py="0.2"/><marker name="m"/></link><box width="1" height="2" depth="3" px="5"/>'
    robot, _ = load(old(tmp_path, link))
    ball, box = robot.shapes
    np.testing.assert_allclose(ball.position, [0, 0.2, 0])
    np.testing.assert_allclose(robot.markers["m"].position, [0, 0, 0])
    np.testing.assert_allclose(robot.markers["m"].normal, [1, 0, 0])
    assert (ball.link, robot.markers["m"].link, box.link) == (1, 1, 0)


def test_a_box_turns_about_y_first_and_then_to_its_height_axis(tmp_path: Path) -> None:
    robot, _ = load(old(tmp_path, '<link x="1"><box width="1" height="2" depth="3" hz="1" angle="15"/></link>'))
    turned = np.array(
        [[-np.sin(np.deg2rad(15)), 0, np.cos(np.deg2rad(15))], [np.cos(np.deg2rad(15)), 0, np.sin(np.deg2rad(15))], [0, 1, 0]]
    )
    np.testing.assert_allclose(np.abs(robot.shapes[0].rotation.T @ turned), np.eye(3), atol=1e-12)


def test_limits_that_are_left_out_are_those_of_the_program(tmp_path: Path) -> None:
    robot, said = load(old(tmp_path, '<motor name="tail" home="7"><joint x="1" minPos="-30"/></motor>'))
    np.testing.assert_allclose(np.rad2deg(robot.limits[1]), [-1, 1])
    np.testing.assert_allclose(np.rad2deg(robot.joints[1].limits), [-30, 180])
    np.testing.assert_allclose(np.rad2deg(robot.home[1]), 1)
    assert [line.split(": ")[0] for line in said] == ["4", "4", "4"]
    assert 'minPos="-1", maxPos="1"' in said[0]
    assert "home 7 is outside of -1 .. 1; the nearest limit counts" in said[1]


def test_markers_of_one_name_and_without_one_keep_apart(tmp_path: Path) -> None:
    robot, said = load(old(tmp_path, '<marker name="hand" tracer="5"/><link x="1"><marker name="hand" nx="0"/><marker/></link>'))
    assert (list(robot.markers), said) == (["hand", "hand_2", "marker0"], [])
    notes = [finding.what for finding in check_file(tmp_path / "old.xml").findings if finding.check == "older-version"]
    assert "a second marker 'hand' is called 'hand_2'" in notes


def test_constraints_that_the_program_ignored_are_ignored_with_a_warning(tmp_path: Path) -> None:
    rows = (
        '<constraint a="1" q="0" b="1"/><constraintList><constraint a="1" q="0" b="oh"/><constraint a="-1" q="0" b="80"/></constraintList>'
    )
    robot, said = load(old(tmp_path, rows + '<constraintList><constraint a="1 2" q="0" b="1"/></constraintList>'))
    (clause,) = robot.clauses
    np.testing.assert_allclose(clause.a, [[-1]])
    assert [line[:50] for line in said] == [
        "4: <constraint>: <constraint> outside a <constraintList> is ignored"[:50],
        "4: <constraintlist>: <constraintList> without a row that"[:50],
        "4: <constraint>: <constraint> that cannot be read is ignored"[:50],
    ]


def test_an_unknown_tag_is_skipped_but_not_its_children(tmp_path: Path) -> None:
    robot, said = load(old(tmp_path, '<cover><link x="1"><sphere radius="0.1"/></link></cover>'))
    assert len(robot.shapes) == 1
    assert said == ["4: <cover>: unknown tag is ignored, not what stands inside"]


def test_an_attribute_that_stands_twice_counts_once_and_its_line_is_named(tmp_path: Path) -> None:
    robot, said = load(old(tmp_path, '<link x="1"\n radius="0.1"  radius="0.2"/>'))
    assert robot.shapes[0].size == (0.1, 1.0)
    assert said == ["5: the attribute 'radius' stands twice in one tag; the first counts. Remove one of the two"]


def test_letters_that_are_not_in_utf_8_are_read_as_unknown_ones(tmp_path: Path) -> None:
    path = old(tmp_path, "<!-- K\u00f6rper -->")
    path.write_bytes(path.read_text(encoding="utf-8").encode("latin-1"))
    robot, said = load(path)
    assert robot.motors == ("eye",)
    assert said == ["4: a letter is not in UTF-8; it is read as an unknown letter. Save the file as UTF-8"]


def test_a_conflict_that_a_merge_left_is_named(tmp_path: Path) -> None:
    with pytest.raises(RobotFileError, match=r"old.xml:5: .* a merge of git left its conflict .* Keep one side"):
        load_robot(old(tmp_path, '<link x="1"/>\n<<<<<<< HEAD\n<link x="2"/>'))


def test_no_self_collision_holds_on_a_link_and_below_it(tmp_path: Path) -> None:
    joint = '<motor name="{0}" minPos="0" maxPos="9"><joint x="1" minPos="0" maxPos="9" radius="0.01">{1}</joint></motor>'
    chain = "<link z='1' radius='0.1'/>"
    for name in ("c", "b", "a"):
        chain = f'<link x="1" radius="0.01">{joint.format(name, chain)}</link>'
    tested = [
        len(load(old(tmp_path, chain.replace("<link", f"<link{hand}", 1)))[0].solid_pairs) for hand in ("", ' noSelfCollision="true"')
    ]
    assert tested[0] > 0
    assert tested[1] == 0


def test_a_joint_that_stays_at_0_is_fixed_and_moves_nothing(tmp_path: Path) -> None:
    robot, said = load(old(tmp_path, '<joint x="1" minPos="0" maxPos="0" radius="0.02" length="0.3"><link y="1" radius="0.01"/></joint>'))
    assert ([joint.name for joint in robot.joints], said) == (["eye", "eye_1"], [])
    hinge, bone = robot.shapes
    assert (hinge.size, hinge.link, bone.link) == ((0.02, 0.3), 1, 1)
    np.testing.assert_allclose(bone.position, [0, 0.5, 0])


def test_the_grammar_of_2010(tmp_path: Path) -> None:
    path = tmp_path / "katana.xml"
    lines = (
        '<object><cylinder radius="1" height="1" vy="1"/></object>',
        '<branch name="arm"><motor><link x="-0.1" radius="0.03" detail="12">',
        '<joint z="1" length="0.09" minPosition="-90" maxPosition="45"><link z="-0.2"><box x="0.01" z="0.03"/></link></joint>',
        "</link></motor></branch>",
    )
    path.write_text("\n".join([HEAD, *lines, TAIL]))
    robot, said = load(path)
    assert list(robot.parts) == ["arm"]
    np.testing.assert_allclose(np.rad2deg(robot.joints[0].limits), [-90, 45])
    np.testing.assert_allclose(robot.joints[0].point, [-0.1, 0, 0])
    box = next(shape for shape in robot.shapes if shape.kind == "box")
    assert box.size == (0.01, 0.2, 0.03)
    np.testing.assert_allclose(box.position, [-0.1, 0, -0.1])
    np.testing.assert_allclose(np.abs(box.rotation[:, 0]), [1, 0, 0], atol=1e-12)
    assert any("<object> of the world in a robot file is ignored" in line for line in said)


GENERATIONS = {
    "the collision avoidance of 2010": lambda text: text.replace("bodypart", "branch"),
    "VirtualSkin, April to September 2012": lambda text: text.replace(EYE, EYE + '<constraint a="1" q="0" b="1"/>'),
    "VirtualSkin or MoBeE, September to November 2012": lambda text: text.replace(
        EYE, '<constraintList><constraint a="1" q="0" b="-90" negate="true"/></constraintList>'
    ),
    "VirtualSkin or MoBeE, 2011 to 2014": lambda text: text,
}


@pytest.mark.parametrize("generation", GENERATIONS)
def test_a_generation_is_recognised_and_named(tmp_path: Path, generation: str) -> None:
    path = old(tmp_path)
    path.write_text(GENERATIONS[generation](path.read_text()))
    notes = [finding for finding in check_file(path).findings if finding.check == "older-version"]
    assert [note for note in notes if note.what.startswith(f"read as a file of {generation}, for ")]
    assert all(re.fullmatch(rf"{re.escape(str(path))}:\d+", note.where) for note in notes)


WORLD = """<WorldList version="1.0">
<object name="table" pz="-.1" px="-.2"><box width="1" depth=".01" height="1.5"/></object>
<object name="pile" px="1" hy="-1"><sphere radius=".1" px=".5" py="0.2"/><cylinder radius=".1" height=".3" hz="1"/></object>
<object type="target" r="255" g="0" b="51"><sphere radius=".2"/></object>
<object name="table"><sphere radius=".3"/></object>
</WorldList>
"""


def test_a_world_list_is_a_world(tmp_path: Path) -> None:
    path = tmp_path / "world.xml"
    path.write_text(WORLD)
    objects = load_world(path).objects
    assert list(objects) == ["table", "pile_1", "pile_2", "object3", "table_2"]
    np.testing.assert_allclose(objects["table"].position, [-0.2, 0, -0.1])
    np.testing.assert_allclose(objects["pile_1"].position, [0.5, -0.2, 0])  # mirrored, as the program did along -y
    np.testing.assert_allclose(np.abs(objects["pile_2"].rotation[:, 2]), [0, 0, 1], atol=1e-12)
    assert (objects["object3"].role, objects["object3"].color) == ("target", (1.0, 0.0, 0.2, 1.0))
    whats = [finding.what for finding in check_file(path).findings if finding.check == "older-version"]
    assert whats[0].startswith("read as a world of VirtualSkin or MoBeE, 2011 to 2014")
    assert "a second object 'table' is called 'table_2'" in whats


@pytest.mark.parametrize(
    ("old_text", "new_text", "message"),
    [
        ('type="target"', 'type="tagret"', r"world.xml:4: <object> type: unknown type of object 'tagret'. Did you mean 'target'\?"),
        ('radius=".2"', 'radius="-2"', r"world.xml:4: <sphere> radius: -2 is not positive"),
        ('px="1"', 'px="one"', r"world.xml:3: <object> px: 'one' is not a number"),
    ],
)
def test_a_world_list_that_cannot_be_read_is_refused_with_its_line(tmp_path: Path, old_text: str, new_text: str, message: str) -> None:
    path = tmp_path / "world.xml"
    path.write_text(WORLD.replace(old_text, new_text))
    with pytest.raises(RobotFileError, match=message):
        load_world(path)
