# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import json
from pathlib import Path

import pytest

from mobee.model.world_file import shipped_worlds
from mobee.robot.load import shipped_robots
from mobee_cli.__main__ import main
from tests.mobee.check.arm import ARM
from tests.mobee.check.test_urdf import URDF
from tests.mobee.robot.robot_files import robot_file
from tests.mobee.robot.urdf_files import arm_with, foreign, srdf_file


@pytest.fixture
def good(tmp_path: Path) -> Path:
    return robot_file(tmp_path, *ARM.splitlines())


@pytest.fixture
def bad(tmp_path: Path) -> Path:
    return robot_file(tmp_path, *ARM.replace("<marker", '<marker name="Tip"/><marker').splitlines())


@pytest.mark.parametrize("name", [*shipped_robots(), *shipped_worlds()])
def test_shipped_files_pass(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", name]) == 0
    assert "warning" not in capsys.readouterr().out


def test_a_correct_file_is_reported_as_correct(good: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", str(good)]) == 0
    assert capsys.readouterr().out.endswith("toy: 1 part, 2 motors, 2 joints, 6 shapes: nothing is wrong\n")


def test_a_warning_has_problem_reason_and_remedy(bad: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", str(bad)]) == 1
    what, why, remedy, *_, summary = capsys.readouterr().out.splitlines()
    assert "warning: marker 'tip' differs from marker 'Tip'" in what
    assert (why, remedy) == ("    names are case-sensitive, and people overlook the difference", "    rename one of the two")
    assert summary.endswith("1 warning")


def test_as_json(bad: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", str(bad), "--json"]) == 1
    printed = json.loads(capsys.readouterr().out)
    assert printed["robot"] == "toy"
    assert [finding["check"] for finding in printed["findings"]] == ["name-case"]
    assert ["base", "bend"] in next(group["links"] for group in printed["untested"] if "part" in group["reason"])


def test_pairs_are_counted_and_on_request_named(good: Path, capsys: pytest.CaptureFixture[str]) -> None:
    main(["check", str(good)])
    brief = capsys.readouterr().out
    assert "fields of the same part, which overlap wherever it bends: 1 pair of links (0 of solids, 1 of fields)" in " ".join(brief.split())
    assert "base - bend" not in brief
    main(["check", str(good), "--pairs"])
    assert "base - bend" in capsys.readouterr().out


def test_with_a_world_the_robot_is_checked_in_it(good: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rock = tmp_path / "rock.xml"
    rock.write_text('<World><sphere name="rock" radius="0.05" px="-0.2" pz="0.2"/></World>')
    assert main(["check", str(good), "--world", str(rock)]) == 1
    assert "error: at home 'upper' and 'rock' of the world collide" in capsys.readouterr().out


@pytest.mark.parametrize("text", ["<World", "<Robot/>", ""])
def test_an_unreadable_file_is_bad_input_in_one_line(text: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "broken.xml"
    path.write_text(text)
    assert main(["check", str(path)]) == 2
    said = capsys.readouterr().err
    assert said.startswith("mobee check: ")
    assert "broken.xml" in said
    assert len(said.splitlines()) == 1


def test_a_urdf_is_checked_with_fields_and_an_srdf_of_its_own(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arm = arm_with(tmp_path, '<sphere radius="0.1"/>')
    assert main(["check", str(arm)]) == 0
    assert "the robot has no field" in capsys.readouterr().out
    groups = tmp_path / "groups.srdf"
    groups.write_text(
        '<robot name="toy"><group name="a"><joint name="shoulder"/></group><group name="b"><joint name="elbow"/></group></robot>'
    )
    assert main(["check", str(arm), "--field", "0.03", "--meshes", "bounding", "--srdf", str(groups)]) == 0
    assert capsys.readouterr().out.endswith("toy: 2 parts, 2 motors, 2 joints, 2 shapes: nothing is wrong\n")
    assert main(["check", "katana", "--field", "0.03"]) == 2
    assert "field= is for URDF and MJCF files" in capsys.readouterr().err


def test_the_srdf_that_was_found_and_the_home_in_it_are_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arm = arm_with(tmp_path, '<sphere radius="0.1"/>')
    poses = ('<group_state name="up" group="all"><joint name="elbow" value="1"/></group_state>', '<group_state name="down" group="all"/>')
    srdf = srdf_file(tmp_path, *poses)
    main(["check", str(arm)])
    assert f"SRDF: {srdf}. Home: every motor at 0" in " ".join(capsys.readouterr().out.split())
    main(["check", str(arm), "--home", "up"])
    assert f"SRDF: {srdf}. Home: its pose 'up' (line 2)." in " ".join(capsys.readouterr().out.split())
    assert main(["check", str(arm), "--home", "upp"]) == 2
    assert "Did you mean 'up'? Valid: down, up, zero." in capsys.readouterr().err


def test_corners_are_a_number_or_all(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", str(foreign("kuka_iiwa/model.urdf")), "--corners", "all"]) == 0
    assert "stand out" not in capsys.readouterr().out
    assert main(["check", str(foreign("kuka_iiwa/model.urdf")), "--corners", "7"]) == 2
    assert "Give a whole number from 8 on" in capsys.readouterr().err
    with pytest.raises(SystemExit):
        main(["check", str(foreign("kuka_iiwa/model.urdf")), "--corners", "some"])
    assert "'some' is neither a whole number nor 'all'" in capsys.readouterr().err


@pytest.fixture
def touching(tmp_path: Path) -> Path:
    path = tmp_path / "toy.urdf"
    path.write_text(URDF.format("").replace('radius="0.06"', 'radius="0.12"').replace('"-90" upper="90"', '"-1" upper="1"'))
    return path


def test_write_srdf_prints_the_written_pairs_and_the_file(touching: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", str(touching), "--write-srdf"]) == 0
    said = capsys.readouterr().out
    words = " ".join(said.split())
    assert "toy.srdf: wrote 1 pair of links that touch at home or in all of 10000 random poses." in words
    assert "base fore Always" in words and "100 %" in words
    assert "With it toy.urdf does not touch itself at home; load_robot finds toy.srdf by its name." in words
    assert "overlap in every pose" not in said  # checked as it is read now
    main(["check", str(touching), "--write-srdf"])
    assert "nothing to add" in " ".join(capsys.readouterr().out.split())


def test_write_srdf_to_a_file_of_ones_own_and_as_json(touching: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "own.srdf"
    assert main(["check", str(touching), "--json", "--write-srdf", str(out)]) == 0
    printed = json.loads(capsys.readouterr().out)["srdf"]
    assert (printed["path"], printed["touching"], printed["found"]) == (str(out), 0, False)
    assert [(pair["first"], pair["second"], pair["reason"]) for pair in printed["pairs"]] == [("base", "fore", "Always")]


def test_write_srdf_that_cannot_is_one_line(touching: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", str(touching), "--write-srdf", str(tmp_path / "no" / "toy.srdf")]) == 2
    assert "cannot be written" in capsys.readouterr().err


def test_write_srdf_of_a_zero_position_file_prints_the_lines_for_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    ball = ARM.replace("<marker", '<sphere name="ball" radius="0.35"/><marker')
    assert main(["check", str(robot_file(tmp_path, *ball.splitlines())), "--write-srdf"]) == 1
    assert ' <ignore first="base" second="bend"/>\n' in capsys.readouterr().out
