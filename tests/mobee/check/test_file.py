# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from mobee.check import check_file, check_robot
from mobee.errors import InvalidValue, RobotFileError, UnknownName
from mobee.model import World
from mobee.robot.robot import Robot
from tests.mobee.check.arm import ARM
from tests.mobee.robot.robot_files import robot_file


@pytest.mark.parametrize("name", ["toy.xml", "a:3: b.XML"])
def test_a_warning_of_the_reader_is_a_finding_with_its_line(tmp_path: Path, name: str) -> None:
    path = robot_file(tmp_path, *ARM.replace("<marker", '<jont z="1"/><marker').splitlines()).rename(tmp_path / name)
    checked = check_file(path)
    (finding,) = checked.findings
    assert isinstance(checked.content, Robot)
    assert (finding.severity, finding.check, finding.where) == ("warning", "reader", f"{path}:10")
    assert finding.what == "<jont>: unknown tag is ignored with all inside"
    assert finding.remedy.startswith("Did you mean 'joint'? Valid: bodypart")


def test_a_world_file_is_distinguished_from_a_robot_file(tmp_path: Path) -> None:
    path = tmp_path / "desk.xml"
    path.write_text('<World name="desk">\n <box name="desk" width="600" height="0.6" depth="0.1"/>\n</World>\n')
    checked = check_file(path)
    assert isinstance(checked.content, World)
    assert [finding.where for finding in checked.findings] == [f"{path}:2"]
    assert isinstance(check_file("table").content, World)


def test_a_file_that_cannot_be_read_raises_the_readers_error(tmp_path: Path) -> None:
    with pytest.raises(RobotFileError, match=r"toy\.xml:2: <bodypart> name: is required"):
        check_file(robot_file(tmp_path, "<bodypart/>"))
    with pytest.raises(UnknownName, match="icub"):
        check_file("icubb")


@pytest.mark.parametrize("given", [None, 3, b"katana"])
def test_what_is_no_path_is_refused(given: Any) -> None:
    with pytest.raises(InvalidValue, match=f"name_or_path is {given!r}; it must be a path, or a name: cup, icub"):
        check_file(given)


def test_robots_and_worlds_of_a_wrong_type_are_refused() -> None:
    name: Any = "table"
    with pytest.raises(InvalidValue, match="robot is 'table'; it must be a Robot"):
        check_robot(name)
    with pytest.raises(InvalidValue, match="world is 'table'; it must be a World"):
        check_file("katana", name)


def test_a_misspelt_world_is_answered_with_the_nearest() -> None:
    with pytest.raises(UnknownName, match=r"unknown robot or world 'tabel'. Did you mean 'table'\?"):
        check_file("tabel")


def test_a_folder_is_refused_as_a_folder(tmp_path: Path) -> None:
    with pytest.raises(RobotFileError, match="is a folder"):
        check_file(tmp_path)
