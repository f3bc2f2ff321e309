from __future__ import annotations

from pathlib import Path

import pytest

from mobee.robot.load import load_robot
from mobee_cli.__main__ import main
from mobee_cli.errors import BAD_INPUT, FAILED
from tests.mobee.robot.same_robot import assert_same_robot
from tests.mobee.robot.urdf_files import foreign


def test_a_robot_goes_to_urdf_and_back(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["convert", "icub", str(tmp_path / "i.urdf")]) == 0
    said = capsys.readouterr().out
    assert "i.urdf: icub, 41 motors, 63 joints, 110 shapes, 7 markers" in said
    assert "i.srdf: parts as groups, home, pairs that are not tested" in said
    assert "14 clauses stand in a comment only" in said
    assert main(["convert", str(tmp_path / "i.urdf"), str(tmp_path / "i.xml")]) == 0
    assert_same_robot(load_robot("icub"), load_robot(tmp_path / "i.xml"))


def test_options_of_a_urdf_are_passed_on(tmp_path: Path) -> None:
    source = str(foreign("r2d2.urdf"))
    assert main(["convert", source, str(tmp_path / "r.xml"), "--field", "0.05", "--meshes", "bounding"]) == 0
    assert_same_robot(load_robot(source, field=0.05, meshes="bounding"), load_robot(tmp_path / "r.xml"))


def test_files_that_are_there_are_kept_unless_told_otherwise(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "k.srdf").write_text("mine")
    assert main(["convert", "katana", str(tmp_path / "k.urdf")]) == BAD_INPUT
    assert "k.srdf is there already. Choose another name, or write over it with --force" in capsys.readouterr().err
    assert not (tmp_path / "k.urdf").exists()
    assert main(["convert", "katana", str(tmp_path / "k.urdf"), "--force"]) == 0


@pytest.mark.parametrize(
    ("arguments", "code", "message"),
    [
        (["icbu", "x.urdf"], BAD_INPUT, "Did you mean 'icub'?"),
        (["icub", "x.sdf"], BAD_INPUT, "x.sdf: OUT must end in .xml or .urdf"),
        (["icub", "nowhere/x.urdf"], FAILED, "nowhere: make it, or choose another"),
        (["icub", "x.urdf", "--field", "0.1"], BAD_INPUT, "field= is for .urdf files"),
        (["mine.urdf", "x.xml"], BAD_INPUT, "mine.urdf: no such file"),
    ],
)
def test_mistakes_are_answered_in_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], arguments: list[str], code: int, message: str
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["convert", *arguments]) == code
    said = capsys.readouterr().err
    assert message in said
    assert said.count("\n") == 1
