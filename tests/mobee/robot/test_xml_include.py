# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from mobee.errors import RobotFileError
from mobee.robot.load import load_robot
from mobee.robot.xml.read import read_robot

ARM = (
    '<bodypart name="arm"><motor name="pan" minPos="0" maxPos="90"><joint z="1">'
    '<link x="1"><sphere name="tip" radius=".1" px="1"/></link></joint></motor></bodypart>'
)


def written(folder: Path, name: str, *lines: str) -> Path:
    path = folder / name
    text = ['<ZeroPositionKinematicTree version="2.0" robotName="both">', *lines, "</ZeroPositionKinematicTree>"]
    path.write_text("\n".join(text), encoding="utf-8")
    return path


def test_a_robot_of_another_file_stands_where_the_tag_says(tmp_path: Path) -> None:
    written(tmp_path, "arm.xml", ARM)
    robot = read_robot(written(tmp_path, "both.xml", ARM, '<robot name="other" file="arm.xml" px="5" angle="90"/>'))
    assert (robot.name, robot.motors, list(robot.parts)) == ("both", ("pan", "other_pan"), ["arm", "other_arm"])
    np.testing.assert_allclose(robot.shapes[1].position, [5, 1, 0], atol=1e-12)
    np.testing.assert_array_equal(robot.solid_pairs, [[0, 1]])


def test_a_urdf_may_be_included_too(tmp_path: Path) -> None:
    limit = '<limit lower="-1" upper="1" effort="1" velocity="1"/>'
    joint = f'<joint name="j" type="revolute"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/>{limit}</joint>'
    (tmp_path / "arm.urdf").write_text(f'<robot name="arm"><link name="a"/><link name="b"/>{joint}</robot>', encoding="utf-8")
    robot = read_robot(written(tmp_path, "both.xml", '<robot name="u" file="arm.urdf" px="1"/>', '<robot name="k" file="katana"/>'))
    assert robot.motors[0] == "u_j"
    np.testing.assert_allclose(robot.joints[0].point, [1, 0, 0])


def test_the_z_axis_of_an_included_robot_is_turned_to_h(tmp_path: Path) -> None:
    written(tmp_path, "arm.xml", ARM)
    robot = read_robot(written(tmp_path, "both.xml", '<robot file="arm.xml" hx="1"/>'))
    np.testing.assert_allclose(robot.joints[0].axis, [1, 0, 0], atol=1e-12)
    assert robot.motors == ("pan",)


def test_everything_keeps_the_line_of_its_own_file(tmp_path: Path) -> None:
    arm = written(tmp_path, "arm.xml", "", ARM)
    path = written(tmp_path, "both.xml", "", "", '<robot name="other" file="arm.xml"/>')
    where = read_robot(path).where
    assert where["motor", "other_pan"] == where["shape", "other_tip"] == f"{arm}:3"
    assert where["robot", "both"] == f"{path}:1"
    assert where["robot", "other_both"] == f"{arm}:1"


def test_an_error_in_an_included_file_names_that_file_and_line(tmp_path: Path) -> None:
    arm = written(tmp_path, "arm.xml", "", ARM.replace(".1", "-1"))
    with pytest.raises(RobotFileError, match=f"{arm}:3: <sphere> radius: -1 is not positive"):
        read_robot(written(tmp_path, "both.xml", '<robot file="arm.xml"/>'))


def test_a_file_may_leave_out_pairs_of_the_robots_it_includes(tmp_path: Path) -> None:
    written(tmp_path, "arm.xml", ARM)
    robot = read_robot(written(tmp_path, "both.xml", ARM, '<robot name="b" file="arm.xml"/>', '<ignore first="pan" second="b_pan"/>'))
    assert robot.solid_pairs.shape == (0, 2)
    assert robot.untested[frozenset((1, 2))] == "the file says so, line 4"


def test_the_same_file_may_stand_in_two_places(tmp_path: Path) -> None:
    robot = read_robot(written(tmp_path, "two.xml", '<robot name="a" file="katana"/>', '<robot name="b" file="katana" px="1"/>'))
    assert len(robot.motors) == 2 * len(load_robot("katana").motors)


@pytest.mark.parametrize(
    ("tag", "message"),
    [
        (
            '<robot file="nowhere.xml"/>',
            "<robot> file: 'nowhere.xml' is no file. Give a path relative to this file, or a shipped robot: icub,",
        ),
        ('<robot file="."/>', "<robot> file: '.' is no file"),
        (f'<robot file="{"x" * 5000}"/>', "is no file"),
        ("<robot/>", "<robot> file: is required and missing"),
        ('<robot file="arm.xml" name="My Arm"/>', "<robot> name: 'My Arm' cannot begin the name of a part"),
        ('<robot file="arm.xml"/>', "<robot> name: two parts of the joined robots have the name 'arm'"),
        ('<robot file="both.xml"/>', "<robot> file: the file includes itself (both.xml -> both.xml)"),
        ('<bodypart name="b"><robot file="arm.xml"/></bodypart>', "<robot> position in the file: this tag cannot stand here"),
        ('<robot name="b" file="arm.xml"><marker name="m"/></robot>', "<marker> position in the file: nothing stands inside <robot>"),
    ],
)
def test_errors_name_file_line_field_and_remedy(tmp_path: Path, tag: str, message: str) -> None:
    written(tmp_path, "arm.xml", ARM)
    path = written(tmp_path, "both.xml", ARM, "", tag)
    with pytest.raises(RobotFileError) as caught:
        read_robot(path)
    assert str(caught.value).startswith(f"{path}:4: ")
    assert message in str(caught.value)


def test_a_loop_through_several_files_is_found(tmp_path: Path) -> None:
    paths = [written(tmp_path, f"{k}.xml", f'<robot file="{(k + 1) % 3}.xml"/>') for k in range(3)]
    with pytest.raises(RobotFileError, match=r"2.xml:2: .* includes itself \(0.xml -> 1.xml -> 2.xml -> 0.xml\)"):
        read_robot(paths[0])


def test_files_do_not_multiply_without_end(tmp_path: Path) -> None:
    for k in range(7):
        written(tmp_path, f"{k}.xml", *(f'<robot name="r{r}" file="{k + 1}.xml"/>' for r in range(9)))
    written(tmp_path, "7.xml", ARM)
    with pytest.raises(RobotFileError, match="more than 8 files inside each other, or 32 in all"):
        read_robot(tmp_path / "0.xml")


def test_a_long_chain_of_files_is_refused(tmp_path: Path) -> None:
    paths = [written(tmp_path, f"{k}.xml", f'<robot file="{k + 1}.xml"/>') for k in range(9)]
    written(tmp_path, "9.xml", ARM)
    with pytest.raises(RobotFileError, match="7.xml:2: <robot> file: more than 8 files inside each other"):
        read_robot(paths[0])
    assert read_robot(paths[4]).motors == ("pan",)
