# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import pytest

from mobee.errors import RobotFileError
from mobee.robot.robot import Robot
from mobee.robot.urdf.read import read_urdf
from tests.mobee.robot.urdf_files import ARM, urdf_file

LINKS = "".join(f'<link name="l{k}"/>' for k in range(4))
WIDE = '<limit lower="-3" upper="3"/>'


def fingers(folder: Path, *inside: str, kind: str = "revolute") -> Robot:
    """Joints j0, j1, ... side by side; the content of each is in line 3, 4, ..."""
    joints = [
        f'<joint name="j{k}" type="{kind}"><parent link="l0"/><child link="l{k + 1}"/>{text}</joint>' for k, text in enumerate(inside)
    ]
    links = "".join(f'<link name="l{k}"/>' for k in range(len(inside) + 1))
    return read_urdf(urdf_file(folder, links, *joints))


def test_a_joint_is_a_motor_with_its_limits_and_home_at_zero(tmp_path: Path) -> None:
    robot = read_urdf(urdf_file(tmp_path, *ARM))
    assert robot.motors == ("shoulder", "elbow")
    assert robot.limits.tolist() == [[-1, 2], [-2, 2]]
    assert robot.home.tolist() == [0, 0]
    assert robot.parts["all"].motors == robot.motors
    assert (robot.motor_table[0].max_velocity, robot.motor_table[0].max_torque) == (3, 4)


def test_home_is_zero_or_the_nearest_place_outside_the_limit_zones(tmp_path: Path) -> None:
    width = np.deg2rad(10.0)
    inside, beyond = fingers(tmp_path, '<limit lower="-1" upper="2"/>', '<limit lower="-2" upper="-1"/>').home
    assert (inside, beyond) == (0.0, pytest.approx(-1.0 - width))
    at_limit, narrow = fingers(tmp_path, '<limit lower="0" upper="2"/>', '<limit lower="0" upper="0.2"/>').home
    assert (at_limit, narrow) == (pytest.approx(width), pytest.approx(0.05))


def test_a_sliding_motor_has_its_home_outside_five_percent_of_its_range(tmp_path: Path) -> None:
    robot = fingers(tmp_path, '<limit lower="0" upper="0.04"/>', '<limit lower="-0.3" upper="0"/>', kind="prismatic")
    assert robot.home == pytest.approx([0.002, -0.015])


def test_a_continuous_joint_turns_once_around(tmp_path: Path) -> None:
    assert fingers(tmp_path, "", kind="continuous").limits.tolist() == [[-np.pi, np.pi]]


def test_a_prismatic_joint_counts_in_metres(tmp_path: Path) -> None:
    robot = fingers(tmp_path, '<limit lower="0" upper="0.04" velocity="0.2"/>', kind="prismatic")
    assert robot.joints[0].kind == "prismatic"
    assert robot.limits.tolist() == [[0, 0.04]]
    assert robot.motor_table[0].joints == ((0, 1.0, 0.0),)


def test_a_velocity_of_zero_means_unknown(tmp_path: Path) -> None:
    robot = fingers(tmp_path, '<limit lower="0" upper="1" velocity="0" effort="0"/>')
    assert robot.motor_table[0].max_velocity == np.deg2rad(60)
    assert robot.motor_table[0].max_torque == 40


def test_one_motor_drives_the_joints_that_mimic_its_joint(tmp_path: Path) -> None:
    robot = fingers(tmp_path, WIDE, f'<mimic joint="j0" multiplier="-0.5" offset="0.1"/>{WIDE}')
    assert robot.motors == ("j0",)
    assert robot.motor_table[0].joints == ((0, 1.0, 0.0), (1, -0.5, 0.1))
    assert np.allclose(robot.joints[1].limits, [-1.4, 1.6])


