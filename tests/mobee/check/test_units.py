# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mobee.check import check_robot
from mobee.check.size_and_mass import half_extent
from mobee.robot.robot import Shape
from tests.mobee.check.arm import arm, named


def test_a_robot_in_millimetres_is_found_by_its_farthest_element(tmp_path: Path) -> None:
    findings = check_robot(arm(tmp_path, ('name="fore" x="-0.2"', 'name="fore" x="-200"')))
    (finding,) = [finding for finding in findings if finding.check == "unit"]
    assert finding.what.startswith("the robot is 200 m across; the farthest out is")
    assert "divide by 1000" in finding.remedy


def test_a_robot_smaller_than_a_nail_is_found(tmp_path: Path) -> None:
    robot = arm(tmp_path)
    tiny = [replace(s, size=tuple(1e-3 * x for x in s.size), position=1e-3 * s.position) for s in robot.shapes]
    joints = tuple(replace(joint, point=1e-3 * joint.point) for joint in robot.joints)
    markers = {name: replace(marker, position=1e-3 * marker.position) for name, marker in robot.markers.items()}
    findings = check_robot(replace(robot, shapes=tuple(tiny), joints=joints, markers=markers))
    assert [finding.what for finding in findings if finding.check == "unit"] == ["the whole robot is 0.52 mm across"]


def test_limits_that_are_all_a_few_degrees_are_radians(tmp_path: Path) -> None:
    robot = arm(
        tmp_path,
        ('minPos="-90" maxPos="90"', 'minPos="-1.6" maxPos="1.6"'),
        ('"10" maxPos="100" home="30"', '"0.2" maxPos="1.7" home="0.5"'),
    )
    (finding,) = named(robot, "unit")
    assert finding.what == "motor 'pan' turns -1.6 to 1.6 deg; so do bend"


def test_a_single_quarter_turn_in_radians_is_found(tmp_path: Path) -> None:
    (finding,) = named(arm(tmp_path, ('minPos="-90" maxPos="90"', 'minPos="-1.5708" maxPos="1.5708"')), "unit")
    assert finding.what == "motor 'pan' turns -1.571 to 1.571 deg"


@pytest.mark.parametrize("limit", ["3", "5.5"])
def test_one_narrow_motor_among_others_is_none(tmp_path: Path, limit: str) -> None:
    assert named(arm(tmp_path, ('minPos="-90" maxPos="90"', f'minPos="-{limit}" maxPos="{limit}"')), "unit") == []


def test_extents_hold_every_kind_of_shape() -> None:
    lying = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])  # z along x
    shape = Shape("s", 0, "capsule", (0.1, 0.4), np.zeros(3), lying, "solid", "arm")
    np.testing.assert_allclose(half_extent(shape), [0.3, 0.1, 0.1])
    np.testing.assert_allclose(half_extent(replace(shape, kind="sphere", size=(0.2,))), [0.2, 0.2, 0.2])
    np.testing.assert_allclose(half_extent(replace(shape, kind="box", size=(0.2, 0.4, 0.6))), [0.3, 0.1, 0.2])
    hull = replace(shape, kind="convex", size=(), vertices=np.array([[0.0, 0.0, 1.0], [0.0, 0.5, 0.0]]))
    np.testing.assert_allclose(half_extent(hull), [1.0, 0.0, 0.5])
