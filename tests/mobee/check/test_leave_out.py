# SPDX-License-Identifier: Apache-2.0
"""The file that `mobee check --write-srdf` writes, and the cases in which it writes none."""

from __future__ import annotations

import stat
from pathlib import Path

import pytest

from mobee.check.touching import leave_out_touching
from mobee.errors import InvalidValue, RobotFileError
from mobee.model.model import Model
from mobee.robot.load import load_robot
from tests.mobee.check.test_urdf import URDF
from tests.mobee.robot.urdf_files import foreign

LINE = '<disable_collisions link1="base" link2="fore" reason="Always"/>'


@pytest.fixture
def urdf(tmp_path: Path) -> Path:
    """Base and fore touch in every pose."""
    path = tmp_path / "toy.urdf"
    path.write_text(URDF.format("").replace('radius="0.06"', 'radius="0.12"'))
    return path


def contacts(urdf: Path, srdf: Path | None = None) -> int:
    robot = load_robot(urdf, srdf=srdf)
    return int(Model(robot).evaluate(robot.home).count)


def test_a_new_srdf_is_found_and_the_robot_no_longer_touches_itself(urdf: Path) -> None:
    assert contacts(urdf) == 1
    done = leave_out_touching(urdf)
    assert (done.path, done.merged, done.touching, done.found) == (urdf.with_suffix(".srdf"), False, 0, True)
    assert done.path.read_text() == f'<?xml version="1.0" encoding="utf-8"?>\n<robot name="toy">\n {LINE}\n</robot>\n'
    assert contacts(urdf) == 0
    assert load_robot(urdf).untested[frozenset((0, 2))].startswith("disabled in the SRDF: Always (toy.srdf, line 3)")


def test_a_second_call_adds_nothing(urdf: Path) -> None:
    text = leave_out_touching(urdf).path.read_bytes()
    again = leave_out_touching(urdf)
    assert (again.pairs, again.merged) == ((), True)
    assert again.path.read_bytes() == text


OLD = """<?xml version="1.0"?>
<!-- by hand -->
<robot name="toy">
\t<group name="arm"><joint name="pan"/><joint name="bend"/></group>
  <group_state name="home" group="arm"><joint name="bend" value="0.5"/></group_state>
  <disable_collisions link1="upper"   link2="fore"/>
</robot>
<!-- end -->
"""


def test_an_srdf_that_is_there_keeps_every_byte(urdf: Path) -> None:
    srdf = urdf.with_suffix(".srdf")
    srdf.write_text(OLD)
    srdf.chmod(0o640)
    done = leave_out_touching(urdf)
    assert done.merged and len(done.pairs) == 1
    assert srdf.read_text() == OLD.replace("</robot>", f" {LINE}\n</robot>")
    assert stat.S_IMODE(srdf.stat().st_mode) == 0o640
    assert load_robot(urdf).home.tolist() == [0.0, 0.5]


def test_lines_end_as_those_of_the_file_do(urdf: Path) -> None:
    srdf = urdf.with_suffix(".srdf")
    srdf.write_bytes(b'<robot name="toy">\r\n</robot>\r\n')
    leave_out_touching(urdf)
    assert srdf.read_bytes() == f'<robot name="toy">\r\n {LINE}\r\n</robot>\r\n'.encode()


def test_another_srdf_keeps_the_content_of_the_robot_s_own(urdf: Path, tmp_path: Path) -> None:
    srdf = urdf.with_suffix(".srdf")
    srdf.write_text(OLD)
    done = leave_out_touching(urdf, tmp_path / "other.srdf")
    assert srdf.read_text() == OLD
    assert (done.path.name, done.merged, done.found) == ("other.srdf", True, False)
    assert contacts(urdf, done.path) == 0
    assert load_robot(urdf, srdf=done.path).home.tolist() == [0.0, 0.5]


def test_a_pair_whose_test_is_asked_for_is_not_written(urdf: Path) -> None:
    srdf = urdf.with_suffix(".srdf")
    srdf.write_text('<robot name="toy"><enable_collisions link1="fore" link2="base"/></robot>')
    done = leave_out_touching(urdf)
    assert (done.pairs, len(done.enabled), done.touching) == ((), 1, 1)
    assert "disable" not in srdf.read_text()


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('<robot name="toy"/>', "has no </robot>"),
        ('<robot name="toy"></robot><!-- </robot> -->', "Remove what stands behind"),
        ('<robot name="toy">', "toy.srdf:"),
        ('<sdf name="toy"></sdf>', "this is not an SRDF file"),
    ],
)
def test_an_srdf_that_cannot_take_the_lines_is_refused_and_stays(urdf: Path, text: str, said: str) -> None:
    srdf = urdf.with_suffix(".srdf")
    srdf.write_text(text)
    with pytest.raises(RobotFileError, match=said):
        leave_out_touching(urdf)
    assert srdf.read_text() == text
    assert sorted(path.name for path in urdf.parent.iterdir()) == ["toy.srdf", "toy.urdf"]


def test_an_srdf_that_cannot_be_written_is_refused(urdf: Path, tmp_path: Path) -> None:
    with pytest.raises(RobotFileError, match=r"nowhere/toy.srdf: cannot be written: No such file or directory\. Name another file"):
        leave_out_touching(urdf, tmp_path / "nowhere" / "toy.srdf")


def test_an_srdf_under_another_name_is_not_mixed_with_the_one_that_is_read(urdf: Path, tmp_path: Path) -> None:
    read, there = tmp_path / "read.srdf", tmp_path / "there.srdf"
    read.write_text(OLD)
    there.write_text(OLD)
    with pytest.raises(InvalidValue, match=r"there.srdf is there already"):
        leave_out_touching(urdf, there, srdf=read)
    with pytest.raises(InvalidValue, match=r"ends in .srdf"):
        leave_out_touching(urdf, tmp_path / "toy.urdf")


def test_several_links_in_one_line_are_refused(urdf: Path) -> None:
    urdf.write_text(urdf.read_text().replace("\n", " "))
    with pytest.raises(RobotFileError, match=r"toy.urdf:1: several links are in this line. .*xmllint --format toy.urdf"):
        leave_out_touching(urdf)


def test_a_zero_position_file_has_no_srdf() -> None:
    with pytest.raises(InvalidValue, match="is no URDF"):
        leave_out_touching("icub")


@pytest.mark.parametrize("name", ["franka_panda/panda.urdf", "r2d2.urdf", "quadruped/minitaur.urdf"])
@pytest.mark.filterwarnings("ignore")
def test_no_robot_of_others_touches_itself_at_home_with_it(tmp_path: Path, name: str) -> None:
    done = leave_out_touching(foreign(name), tmp_path / "new.srdf")
    assert (done.touching, done.found) == (0, False)
    assert contacts(foreign(name), done.path) == 0


def test_the_srdf_of_a_ros_package_is_the_one_that_grows(urdf: Path, tmp_path: Path) -> None:
    for folder in ("urdf", "srdf"):
        (tmp_path / folder).mkdir()
    moved = urdf.rename(tmp_path / "urdf" / "toy.urdf")
    srdf = tmp_path / "srdf" / "toy.srdf"
    srdf.write_text(OLD)
    done = leave_out_touching(moved)
    assert done.found and done.path.resolve() == srdf.resolve()
    assert srdf.read_text() == OLD.replace("</robot>", f" {LINE}\n</robot>")
    assert contacts(moved) == 0