@pytest.mark.parametrize("order", [(0, 1, 2), (2, 1, 0), (1, 2, 0)])
def test_offsets_of_a_chain_of_mimics_are_multiplied_on(tmp_path: Path, order: tuple[int, int, int]) -> None:
    # b = 2 a + 0.1, c = -3 b + 0.2 = -6 a - 0.1, in any order in the file
    texts = [
        ("a", WIDE),
        ("b", '<mimic joint="a" multiplier="2" offset="0.1"/>'),
        ("c", '<mimic joint="b" multiplier="-3" offset="0.2"/>'),
    ]
    lines = [
        f'<joint name="{texts[k][0]}" type="continuous"><parent link="l0"/><child link="l{k + 1}"/>{texts[k][1]}</joint>' for k in order
    ]
    robot = read_urdf(urdf_file(tmp_path, LINKS, *lines))
    assert robot.motors == ("a",)
    driven = {robot.joints[index].name: (scale, offset) for index, scale, offset in robot.motor_table[0].joints}
    assert driven["a"] == (1, 0)
    assert driven["b"] == (2, 0.1)
    assert driven["c"] == pytest.approx((-6, -0.1), abs=1e-15)


def test_a_motor_keeps_the_joints_that_mimic_it_within_their_limits(tmp_path: Path) -> None:
    robot = fingers(tmp_path, WIDE, '<mimic joint="j0" multiplier="-2"/><limit lower="-1" upper="4"/>')
    assert robot.limits.tolist() == [[-2, 0.5]]


def test_limits_of_a_mimic_that_leave_no_room_are_ignored_with_a_warning(tmp_path: Path) -> None:
    with pytest.warns(UserWarning, match="the limits of 'j1' leave 'j0', which it mimics, no room"):
        robot = fingers(tmp_path, WIDE, '<mimic joint="j0"/><limit lower="0" upper="0"/>')
    assert robot.limits.tolist() == [[-3, 3]]


def test_a_joint_without_play_is_fixed_where_its_limits_hold_it(tmp_path: Path) -> None:
    lines = (*ARM[:-1], ' <limit lower="0.5" upper="0.5"/></joint>', '<link name="tip"/>')
    tip = '<joint name="t" type="fixed"><parent link="lower"/><child link="tip"/><origin xyz="1 0 0"/></joint>'
    with pytest.warns(UserWarning, match="joint 'elbow' has lower = upper = 0.5, so it is fixed there"):
        robot = read_urdf(urdf_file(tmp_path, *lines, tip))
    assert robot.motors == ("shoulder",)
    assert np.allclose(robot.markers["tip"].position, [1 + np.cos(0.5), 0, -np.sin(0.5)])


def test_a_revolute_joint_without_limits_gets_a_turn_and_a_warning(tmp_path: Path) -> None:
    with pytest.warns(UserWarning, match=r":3: <joint>: joint 'j0' has no limits; -180 to 180 deg is taken"):
        assert fingers(tmp_path, '<limit velocity="1" effort="1"/>').limits.tolist() == [[-np.pi, np.pi]]


@pytest.mark.parametrize(
    "limits", ['lower="-1e16" upper="1e16"', 'lower="-inf" upper="inf"', 'lower="1" upper="-1"', 'lower="2e6" upper="2e6"']
)
@pytest.mark.parametrize(("kind", "range_", "taken"), [("revolute", np.pi, "180 deg"), ("prismatic", 1.0, "1 m")])
def test_limits_that_are_none_are_taken_for_none_with_a_warning(tmp_path: Path, limits: str, kind: str, range_: float, taken: str) -> None:
    with pytest.warns(UserWarning, match=rf"toy.urdf:3: <limit>: joint 'j0' has lower=.* to {taken} is taken. If it has limits"):
        robot = fingers(tmp_path, f"<limit {limits}/>", kind=kind)
    assert robot.limits.tolist() == [[-range_, range_]]
    assert robot.joints[0].limits.tolist() == [-range_, range_]


def test_a_joint_with_one_limit_gets_a_turn_or_two_metres_from_there(tmp_path: Path) -> None:
    with pytest.warns(UserWarning, match="is read as one without an? (lower|upper) limit; -?[0-9.]+ to") as said:
        turning = fingers(tmp_path, '<limit lower="-1" upper="1e9"/>', '<limit lower="-1e9" upper="1"/>')
        sliding = fingers(tmp_path, '<limit lower="0" upper="1e9"/>', kind="prismatic")
    assert len(said) == 3
    assert np.allclose(turning.limits, [[-1, 2 * np.pi - 1], [1 - 2 * np.pi, 1]])
    assert sliding.limits.tolist() == [[0, 2]]


