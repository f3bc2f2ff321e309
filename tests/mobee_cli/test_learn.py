# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import json
import tomllib
from pathlib import Path

import pytest

from mobee.robot.load import load_robot
from mobee.store import TransitionStore
from mobee_cli.__main__ import main

ARM = """
<robot name="Tiny Arm"><link name="base"/>
<link name="upper"><collision><origin xyz="0 0 0.15"/><geometry><cylinder radius="0.03" length="0.2"/></geometry></collision></link>
<link name="lower"><collision><origin xyz="0 0 0.15"/><geometry><cylinder radius="0.03" length="0.2"/></geometry></collision></link>
<joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 1 0"/>
<limit lower="-1" upper="1" velocity="1" effort="9"/></joint>
<joint name="elbow" type="revolute"><parent link="upper"/><child link="lower"/><origin xyz="0 0 0.3"/><axis xyz="0 1 0"/>
<limit lower="-2" upper="2" velocity="1" effort="9"/></joint>
</robot>
"""


@pytest.fixture
def arm(tmp_path: Path) -> Path:
    path = tmp_path / "arm.urdf"
    path.write_text(ARM)
    return path


def learned(arm: Path, *options: str) -> int:
    return main(["learn", "--robot", str(arm), "--store", str(arm.with_name("out.sqlite")), *options])


