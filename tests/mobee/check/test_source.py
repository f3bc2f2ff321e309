# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from pathlib import Path

import pytest

from mobee.check import check_file
from mobee.errors import RobotFileError
from tests.mobee.check.arm import ARM
from tests.mobee.robot.robot_files import HEAD, robot_file


def found(path: Path) -> list[tuple[str, str, str]]:
    return [(finding.severity, finding.check, finding.where) for finding in check_file(path).findings]


def test_a_version_that_is_not_known_is_refused(tmp_path: Path) -> None:
    path = robot_file(tmp_path, *ARM.splitlines())
    assert found(path) == []
    path.write_text(path.read_text().replace('version="2.0"', 'version="3.0"'))
    with pytest.raises(RobotFileError, match=r"toy.xml:1: .* version: '3.0' is not known. Write version=\"2.0\" for today's grammar"):
        check_file(path)
    world = tmp_path / "desk.xml"
    world.write_text('<World version="3.0"/>')
    with pytest.raises(RobotFileError, match="desk.xml:1: .* unknown version '3.0'"):
        check_file(world)


def test_a_file_of_an_older_version_is_noted_with_the_evidence(tmp_path: Path) -> None:
    path = robot_file(tmp_path, *ARM.replace('name="tip"', 'name="tip" tracer="3"').replace('name="pan" z', "z").splitlines())
    text = path.read_text().replace('version="2.0"', 'version="1.0"')
    for name in ("upper", "fore", "bend"):
        text = text.replace(f'<link name="{name}"', "<link").replace(f'<joint name="{name}"', "<joint")
    path.write_text(text.replace("<joint ", '<joint minPos="-90" maxPos="90" '))
    (note,) = [finding for finding in check_file(path).findings if finding.check == "older-version"]
    assert (note.severity, note.where) == ("note", f"{path}:10")
    assert note.what.startswith("read as a file of VirtualSkin or MoBeE, 2011 to 2014")


def test_a_robot_without_a_name_is_noted(tmp_path: Path) -> None:
    path = robot_file(tmp_path, *ARM.splitlines())
    path.write_text(path.read_text().replace(HEAD, '<ZeroPositionKinematicTree version="2.0">'))
    assert found(path) == [("note", "robot-name", f"{path}:1")]


def test_an_empty_name_is_warned_of_in_its_line(tmp_path: Path) -> None:
    path = robot_file(tmp_path, *ARM.replace('name="fore"', 'name=" "').splitlines())
    assert found(path) == [("warning", "empty-name", f"{path}:9")]