def test_a_mimic_without_limits_leaves_its_motor_its_own(tmp_path: Path) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        robot = fingers(tmp_path, WIDE, '<mimic joint="j0" multiplier="2"/><limit lower="-1e16" upper="1"/>')
    assert robot.limits.tolist() == [[-3, 0.5]]


def test_an_infinite_velocity_or_effort_means_unknown(tmp_path: Path) -> None:
    robot = fingers(tmp_path, '<limit lower="0" upper="1" velocity="inf" effort="inf"/>')
    assert (robot.motor_table[0].max_velocity, robot.motor_table[0].max_torque) == (np.deg2rad(60), 40)


def test_a_velocity_beyond_measure_means_unknown(tmp_path: Path) -> None:
    robot = fingers(tmp_path, '<limit lower="0" upper="1" velocity="1e16" effort="5"/>')
    assert (robot.motor_table[0].max_velocity, robot.motor_table[0].max_torque) == (np.deg2rad(60), 5)


MALFORMED = {
    "cycle": (('<mimic joint="j1"/>', '<mimic joint="j0"/>'), r":3: <mimic> joint: 'j0' mimics itself in the end"),
    "itself": (('<mimic joint="j0"/>',), r":3: <mimic> joint: 'j0' mimics itself in the end. Remove one"),
    "unknown": (('<mimic joint="j9"/>',), r":3: <mimic> joint: there is no joint 'j9'"),
    "no factor": ((WIDE, '<mimic joint="j0" multiplier="0"/>'), r":4: <mimic> multiplier: is 0, so the joint cannot move"),
    "not finite": ((WIDE, '<mimic joint="j0" offset="inf"/>'), r":4: <mimic> offset: 'inf' is not finite"),
    "huge": ((WIDE, '<mimic joint="j0" multiplier="1e9"/>'), r":4: <mimic> multiplier: 1e\+09 is too large"),
    "no number": (('<limit lower="nan" upper="1"/>',), r":3: <limit> lower: 'nan' is not finite"),
    "limit": (('<limit lower="x" upper="1"/>',), r":3: <limit> lower: 'x' is not a number"),
}


@pytest.mark.parametrize("name", MALFORMED)
def test_a_malformed_motor_is_refused_with_its_line_and_a_remedy(tmp_path: Path, name: str) -> None:
    inside, message = MALFORMED[name]
    with pytest.raises(RobotFileError, match=r"toy\.urdf" + message):
        fingers(tmp_path, *inside)


def test_multipliers_that_grow_without_bound_are_refused(tmp_path: Path) -> None:
    inside = [WIDE, *(f'<mimic joint="j{k}" multiplier="1e5"/>' for k in range(3))]
    with pytest.raises(RobotFileError, match=r":5: <mimic> multiplier: 'j2' moves 1e\+10 times as far as 'j0'"):
        fingers(tmp_path, *inside)


def test_a_prismatic_joint_without_limits_is_refused(tmp_path: Path) -> None:
    with pytest.raises(RobotFileError, match=r":3: <joint> limit: a prismatic joint without limits. Add <limit"):
        fingers(tmp_path, "", kind="prismatic")


def test_a_fixed_joint_cannot_be_mimicked(tmp_path: Path) -> None:
    lines = (*ARM, '<link name="x"/><link name="y"/>', '<joint name="f" type="fixed"><parent link="lower"/><child link="x"/></joint>')
    mimic = '<joint name="m" type="revolute"><parent link="x"/><child link="y"/><mimic joint="f"/></joint>'
    with pytest.raises(RobotFileError, match=r":9: <mimic> joint: joint 'f' does not move. Name a joint that moves"):
        read_urdf(urdf_file(tmp_path, *lines, mimic))


def test_nothing_warns_of_a_sound_file(tmp_path: Path) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        read_urdf(urdf_file(tmp_path, *ARM))
