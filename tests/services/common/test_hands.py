# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from mobee.errors import InvalidValue, UnknownName
from mobee.robot.load import load_robot
from services.common.hands import end_markers, hand_for, hand_of, moved_markers, part_of, require_apart
from tests.services.robots import ARM, chain, seer

ICUB = load_robot("icub")


@pytest.mark.parametrize(("part", "marker"), [("left_arm", "left_palm"), ("right_arm", "right_palm"), ("torso", "right_palm")])
def test_a_part_of_the_icub_reaches_with_its_palm(part: str, marker: str) -> None:
    assert hand_of(ICUB, part) == marker


@pytest.mark.parametrize(
    ("marker", "part"), [("left_palm", "left_arm"), ("right_elbow", "right_arm"), ("head", "head"), ("left_eye", "head")]
)
def test_the_part_of_a_marker_is_that_with_most_motors_before_it(marker: str, part: str) -> None:
    assert part_of(ICUB, marker) == part


@pytest.mark.parametrize(("y", "marker"), [(-0.3, "left_palm"), (0.3, "right_palm"), (0.0, "right_palm")])
def test_the_palm_on_the_side_of_the_target_is_taken(y: float, marker: str) -> None:
    assert hand_for(ICUB, np.array([-0.3, y, 0.1])) == marker


@pytest.mark.parametrize(
    ("part", "link"), [("right_arm", "r_hand"), ("right_arm", "r_hand_thumb_3"), ("right_arm", "r_forearm"), ("torso", "l_hand")]
)
def test_an_object_that_the_reaching_part_carries_is_refused(part: str, link: str) -> None:
    with pytest.raises(InvalidValue, match=f"'ball' is attached to the link '{link}', which {part} moves .* detach it"):
        require_apart(ICUB, part, "right_palm", "ball", link)


@pytest.mark.parametrize(("part", "link"), [("right_arm", "l_hand"), ("right_arm", "chest"), ("torso", "root_link"), ("torso", "")])
def test_an_object_that_another_part_carries_is_not_refused(part: str, link: str) -> None:
    require_apart(ICUB, part, "right_palm", "ball", link)


def test_another_robot_reaches_with_the_end_of_its_chain(tmp_path: Path) -> None:
    (tmp_path / "arm.urdf").write_text(chain(3))
    (tmp_path / "arm.xml").write_text(ARM)
    for file, marker, part in (("arm.urdf", "link_2", "all"), ("arm.xml", "tip", "arm")):
        robot = load_robot(tmp_path / file)
        assert end_markers(robot) == (marker,)
        assert hand_for(robot, np.zeros(3)) == hand_of(robot, part) == marker
        assert part_of(robot, marker) == part


def test_a_hand_is_taken_and_not_a_wheel(tmp_path: Path) -> None:
    wheel = "<link name='wheel'/><joint name='roll' type='continuous'><parent link='base'/><child link='wheel'/><axis xyz='0 1 0'/></joint>"
    (tmp_path / "mobile.urdf").write_text(chain(3).replace("<link name='link_0'>", f"{wheel}<link name='link_0'>"))
    robot = load_robot(tmp_path / "mobile.urdf")
    assert list(robot.markers) == ["wheel", "link_2"]
    assert end_markers(robot) == ("link_2", "wheel")
    assert hand_of(robot, "all") == hand_for(robot, None) == hand_for(robot, np.array([0.0, 0.0, -1.0])) == "link_2"


def test_the_message_for_a_robot_without_markers_says_how_to_add_one(tmp_path: Path) -> None:
    (tmp_path / "arm.xml").write_text(ARM.replace('<marker name="tip" px="-0.2" nx="-1"/>', ""))
    robot = load_robot(tmp_path / "arm.xml")
    for attempt in (lambda: hand_for(robot, np.zeros(3)), lambda: hand_of(robot, "arm")):
        with pytest.raises(InvalidValue, match='Add <marker name="tip"/>'):
            attempt()


def test_a_marker_that_nothing_moves_is_no_hand(tmp_path: Path) -> None:
    still = '<bodypart name="torso"><marker name="stand" nx="1"/>'
    (tmp_path / "seer.xml").write_text(seer().replace('<bodypart name="torso">', still))
    robot = load_robot(tmp_path / "seer.xml")
    assert "stand" in robot.markers and "stand" not in moved_markers(robot, "torso")
    with pytest.raises(InvalidValue, match="no motor moves the marker 'stand'. Valid: left_eye, right_eye"):
        part_of(robot, "stand")
    with pytest.raises(UnknownName):
        part_of(robot, "palm")
