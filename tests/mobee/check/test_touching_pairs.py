# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from pathlib import Path

import pytest

from mobee.check.touching import touching_pairs
from mobee.robot.load import load_robot
from tests.mobee.check.arm import arm
from tests.mobee.check.test_touching import HUB, LINK, PALM, STONE
from tests.mobee.check.test_urdf import URDF

BALL = ("<marker", '<sphere name="ball" radius="0.5"/><marker')


def test_solids_that_touch_in_every_pose_and_those_that_touch_at_home(tmp_path: Path) -> None:
    (always,) = touching_pairs(arm(tmp_path, LINK, HUB, BALL), poses=300)
    assert (always.first, always.second, always.reason, always.share) == ("base", "forearm", "Always", 1.0)
    (home,) = touching_pairs(arm(tmp_path, LINK, PALM, ('home="30"', 'home="10"'), STONE), poses=300)
    assert (home.first, home.second, home.reason) == ("base", "forearm", "Default")
    assert home.depth > 0.0 and 0.0 <= home.share < 0.5


def test_nothing_touches_in_a_good_arm_and_fields_do_not_count(tmp_path: Path) -> None:
    assert touching_pairs(arm(tmp_path), poses=300) == ()
    assert touching_pairs(load_robot("icub"), poses=50) == ()


def test_touching_pairs_are_repeatable(tmp_path: Path) -> None:
    robot = arm(tmp_path, LINK, HUB, BALL)
    assert touching_pairs(robot, poses=50) == touching_pairs(robot, poses=50)


@pytest.mark.parametrize("poses", [1, 499, 501])
def test_any_number_of_poses_is_tried(tmp_path: Path, poses: int) -> None:
    (pair,) = touching_pairs(arm(tmp_path, LINK, HUB, BALL), poses=poses)
    assert pair.share == 1.0


def test_links_are_those_of_the_urdf_also_behind_fixed_joints(tmp_path: Path) -> None:
    path = tmp_path / "toy.urdf"
    plate = """<link name="plate">
  <collision><geometry><sphere radius="0.12"/></geometry></collision></link>
 <joint name="bolt" type="fixed"><parent link="base"/><child link="plate"/></joint>"""
    path.write_text(URDF.format(plate))
    (pair,) = touching_pairs(load_robot(path), poses=100)
    assert (pair.first, pair.second) == ("fore", "plate")
