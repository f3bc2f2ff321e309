# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import pytest

from mobee.errors import RobotFileError, UnknownName
from mobee.robot.robot import Robot
from mobee.robot.urdf.read import UrdfOptions, read_urdf
from tests.mobee.robot.urdf_files import ARM, srdf_file, urdf_file

WRIST = '<link name="hand"/><joint name="wrist" type="continuous"><parent link="lower"/><child link="hand"/></joint>'


def state(name: str, **values: float | str) -> str:
    joints = "".join(f'<joint name="{joint}" value="{value}"/>' for joint, value in values.items())
    return f'<group_state name="{name}" group="all">{joints}</group_state>'


def read(folder: Path, *lines: str, home: str | None = None) -> Robot:
    srdf_file(folder, *lines)
    return read_urdf(urdf_file(folder, *ARM, WRIST), UrdfOptions(home=home))


STANDING, SITTING = state("standing", shoulder=0.1), state("half_sitting", shoulder=0.2)
RESTING, LYING = state("resting", shoulder=0.3), state("lying", shoulder=0.4)


@pytest.mark.parametrize(
    ("lines", "shoulder"),
    [
        ((STANDING, SITTING, state("Home", shoulder=0.5)), 0.5),
        ((STANDING, SITTING, RESTING), 0.2),
        ((RESTING, STANDING), 0.1),
        ((RESTING,), 0.3),
        ((RESTING, LYING), 0.0),
        ((RESTING, LYING, state("Zero", shoulder=0.7)), 0.7),
    ],
    ids=["home", "a known name", "a known name among others", "the only one", "none of two", "zero"],
)
def test_which_group_state_is_home(tmp_path: Path, lines: tuple[str, ...], shoulder: float) -> None:
    assert read(tmp_path, *lines).home.tolist() == [shoulder, 0, 0]


@pytest.mark.parametrize(("home", "shoulder"), [("lying", 0.4), ("Resting", 0.3), ("zero", 0.0)])
def test_home_may_be_chosen_by_name(tmp_path: Path, home: str, shoulder: float) -> None:
    assert read(tmp_path, RESTING, LYING, STANDING, home=home).home.tolist() == [shoulder, 0, 0]


def test_zero_may_be_the_name_of_a_state(tmp_path: Path) -> None:
    assert read(tmp_path, state("zero", elbow=1), home="zero").home.tolist() == [0, 1, 0]


def test_states_of_several_groups_with_one_name_are_one(tmp_path: Path) -> None:
    assert read(tmp_path, state("ready", shoulder=0.5), state("ready", elbow=0.25), RESTING).home.tolist() == [0.5, 0.25, 0]


def test_an_unknown_home_is_answered_with_those_there_are(tmp_path: Path) -> None:
    with pytest.raises(
        UnknownName, match=r"unknown home \(.*toy.srdf\) 'stending'. Did you mean 'standing'\? Valid: lying, standing, zero"
    ):
        read(tmp_path, STANDING, LYING, home="stending")
    with pytest.raises(UnknownName, match=r"unknown home \(no SRDF was found\) 'standing'. Valid: zero"):
        read_urdf(urdf_file(tmp_path / "..", *ARM), UrdfOptions(home="standing"))


def test_a_home_that_is_meant_and_out_of_reach_is_refused(tmp_path: Path) -> None:
    far = state("standing", elbow=3)
    for lines, home in (((far, STANDING), "standing"), ((state("home", elbow=3),), None)):
        with pytest.raises(RobotFileError, match=r"toy.srdf:2: <joint> value: 3 puts 'elbow' outside of -2 .. 2. Choose a home within"):
            read(tmp_path, *lines, home=home)


def test_a_home_that_is_only_guessed_and_out_of_reach_is_moved_into_the_limits(tmp_path: Path) -> None:
    with pytest.warns(UserWarning, match=r"toy.srdf:2: <joint>: 3 puts 'elbow' outside of -2 .. 2, so its home is the nearest limit"):
        assert read(tmp_path, state("standing", elbow=3)).home.tolist() == [0, 2, 0]


@pytest.mark.parametrize(("value", "angle"), [("0.5", 0.5), ("7", 7 - 2 * np.pi), ("0 1", np.pi / 2), ("3.1416", np.pi)])
def test_continuous_joints_are_given_by_any_angle_or_its_cosine_and_sine(tmp_path: Path, value: str, angle: float) -> None:
    assert abs(read(tmp_path, state("home", wrist=value)).home[2]) == pytest.approx(abs(angle), abs=1e-5)


def test_where_a_free_base_stands_is_passed_over(tmp_path: Path) -> None:
    free = '<virtual_joint name="world" type="floating" parent_frame="odom" child_link="base"/>'
    group = '<group name="all"><joint name="root_joint"/><joint name="shoulder"/><joint name="elbow"/><joint name="wrist"/></group>'
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        robot = read(tmp_path, free, group, state("home", world="0 0 1 0 0 0 1", root_joint="0 0 1 0 0 0 1", elbow=1))
    assert robot.home.tolist() == [0, 1, 0]


def test_where_a_joint_is_that_does_not_move_is_passed_over(tmp_path: Path) -> None:
    srdf_file(tmp_path, state("home", tip="0 0 1 0 0 0 1", elbow=1))
    tip = '<link name="end"/><joint name="tip" type="fixed"><parent link="lower"/><child link="end"/></joint>'
    assert read_urdf(urdf_file(tmp_path, *ARM, tip)).home.tolist() == [0, 1]


def test_joints_that_the_robot_does_not_have_are_warned_of(tmp_path: Path) -> None:
    with pytest.warns(UserWarning, match="toy.srdf:2: <joint>: the robot has no joint 'finger'"):
        read(tmp_path, state("home", finger=1))


FOUND = (
    ("urdf/arm.srdf", "arm"),
    ("srdf/arm.srdf", "arm"),
    ("urdf/toy.srdf", "toy"),
    ("srdf/Toy.SRDF", "Toy"),
)


@pytest.mark.parametrize("first", range(len(FOUND)))
def test_an_srdf_is_found_by_the_name_of_the_file_or_of_the_robot(tmp_path: Path, first: int) -> None:
    (tmp_path / "urdf").mkdir()
    (tmp_path / "srdf").mkdir()
    path = urdf_file(tmp_path / "urdf", *ARM).rename(tmp_path / "urdf/arm.urdf")
    for name, _ in (*FOUND[first:], ("srdf/other.srdf", "")):
        (tmp_path / name).write_text(f'<robot name="toy">{state("home", shoulder=0.1 * FOUND.index((name, _)) if _ else 9)}</robot>')
    robot = read_urdf(path)
    assert robot.home[0] == pytest.approx(0.1 * first)
    assert robot.where["srdf", "toy"] == f"{tmp_path / FOUND[first][0]}:1"


def test_a_robot_without_an_srdf_names_none(tmp_path: Path) -> None:
    path = urdf_file(tmp_path, *ARM)
    (tmp_path / "other.srdf").write_text("no XML")
    assert ("srdf", "toy") not in read_urdf(path).where
