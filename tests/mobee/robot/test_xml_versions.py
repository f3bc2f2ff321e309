# SPDX-License-Identifier: Apache-2.0
"""Versions of the grammar: what MoBeE 0.1 wrote keeps its meaning, and what could mean two things says so."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import pytest

from mobee.errors import RobotFileError
from mobee.model.world_file import load_world
from mobee.robot.load import load_robot
from mobee.robot.robot import Robot
from mobee.robot.xml.write import write_upgraded
from tests.mobee.robot.same_robot import assert_same_robot

ARM = """<ZeroPositionKinematicTree{version} robotName="pointer">
 <bodypart name="arm">
  <link z="0.1" radius="0.03">
   <box name="plate" width="0.1" height="0.2" depth="0.3" hx="1" hz="1" angle="20"/>
   <motor name="pan" minPos="-90" maxPos="90">
    <joint z="1" minPos="-90" maxPos="90" {of_0_1}>
     <link x="-3" y="4" length="0.2">
      <bodypart name="arm"><marker name="tip"/></bodypart>
      <mass value="2" px="0.1"/>
      <convex points="0 0 0 .1 0 0 0 .1 0 0 0 .1" hz="1"/>
     </link>
    </joint>
   </motor>
  </link>
 </bodypart>
</ZeroPositionKinematicTree>
"""
PLAIN = "\n".join(line for line in ARM.splitlines() if "mass" not in line and "convex" not in line).replace('name="plate" ', "")


def read(folder: Path, text: str) -> tuple[Robot, list[str]]:
    path = folder / "arm.xml"
    path.write_text(text)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        robot = load_robot(path)
    return robot, [str(warning.message).removeprefix(f"{path}:") for warning in caught]


@pytest.mark.parametrize("version", [' version="1.0"', "", ' version="0.1"'])
def test_a_file_of_0_1_keeps_its_meaning_and_each_rule_is_warned_of_with_its_line(tmp_path: Path, version: str) -> None:
    robot, said = read(tmp_path, ARM.format(version=version, of_0_1='name="pan"'))
    plate, hull = (next(shape for shape in robot.shapes if shape.kind == kind) for kind in ("box", "convex"))
    np.testing.assert_allclose(plate.position, [0, 0, 0.1], atol=1e-15)
    tilt = np.deg2rad(90)  # y goes to (1, 0, 1) the shortest way, about (1, 0, -1)
    c, s, a = np.cos(tilt), np.sin(tilt), np.array([1.0, 0.0, -1.0]) / np.sqrt(2)
    cross = np.array([[0, -a[2], a[1]], [a[2], 0, -a[0]], [-a[1], a[0], 0]])
    shortest = c * np.eye(3) + s * cross + (1 - c) * np.outer(a, a)
    height = np.array([1.0, 0.0, 1.0]) / np.sqrt(2)
    np.testing.assert_allclose(shortest @ [0, 1, 0], height, atol=1e-12)
    c, s = np.cos(np.deg2rad(20)), np.sin(np.deg2rad(20))
    cross = np.array([[0, -height[2], height[1]], [height[2], 0, -height[0]], [-height[1], height[0], 0]])
    turned = (c * np.eye(3) + s * cross + (1 - c) * np.outer(height, height)) @ shortest
    np.testing.assert_allclose(plate.rotation, turned, atol=1e-12)
    end = np.array([-0.12, 0.16, 0.1])
    np.testing.assert_allclose(robot.markers["tip"].position, end, atol=1e-15)
    np.testing.assert_allclose(robot.markers["tip"].normal, [0, 0, 1])
    np.testing.assert_allclose(robot.bodies[0].centre, end + [0.1, 0, 0], atol=1e-15)
    corners = hull.vertices @ hull.rotation.T + hull.position
    np.testing.assert_allclose(corners, end + [[0, 0, 0], [0.1, 0, 0], [0, 0, 0.1], [0, -0.1, 0]], atol=1e-12)
    assert [line.split(". ")[0] for line in said] == [
        "4: <box>: read as MoBeE 0.1 read it: what stands inside a <link> stands at its end (4 times, first here)",
        "4: <box>: read as MoBeE 0.1 read it: a <box> turns the shortest way to its height axis (here)",
        "8: <marker>: read as MoBeE 0.1 read it: a marker without a normal has +z (here)",
        "10: <convex>: read as MoBeE 0.1 read it: a <convex> turns the shortest way to its height axis (here)",
    ]
    assert all("`mobee convert OLD.xml NEW.xml` writes today's form" in line for line in said)


def test_a_converted_file_is_the_same_robot_and_causes_no_warning(tmp_path: Path) -> None:
    robot, _ = read(tmp_path, ARM.format(version="", of_0_1='name="pan"'))
    assert write_upgraded(tmp_path / "arm.xml", tmp_path / "new.xml")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        again = load_robot(tmp_path / "new.xml")
    assert_same_robot(robot, again)
    assert write_upgraded(tmp_path / "new.xml", tmp_path / "newer.xml") is None


def test_a_file_that_could_mean_both_is_read_as_the_old_programs_did_and_says_so(tmp_path: Path) -> None:
    robot, said = read(tmp_path, PLAIN.format(version=' version="1.0"', of_0_1=""))
    np.testing.assert_allclose(robot.markers["tip"].position, [0, 0, 0.1])
    assert said[0].startswith(
        "4: <box>: read as the programs of 2010 to 2014 read it. MoBeE 0.1 differed: what stands inside a <link> stands at its end"
    )
    assert 'Write version="2.0" into the root if this is meant, version="0.1" if not' in said[0]
    assert len(said) == 3
    _, said = read(tmp_path, PLAIN.format(version=' version="2.0"', of_0_1=""))
    assert said == []


def test_a_file_in_which_nothing_differs_is_read_in_silence(tmp_path: Path) -> None:
    lines = [line for line in PLAIN.splitlines() if "box" not in line and "marker" not in line]
    _, said = read(tmp_path, "\n".join(lines).format(version=' version="1.0"', of_0_1='name="pan"'))
    assert said == []


@pytest.mark.parametrize("version", ["2.0", "0.1"])
def test_faults_of_form_are_errors_in_newer_files(tmp_path: Path, version: str) -> None:
    text = ARM.format(version=f' version="{version}"', of_0_1='name="pan" z="2"')
    with pytest.raises(RobotFileError, match=r"arm.xml:6: not well-formed XML: duplicate attribute .* Remove one of the two"):
        read(tmp_path, text)


def test_a_world_without_a_version_turns_its_boxes_by_the_smallest_rotation_with_a_warning(tmp_path: Path) -> None:
    path = tmp_path / "world.xml"
    box = '<box name="b" width="1" height="2" depth="3" hz="1" hy="1"/>'
    path.write_text(f"<World>{box}</World>")
    with pytest.warns(UserWarning, match=r"world.xml:1: <box>: read as MoBeE 0.1 read it: a <box> turns the shortest way"):
        shortest = load_world(path).objects["b"].rotation
    np.testing.assert_allclose(shortest @ [1, 0, 0], [1, 0, 0], atol=1e-12)
    path.write_text(f'<World version="2.0">{box}</World>')
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        turned = load_world(path).objects["b"].rotation
    np.testing.assert_allclose(turned @ [0, 1, 0], np.array([0, 1, 1]) / np.sqrt(2), atol=1e-12)
    np.testing.assert_allclose(np.abs(turned @ [0, 0, 1]), [1, 0, 0], atol=1e-12)  # x went to z about y before
