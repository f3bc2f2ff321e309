# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from mobee.errors import RobotFileError
from mobee.robot.load import load_robot
from mobee.robot.robot import Robot
from tests.mobee.robot.robot_files import robot_file

LINES = (
    '<bodypart name="arm">',
    ' <link name="base" z="0.5"><mass value="5" pz="0.5"/>',
    '  <motor name="pan" minPos="-90" maxPos="90"><joint z="1" moves="upper">',
    "   MASSES",
    '   <link x="0.2">',
    "    <link>MORE</link>",
    "   </link>",
    "  </joint></motor>",
    " </link>",
    "</bodypart>",
)


def robot(folder: Path, masses: str, more: str = "") -> Robot:
    return load_robot(robot_file(folder, *(line.replace("MASSES", masses).replace("MORE", more) for line in LINES)))


def test_a_mass_stands_relative_to_the_point_reached(tmp_path: Path) -> None:
    base, upper = robot(tmp_path, "", '<mass value="2" px="0.1" pz="-0.1" inertia="1 0.1 0.2 2 0.3 2.5"/>').bodies
    assert (base.link, base.mass, base.inertia) == (0, 5.0, None)
    np.testing.assert_allclose(base.centre, [0, 0, 0.5])
    assert (upper.link, upper.mass) == (1, 2.0)
    np.testing.assert_allclose(upper.centre, [0.3, 0, 0.4])
    np.testing.assert_allclose(upper.inertia, [[1, 0.1, 0.2], [0.1, 2, 0.3], [0.2, 0.3, 2.5]])


def test_masses_of_one_link_add_up(tmp_path: Path) -> None:
    _, upper = robot(tmp_path, '<mass value="1"/>', '<mass value="3"/>').bodies
    assert upper.mass == 4.0
    np.testing.assert_allclose(upper.centre, [0.15, 0, 0.5])


@pytest.mark.parametrize(
    ("tag", "message"),
    [
        ('<mass value="0"/>', r":5: <mass> value: 0 is not positive. Write a value above 0, in kilograms"),
        ('<mass value="-2"/>', r":5: <mass> value: -2 is not positive"),
        ('<mass value="1e7"/>', r":5: <mass> value: 1e\+07 is too large. Masses are in kilograms"),
        ('<mass valeu="1"/>', r":5: <mass> value: is required and missing. Did you misspell it as 'valeu'\?"),
        ('<mass value="1" inertia="1 2"/>', r":5: <mass> inertia: has 2 numbers. Write 6 numbers"),
    ],
)
@pytest.mark.filterwarnings("ignore:.*unknown attribute")
def test_a_mass_that_cannot_be_is_refused_with_line_and_remedy(tmp_path: Path, tag: str, message: str) -> None:
    with pytest.raises(RobotFileError, match=message):
        robot(tmp_path, tag)


def test_masses_of_a_robot_in_another_file_stand_where_it_stands(tmp_path: Path) -> None:
    robot(tmp_path, "", '<mass value="2" px="0.1" inertia="1 0 0 2 0 2.5"/>')
    (tmp_path / "toy.xml").rename(tmp_path / "arm.xml")
    pair = load_robot(
        robot_file(
            tmp_path,
            '<robot name="one" file="arm.xml"/>',
            '<robot name="two" file="arm.xml" px="1" angle="90"/>',
        )
    )
    base, one, two = pair.bodies  # both bases are one link
    assert base.mass == 10.0
    np.testing.assert_allclose(base.centre, [0.5, 0, 0.5])
    assert (pair.links[one.link], pair.links[two.link]) == ("one_upper", "two_upper")
    np.testing.assert_allclose(two.centre, [1.0, 0.3, 0.5], atol=1e-12)
    np.testing.assert_allclose(two.inertia, np.diag([2, 1, 2.5]), atol=1e-12)
