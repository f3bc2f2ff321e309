# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from mobee.errors import RobotFileError
from mobee.robot.load import load_robot
from mobee.robot.robot import Robot
from mobee.robot.urdf.write import write_urdf

URDF = """<robot name="arm">
 <link name="base"/>
 <link name="upper">INERTIAL</link>
 <link name="tool"><inertial><origin xyz="0 0 0.1"/><mass value="TOOL"/></inertial></link>
 <joint name="lift" type="revolute"><parent link="base"/><child link="upper"/><origin xyz="0 0 1" rpy="0 0 1.5707963267948966"/>
  <axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="10" velocity="1"/></joint>
 <joint name="mount" type="fixed"><parent link="upper"/><child link="tool"/><origin xyz="1 0 0"/></joint>
</robot>"""
OWN = '<inertial><origin xyz="0.5 0 0"/><mass value="MASS"/>INERTIA</inertial>'
INERTIA = '<inertia ixx="1" ixy="0" ixz="0" iyy="2" iyz="0" izz="2.5"/>'


def robot(folder: Path, inertial: str, tool: float = 2.0) -> Robot:
    path = folder / "arm.urdf"
    path.write_text(URDF.replace("INERTIAL", inertial).replace("TOOL", str(tool)))
    return load_robot(path)


def own(mass: str, inertia: str = "") -> str:
    return OWN.replace("MASS", mass).replace("INERTIA", inertia)


def test_the_mass_of_a_fixed_link_is_added_to_its_parent(tmp_path: Path) -> None:
    (body,) = robot(tmp_path, own("2")).bodies
    assert (body.link, body.mass) == (1, 4.0)
    np.testing.assert_allclose(body.centre, [0, 0.75, 1.05], atol=1e-12)


def test_moments_of_inertia_are_turned_into_the_root_frame(tmp_path: Path) -> None:
    turned = np.diag([2.0, 1.0, 2.5])  # by the joint's yaw
    (body,) = robot(tmp_path, own("2", INERTIA)).bodies
    assert body.inertia is None  # the mass of the tool is not known
    (body,) = robot(tmp_path, own("2", INERTIA), tool=0.0).bodies
    np.testing.assert_allclose(body.inertia, turned, atol=1e-12)


def test_a_negative_mass_is_refused_and_zero_counts_as_no_mass(tmp_path: Path) -> None:
    (body,) = robot(tmp_path, own("0", INERTIA)).bodies
    assert body.mass == 2.0  # the tool's
    with pytest.raises(RobotFileError, match=r"arm.urdf:3: <mass> value: -2 is negative. Write the mass in kilograms"):
        robot(tmp_path, own("-2"))


def test_an_unknown_inertia_is_written_as_assumed_and_read_back_as_unknown(tmp_path: Path) -> None:
    written = write_urdf(robot(tmp_path, own("2")), tmp_path / "out.urdf")
    text = written.read_text()
    assert '<mobee assumed="true" />' in text and "ball of water" in text and "It holds no masses" not in text
    (body,) = load_robot(written).bodies
    assert body.inertia is None and body.mass == 4.0


def test_a_robot_without_masses_says_so_in_its_urdf(tmp_path: Path) -> None:
    assert "It holds no masses." in write_urdf(load_robot("katana"), tmp_path / "k.urdf").read_text()
