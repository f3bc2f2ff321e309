# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import warnings
from pathlib import Path

import pytest

from mobee.errors import OlderVersion
from mobee.model.world_file import load_world
from mobee.robot.load import load_robot
from mobee_cli.__main__ import main
from services.common.exit_codes import BAD_INPUT, FAILED
from tests.mobee.robot.same_robot import assert_same_robot
from tests.mobee.robot.urdf_files import foreign


def test_a_robot_goes_to_urdf_and_back(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["convert", "icub", str(tmp_path / "i.urdf")]) == 0
    said = capsys.readouterr().out
    assert "i.urdf: icub, 41 motors, 63 joints, 110 shapes, 7 markers" in said
    assert "i.srdf: parts as groups, home, pairs that are not tested" in said
    assert "14 clauses are written as a comment only" in said
    assert main(["convert", str(tmp_path / "i.urdf"), str(tmp_path / "i.xml")]) == 0
    assert_same_robot(load_robot("icub"), load_robot(tmp_path / "i.xml"))


def test_options_of_a_urdf_are_passed_on(tmp_path: Path) -> None:
    source = str(foreign("r2d2.urdf"))
    assert main(["convert", source, str(tmp_path / "r.xml"), "--field", "0.05", "--meshes", "bounding"]) == 0
    assert_same_robot(load_robot(source, field=0.05, meshes="bounding"), load_robot(tmp_path / "r.xml"))


def test_existing_files_are_kept_by_default(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "k.srdf").write_text("mine")
    assert main(["convert", "katana", str(tmp_path / "k.urdf")]) == BAD_INPUT
    assert "k.srdf exists already. Choose another name, or overwrite it with --force" in capsys.readouterr().err
    assert not (tmp_path / "k.urdf").exists()
    assert main(["convert", "katana", str(tmp_path / "k.urdf"), "--force"]) == 0


def test_an_old_robot_is_converted_with_remarks_on_its_interpretation(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "parts").mkdir()
    (tmp_path / "new").mkdir()
    old, new = tmp_path / "parts" / "old.xml", tmp_path / "new" / "new.xml"
    (tmp_path / "parts" / "hand.stl").touch()
    link = '<link x="1"><visual file="hand.stl"/><marker name="tip" nx="1"/></link>'
    motor = f'<motor name="m" minPos="0" maxPos="9"><joint z="1">{link}</joint></motor>'
    old.write_text(f'<ZeroPositionKinematicTree robotName="old"><bodypart name="arm">{motor}</bodypart></ZeroPositionKinematicTree>')
    pair = tmp_path / "parts" / "pair.xml"
    pair.write_text('<ZeroPositionKinematicTree robotName="pair"><robot name="a" file="old.xml"/></ZeroPositionKinematicTree>')
    assert main(["convert", str(old), str(new)]) == 0
    said = capsys.readouterr().out
    assert f"{new}: old, 1 motors, 1 joints, 0 shapes, 1 markers" in said
    assert "old.xml:1: read as MoBeE 0.1 read it: what stands inside a <link> stands at its end (here)" in said
    assert '<visual file="../parts/hand.stl"' in new.read_text()
    assert 'version="2.0"' in new.read_text() and 'px="1' in new.read_text()
    assert main(["convert", str(pair), str(tmp_path / "new" / "pair.xml")]) == 0
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", OlderVersion)
        assert list(load_robot(tmp_path / "new" / "pair.xml").parts) == ["a_arm"]


def test_a_world_goes_into_todays_form_and_not_into_a_urdf(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    old, new = tmp_path / "old.xml", tmp_path / "new.xml"
    old.write_text('<WorldList version="1.0"><object name="ball" px="1" type="target"><sphere radius=".1" py="2"/></object></WorldList>')
    assert main(["convert", str(old), str(new)]) == 0
    assert f"{new}: 1 objects" in capsys.readouterr().out
    assert load_world(new).objects["ball"].position.tolist() == [1, 2, 0]
    assert main(["convert", str(old), str(tmp_path / "new.urdf")]) == BAD_INPUT
    assert "a world can only be written as .xml: a URDF holds robots only" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "code", "message"),
    [
        (["icbu", "x.urdf"], BAD_INPUT, "Did you mean 'icub'?"),
        (["icub", "x.sdf"], BAD_INPUT, "x.sdf: OUT must end in .xml or .urdf"),
        (["icub", "nowhere/x.urdf"], BAD_INPUT, "there is no folder"),
        (["icub", "x.urdf", "--field", "0.1"], BAD_INPUT, "field= is for URDF and MJCF files"),
        (["table", "x.xml", "--field", "0.1"], BAD_INPUT, "--field 0.1: "),
        (["icub", "folder.xml", "--force"], FAILED, "folder.xml cannot be written (Is a directory)"),
        (["mine.urdf", "x.xml"], BAD_INPUT, "mine.urdf: no such file"),
    ],
)
def test_mistakes_are_answered_in_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], arguments: list[str], code: int, message: str
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "folder.xml").mkdir()
    assert main(["convert", *arguments]) == code
    said = capsys.readouterr().err
    assert message in said
    assert said.count("\n") == 1
