# SPDX-License-Identifier: Apache-2.0
"""Misspelt attributes and numbers below 0, which would change the robot without an error."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import pytest

from mobee.check import check_file
from mobee.robot.urdf.read import read_urdf
from tests.mobee.robot.urdf_files import tetrahedron, write_stl

URDF = """<robot name="toy">
 <link name="base"/>
 <link name="upper"><inertial><mass value="1"/>
  <inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>
  <visual><geometry><mesh filename="seen.stl" scale="1 1 1"/></geometry></visual></link>
 <link name="lower"><collision><geometry>
  <mesh filename="body.stl" scale="1 1 1"/></geometry></collision></link>
 <joint name="lift" type="revolute"><parent link="base"/><child link="upper"/>
  <axis xyz="0 0 1"/>
  <limit lower="-2" upper="2" velocity="1" effort="10"/></joint>
 <joint name="bend" type="revolute"><parent link="upper"/><child link="lower"/>
  <limit lower="-3" upper="3" velocity="1" effort="10"/>
  <mimic joint="lift" multiplier="1" offset="0"/></joint>
</robot>
"""
LIMIT = '<limit lower="-2" upper="2" velocity="1" effort="10"/>'
MISSPELT = {
    "axis": ('axis xyz="', 'axis xzy="', 9, "xzy", "xyz"),
    "lower": ('lower="-2"', 'lowr="-2"', 10, "lowr", "lower"),
    "upper": ('upper="2"', 'uper="2"', 10, "uper", "upper"),
    "capital letters": ('lower="-2"', 'Lower="-2"', 10, "Lower", "lower"),
    "velocity": ('2" velocity=', '2" velocty=', 10, "velocty", "velocity"),
    "effort": ('effort="10"/></joint>', 'efort="10"/></joint>', 10, "efort", "effort"),
    "limit of a follower": ('lower="-3"', 'lowr="-3"', 12, "lowr", "lower"),
    "multiplier": ("multiplier", "multiplyer", 13, "multiplyer", "multiplier"),
    "offset": ("offset", "ofset", 13, "ofset", "offset"),
    "inertia": ("ixx", "ixxx", 4, "ixxx", "ixx"),
    "mesh": ('body.stl" scale', 'body.stl" scal', 7, "scal", "scale"),
    "mesh that is drawn": ('seen.stl" scale', 'seen.stl" scal', 5, "scal", "scale"),
}
TURNS = f'revolute"><parent link="base"/><child link="upper"/>\n  <axis xyz="0 0 1"/>\n  {LIMIT}'
ENDLESS = 'continuous"><parent link="base"/><child link="upper"/><limit soft_lower="-1" effort="10"/>'
FIXED = (
    '<link name="tip"/><joint name="mount" type="fixed"><parent link="lower"/><child link="tip"/>'
    '<axis xzy="0 0 1"/><limit lowr="1"/></joint></robot>'
)
CORRECT = {
    "nothing unknown": ("", ""),
    "limits of a newer URDF": ('effort="10"/></joint>', 'effort="10" acceleration="3" deceleration="3" jerk="9"/></joint>'),
    "a similar attribute beside the known one": ('effort="10"/></joint>', 'effort="10" max_effort="20" soft_lower="-1"/></joint>'),
    "a namespace": ('effort="10"/></joint>', 'drake:effort="10"/></joint>'),
    "an axis with rpy": ('axis xyz="0 0 1"', 'axis rpy="0 0 0"'),
    "all nine moments": ("<inertia ", '<inertia iyx="0" izx="0" izy="0" '),
    "a name of a mesh": ('<mesh filename="body.stl" scale="1 1 1"', '<mesh filename="body.stl" name="body" convex="true"'),
    "limits of a continuous joint": (TURNS, ENDLESS),
    "a fixed joint": ("</robot>", FIXED),
}
NEGATIVE = {
    "velocity": ("revolute", "velocity is -1, which is below 0, so the default 1.047 rad/s is taken. Write a number above 0"),
    "effort": ("revolute", "effort is -1, which is below 0, so the default 40 N m is taken. Write a number above 0"),
    "velocity of a slide": ("prismatic", "velocity is -1, which is below 0, so the default 1.047 m/s is taken. Write a number above 0"),
    "effort of a slide": ("prismatic", "effort is -1, which is below 0, so the default 40 N is taken. Write a number above 0"),
}


def edited(folder: Path, old: str, new: str) -> Path:
    """The robot above, with `new` in the first place of `old`."""
    assert old in URDF
    for mesh in ("seen.stl", "body.stl"):
        write_stl(folder / mesh, tetrahedron())
    path = folder / "toy.urdf"
    path.write_text(URDF.replace(old, new, 1))
    return path


@pytest.mark.parametrize("name", MISSPELT)
def test_check_names_a_misspelt_attribute_with_its_line_and_the_right_name(tmp_path: Path, name: str) -> None:
    old, new, line, given, right = MISSPELT[name]
    path = edited(tmp_path, old, new)
    what = f"unknown attribute '{given}' is ignored. Did you mean '{right}'? Valid: "
    found = [one for one in check_file(path).findings if what in f"{one.what}. {one.remedy}"]
    assert [(one.severity, one.where) for one in found] == [("warning", f"{path}:{line}")]


def test_a_limit_is_named_that_is_misspelt_so_that_the_joint_is_fixed(tmp_path: Path) -> None:
    path = edited(tmp_path, LIMIT, '<limit lowr="-2" upper="0"/>')
    path.write_text(path.read_text().replace('<mimic joint="lift" multiplier="1" offset="0"/>', ""))
    with pytest.warns(UserWarning) as caught:
        assert read_urdf(path).motors == ("bend",)
    assert any(f"{path}:10: <limit>: unknown attribute 'lowr'" in str(one.message) for one in caught)


@pytest.mark.parametrize("name", CORRECT)
def test_attributes_of_other_programs_are_silent(tmp_path: Path, name: str) -> None:
    old, new = CORRECT[name]
    path = edited(tmp_path, old, new)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert read_urdf(path).motors == ("lift",)


@pytest.mark.parametrize("name", NEGATIVE)
def test_check_names_a_velocity_or_effort_below_0_and_the_default(tmp_path: Path, name: str) -> None:
    kind, what = NEGATIVE[name]
    old = 'velocity="1"' if "velocity" in name else 'effort="10"'
    path = edited(tmp_path, old, old.split("=")[0] + '="-1"')
    path.write_text(path.read_text().replace("revolute", kind))
    found = [one for one in check_file(path).findings if what in f"{one.what}. {one.remedy}"]
    assert [(one.severity, one.where) for one in found] == [("warning", f"{path}:10")]
    with pytest.warns(UserWarning, match="below 0"):
        motor = read_urdf(path).motor_table[0]
    assert (motor.max_velocity, motor.max_torque) == ((np.deg2rad(60), 10) if "velocity" in name else (1, 40))


@pytest.mark.parametrize("number", ["0", "-0.0"])
def test_a_velocity_and_an_effort_of_0_are_unknown_without_a_warning(tmp_path: Path, number: str) -> None:
    path = edited(tmp_path, 'velocity="1" effort="10"', f'velocity="{number}" effort="{number}"')
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert read_urdf(path).motor_table[0].max_torque == 40
