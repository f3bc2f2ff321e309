# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from mobee.check.interface import Subject
from mobee.check.shapes import identical_shapes
from tests.mobee.check.arm import arm, named

BALLS = '<sphere name="one" radius="0.01" py="{}"/><sphere name="two" radius="{}" py="0.01"/><marker'


@pytest.mark.parametrize(("place", "radius", "found"), [("0.01", "0.01", 1), ("0.02", "0.01", 0), ("0.01", "0.02", 0)])
def test_a_shape_that_is_there_twice_is_found(tmp_path: Path, place: str, radius: str, found: int) -> None:
    findings = named(arm(tmp_path, ("<marker", BALLS.format(place, radius))), "duplicate")
    assert [finding.what for finding in findings] == ["solid 'two' is a duplicate of 'one': same kind, size and position"] * found


def test_a_cylinder_turned_about_itself_or_upside_down_is_the_same(tmp_path: Path) -> None:
    pair = '<cylinder name="one" radius="0.01" height="0.02" hz="1"/><cylinder name="two" radius="0.01" height="0.02" hz="-1"/><marker'
    assert len(named(arm(tmp_path, ("<marker", pair)), "duplicate")) == 1


def test_hulls_with_different_vertices_are_not_duplicates(tmp_path: Path) -> None:
    robot = arm(tmp_path)
    corners = robot.shapes[2].rotation[:, :3] * 0.01
    hull = replace(robot.shapes[2], kind="convex", size=(), vertices=corners)
    other = replace(hull, name="other", vertices=corners * 1.5)
    assert list(identical_shapes(Subject(replace(robot, shapes=(hull, other))))) == []
    assert len(list(identical_shapes(Subject(replace(robot, shapes=(hull, replace(hull, name="other"))))))) == 1


def test_names_that_differ_in_case_only_are_found(tmp_path: Path) -> None:
    (finding,) = named(arm(tmp_path, ("<marker", '<marker name="Tip" px="0.1"/><marker')), "name-case")
    assert finding.what == "marker 'tip' differs from marker 'Tip' in upper and lower case only"


def test_one_name_for_elements_of_different_kinds_is_not_reported(tmp_path: Path) -> None:
    assert named(arm(tmp_path, ("<marker", '<marker name="PAN" px="0.1"/><marker')), "name-case") == []


@pytest.mark.parametrize("name", ["left arm", "Arm", "arm/left", "arm*"])
def test_a_part_that_cannot_stand_in_a_key_is_found(tmp_path: Path, name: str) -> None:
    (finding,) = named(arm(tmp_path, ('name="arm"', f'name="{name}"')), "part-name")
    assert finding.what == f"part name {name!r} is not valid in a key of the bus"
    assert finding.where.endswith(":2")


@pytest.mark.parametrize(("name", "found"), [("the pan", 1), ("a,b", 1), ("Pan-1", 0)])
def test_a_motor_that_no_list_can_name_is_found(tmp_path: Path, name: str, found: int) -> None:
    assert len(named(arm(tmp_path, ('motor name="pan"', f'motor name="{name}"')), "motor-name")) == found