def test_it_learns_on_and_its_file_can_be_planned_with(arm: Path, capsys: pytest.CaptureFixture[str]) -> None:
    store = arm.with_name("out.sqlite")
    assert learned(arm, "--transitions", "12", "--json") == 0
    first = json.loads(capsys.readouterr().out)
    assert (first["transitions"], first["agents"]["arm"]["states"]) == (12, 9)
    with TransitionStore(store, "arm", read_only=True) as kept:
        before = kept.load()
    assert learned(arm, "--transitions", "20") == 0
    said = capsys.readouterr().out
    assert "8 transitions" in said and all(len(line) <= 80 for line in said.splitlines()[:-1])
    with TransitionStore(store, "arm", read_only=True) as kept:
        assert kept.load()[:12] == before and len(kept.load()) == 20
    assert main(["plan", "--run", str(store), "--to", "0", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["path"][-1] == 0


def test_the_scenario_beside_it_names_robot_agents_and_transitions(arm: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert learned(arm, "--transitions", "3", "--explorer", "least_tried") == 0
    scenario = tomllib.loads(arm.with_name("out.toml").read_text())
    assert scenario["shared"]["robot"] == "out.xml"
    agent = scenario["services"]["agent_arm"]
    assert (agent["joints"], agent["continues"], agent["explorer"]) == (["shoulder", "elbow"], "out.sqlite", "least_tried")
    assert load_robot(arm.with_name("out.xml")).parts.keys() == {"arm"}


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (["--part", "arm"], "--part arm: give a name"),
        (["--part", "arm=shoulder", "--part", "arm=elbow"], "--part arm=elbow: arm is given twice"),
        (["--part", "arm=shoulder,elbw"], "Did you mean 'elbow'"),
        (["--explorer", "curios"], "Did you mean 'curious'"),
        (["--robot", "nothing.urdf"], "no such file"),
        (["--store", "x.db"], "must end in .sqlite"),
    ],
)
def test_mistakes_are_answered_in_one_line(arm: Path, options: list[str], says: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert learned(arm, "--transitions", "3", *options) == 2
    said = capsys.readouterr().err
    assert says in said and said.count("\n") == 1


def test_a_file_of_other_settings_is_not_continued(arm: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert learned(arm, "--transitions", "3") == 0
    assert learned(arm, "--transitions", "6", "--explorer", "random") == 2
    assert 'has explorer = "curious" on record, now "random"' in capsys.readouterr().err


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir() if path.is_file() and not path.name.endswith("-lock")}


@pytest.mark.parametrize(
    "options",
    [
        ["--explorer", "random"],
        ["--seed", "1"],
        ["--seed", "-1"],
        ["--robot", "katana", "--part", "arm_2=arm_0"],
        ["--part", "elbow=elbow"],
    ],
)
def test_a_refused_command_leaves_the_files_of_the_store_as_they_are(
    arm: Path, options: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert learned(arm, "--transitions", "3") == 0
    capsys.readouterr()
    before = contents(arm.parent)
    assert learned(arm, "--transitions", "6", *options) == 2
    assert capsys.readouterr().err.count("\n") == 1
    assert contents(arm.parent) == before


@pytest.mark.parametrize("robot", ["icub", "katana"])
@pytest.mark.parametrize("options", [["--seed", "-1"], ["--explorer", "curios"]])
def test_a_refused_command_makes_no_files(tmp_path: Path, robot: str, options: list[str]) -> None:
    assert main(["learn", "--robot", robot, "--transitions", "3", "--store", str(tmp_path / "new" / "out.sqlite"), *options]) == 2
    assert list(tmp_path.iterdir()) == []


def test_a_store_that_is_no_database_gets_no_scenario_beside_it(arm: Path) -> None:
    arm.with_name("out.sqlite").write_text("mine " * 1000)
    before = contents(arm.parent)
    assert learned(arm, "--transitions", "3") == 2
    assert contents(arm.parent) == before


def test_the_transitions_of_two_robots_are_not_mixed(arm: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert learned(arm, "--transitions", "3") == 0
    before = contents(arm.parent)
    assert learned(arm, "--transitions", "6", "--robot", "icub", "--part", "head=neck_yaw,neck_pitch") == 2
    assert "has transitions of robot 'Tiny Arm', not 'icub'" in capsys.readouterr().err
    assert contents(arm.parent) == before


@pytest.mark.parametrize("name", ["out.xml", "out.toml"])
def test_a_file_that_it_has_not_written_is_not_replaced(arm: Path, name: str, capsys: pytest.CaptureFixture[str]) -> None:
    arm.with_name(name).write_text("mine")
    assert learned(arm, "--transitions", "3") == 2
    assert f"{name} exists, although there is no" in capsys.readouterr().err
    assert contents(arm.parent) == {"arm.urdf": ARM.encode(), name: b"mine"}


def test_the_robot_file_that_it_reads_is_not_replaced(arm: Path) -> None:
    assert learned(arm, "--transitions", "3") == 0
    robot = arm.with_name("out.xml")
    robot.write_text(mine := robot.read_text() + "<!-- mine -->\n")
    assert learned(arm, "--transitions", "6", "--robot", str(robot)) == 0
    assert robot.read_text() == mine


@pytest.mark.parametrize("edit", [("A curious", "My"), ("[services.monitor]", "# no page"), ("title", "}")])
def test_an_edited_scenario_is_kept_and_named(arm: Path, edit: tuple[str, str], capsys: pytest.CaptureFixture[str]) -> None:
    assert learned(arm, "--transitions", "3") == 0
    scenario = arm.with_name("out.toml")
    scenario.write_text(mine := "# mine\n" + scenario.read_text().replace(*edit))
    capsys.readouterr()
    assert learned(arm, "--transitions", "6") == 0
    assert scenario.read_text() == mine
    assert capsys.readouterr().err == f"{scenario} was edited, and is kept as it is.\n"


def test_files_whose_meaning_was_not_edited_are_kept_silently(arm: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert learned(arm, "--transitions", "3") == 0
    robot, scenario = arm.with_name("out.xml"), arm.with_name("out.toml")
    robot.write_text(robot.read_text() + "<!-- mine -->\n")
    scenario.write_text(scenario.read_text() + "# mine\n")
    before = [robot.read_bytes(), scenario.read_bytes()]
    capsys.readouterr()
    assert learned(arm, "--transitions", "6") == 0
    assert capsys.readouterr().err == "" and [robot.read_bytes(), scenario.read_bytes()] == before


@pytest.mark.parametrize(
    "edit", [('home="0"', 'home="5"', "out.xml has another robot than this command learns with: it was edited"), ("<", "", "out.xml")]
)
def test_an_edited_robot_is_refused_and_kept(arm: Path, edit: tuple[str, str, str], capsys: pytest.CaptureFixture[str]) -> None:
    assert learned(arm, "--transitions", "3") == 0
    robot = arm.with_name("out.xml")
    robot.write_text(robot.read_text().replace(*edit[:2]))
    before = contents(arm.parent)
    capsys.readouterr()
    assert learned(arm, "--transitions", "6") == 2
    said = capsys.readouterr().err
    assert edit[2] in said and said.count("\n") == 1
    assert contents(arm.parent) == before


def test_a_store_in_a_new_folder_is_made(arm: Path) -> None:
    assert learned(arm, "--transitions", "3", "--store", str(arm.parent / "new" / "out.sqlite")) == 0
    assert {"out.sqlite", "out.toml", "out.xml"} <= contents(arm.parent / "new").keys()
