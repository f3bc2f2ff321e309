from __future__ import annotations

from pathlib import Path

from mobee.robot.check import check_file
from tests.mobee.robot.check.arm import ARM
from tests.mobee.robot.robot_files import HEAD, robot_file


def found(path: Path) -> list[tuple[str, str, str]]:
    return [(finding.severity, finding.check, finding.where) for finding in check_file(path).findings]


def test_a_version_that_is_not_known_is_warned_of(tmp_path: Path) -> None:
    path = robot_file(tmp_path, *ARM.splitlines())
    assert found(path) == []
    path.write_text(path.read_text().replace('version="1.0"', 'version="2.0"'))
    assert found(path) == [("warning", "version", f"{path}:1")]
    world = tmp_path / "desk.xml"
    world.write_text('<World version="2.0"/>')
    assert found(world) == [("warning", "version", f"{world}:1")]


def test_a_robot_without_a_name_is_noted(tmp_path: Path) -> None:
    path = robot_file(tmp_path, *ARM.splitlines())
    path.write_text(path.read_text().replace(HEAD, '<ZeroPositionKinematicTree version="1.0">'))
    assert found(path) == [("note", "robot-name", f"{path}:1")]


def test_an_empty_name_is_warned_of_in_its_line(tmp_path: Path) -> None:
    path = robot_file(tmp_path, *ARM.replace('name="fore"', 'name=" "').splitlines())
    assert found(path) == [("warning", "empty-name", f"{path}:9")]
