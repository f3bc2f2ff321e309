# SPDX-License-Identifier: Apache-2.0
"""`mobee reach --offline`, and what the verb refuses."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mobee import Lattice, Model, OfflinePlant, ReachTarget, load_robot, load_world
from mobee.learning.reaching.reach_agent import ReachAgent
from mobee.learning.reaching.store import ReachStore
from mobee.store import STORE
from mobee_cli.__main__ import main
from tests.services.robots import chain

ROBOT = load_robot("icub")
HOME = Model(ROBOT).evaluate(ROBOT.home)


def reach(*words: str, capsys: pytest.CaptureFixture[str]) -> tuple[int, dict[str, Any]]:
    code = main(["reach", "--offline", "--json", *words])
    return code, dict(json.loads(capsys.readouterr().out))


def place(position: np.ndarray) -> list[str]:
    return ["--target", *(f"{x:.4f}" for x in position)]


@pytest.mark.parametrize("side", ["left", "right"])
def test_what_it_says_fits_together(side: str, capsys: pytest.CaptureFixture[str]) -> None:
    at = HOME.position(f"{side}_palm")
    code, result = reach(*place(at), "--part", f"{side}_arm", capsys=capsys)
    assert (code, result["marker"]) == (0 if result["from_surface"] <= 0.02 else 1, f"{side}_palm")
    assert result["reached"] == (code == 0)
    assert result["error"] == pytest.approx(np.linalg.norm(np.array(result["position"]) - result["target"]["position"]))
    assert result["from_surface"] == pytest.approx(max(result["error"] - 0.05, 0.0))
    assert result["reward"] == pytest.approx(1.0 / (1.0 + result["error"] / 0.01))
    assert result["nearest"]["distance"] < 1e-4
    assert result["duration"] > 1.0
    assert (result["path"], result["expected_reward"], result["first_motion"]) == ([], None, None)


def test_a_palm_that_is_to_face_the_target_says_how_well_it_does(capsys: pytest.CaptureFixture[str]) -> None:
    words = ["--target", "-0.3", "0.2", "0.1", "--world", "none", "--facing"]
    code, result = reach(*words, capsys=capsys)
    assert code == 0 and result["angle"] < np.deg2rad(5.0)
    assert main(["reach", "--offline", *words]) == 0
    assert "deg away from the target." in capsys.readouterr().out


def test_a_target_out_of_reach_is_reported_with_the_nearest_place(capsys: pytest.CaptureFixture[str]) -> None:
    code, result = reach("--target", "-3", "0.2", "0.1", capsys=capsys)
    assert (code, result["reached"]) == (1, False)
    assert 2.0 < result["nearest"]["distance"] < result["error"]
    np.testing.assert_allclose(np.linalg.norm(np.array(result["nearest"]["position"]) - [-3.0, 0.2, 0.1]), result["nearest"]["distance"])
    assert main(["reach", "--offline", "--target", "-3", "0.2", "0.1"]) == 1
    said = capsys.readouterr().out
    assert "right_palm did not reach the target at (-3.000, 0.200, 0.100)" in said
    flat = " ".join(said.split())
    assert "The target is out of reach of right_arm: the nearest position that right_palm can come to is" in flat
    assert "give a position with --target X Y Z" in flat
    assert max(map(len, said.splitlines())) <= 80


def test_an_object_of_the_world_is_reached_for_by_name(capsys: pytest.CaptureFixture[str]) -> None:
    _, result = reach("--object", "ball", capsys=capsys)
    assert result["target"] == {"position": [-0.35, 0.0, -0.07], "radius": 0.03, "aim": "surface"}


def test_an_object_inside_the_body_is_refused_as_a_place_is(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "pill.xml").write_text('<World name="pill"><sphere name="pill" radius="0.01" pz="0.1" role="target"/></World>')
    assert main(["reach", "--offline", "--object", "pill", "--world", str(tmp_path / "pill.xml")]) == 2
    assert "is inside the robot's own torso_2" in capsys.readouterr().err


@pytest.fixture(scope="module")
def learned(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run in which the right arm has learned a little."""
    folder = tmp_path_factory.mktemp("run")
    plant = OfflinePlant(Model(ROBOT, load_world("table")), active=["right_arm"])
    space = Lattice(ROBOT, ["r_shoulder_pitch", "r_shoulder_roll", "r_shoulder_yaw", "r_elbow"], neighbours=16)
    with ReachStore(folder / STORE, "right_arm") as store:
        ReachAgent(space, plant, marker="right_palm", store=store).learn([ReachTarget(np.array([-0.3, 0.3, 0.1]))], 12)
    return folder


def test_a_run_says_from_which_state_and_what_to_expect(learned: Path, capsys: pytest.CaptureFixture[str]) -> None:
    before = (learned / STORE).read_bytes()
    _, result = reach("--target", "-0.3", "0.3", "0.1", "--run", str(learned), capsys=capsys)
    assert len(result["path"]) >= 1 and all(0 <= state < 81 for state in result["path"])
    assert 0.0 < result["expected_reward"] <= 1.0
    main(["reach", "--offline", "--target", "-0.3", "0.3", "0.1", "--run", str(learned / STORE)])
    said = capsys.readouterr().out
    assert f"{result['expected_reward']:.2f} expected" in said and max(map(len, said.splitlines())) <= 80
    assert (learned / STORE).read_bytes() == before


def test_a_run_that_does_not_fit_is_refused_in_one_line(learned: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for words, says in (
        (["--part", "left_arm"], "Valid: right_arm"),
        (["--marker", "right_elbow"], "has learned to reach with 'right_palm', not with 'right_elbow'"),
    ):
        assert main(["reach", "--offline", "--target", "-0.3", "0.3", "0.1", "--run", str(learned), *words]) == 2
        said = capsys.readouterr().err
        assert says in said and said.count("\n") == 1


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["--target", "nan", "0", "0"], "three finite numbers"),
        (["--target", "0", "0", "0", "--radius", "-1"], "radius -1.0"),
        (
            ["--target", "0", "0", "0.1"],
            "is inside the robot's own torso_2: choose a place outside its body; the nearest to which right_arm",
        ),
        (["--target", "-0.3", "0.2", "0.1", "--part", "right_amr"], "Did you mean 'right_arm'?"),
        (
            ["--target", "-0.3", "0.2", "0.1", "--part", "right_arm", "--marker", "left_palm"],
            "right_arm does not move the marker 'left_palm'. Valid: right_elbow",
        ),
        (["--object", "balll"], "Did you mean 'ball'?"),
        (["--object", "ball", "--radius", "0.1"], "--radius 0.1: only valid with --target"),
    ],
)
def test_an_invalid_reach_target_is_refused_in_one_line(words: list[str], says: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["reach", "--offline", *words]) == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert says in said.err
    assert said.err.count("\n") == 1


@pytest.mark.parametrize(
    ("words", "marker", "part", "why"),
    [
        ([], "right_palm", "right_arm", "the palm nearer to the target at home"),
        (["--marker", "left_palm"], "left_palm", "left_arm", "the part with the most motors that move it"),
        (["--part", "torso"], "right_palm", "torso", "the marker of torso"),
        (["--part", "right_arm", "--marker", "right_elbow"], "right_elbow", "right_arm", ""),
    ],
)
def test_what_reaches_is_chosen_and_the_choice_is_printed(
    words: list[str], marker: str, part: str, why: str, capsys: pytest.CaptureFixture[str]
) -> None:
    main(["reach", "--offline", "--target", "-0.3", "0.2", "0.1", *words])
    said = capsys.readouterr().out
    assert " ".join(said.split()).startswith(f"Reaching with {marker}, moved by part {part}: {why}" if why else f"{marker} ")
    assert max(map(len, said.splitlines())) <= 80


def test_the_left_palm_reaches_for_targets_on_the_left(capsys: pytest.CaptureFixture[str]) -> None:
    _, result = reach("--target", "-0.3", "-0.2", "0.1", capsys=capsys)
    assert (result["marker"], result["part"]) == ("left_palm", "left_arm")


@pytest.fixture
def arm(tmp_path: Path) -> Path:
    (tmp_path / "arm.urdf").write_text(chain(6))
    return tmp_path / "arm.urdf"


def test_a_robot_of_ones_own_reaches_with_its_end_and_without_a_table(arm: Path, capsys: pytest.CaptureFixture[str]) -> None:
    robot = load_robot(arm)
    at = Model(robot).evaluate(robot.home + 0.3).position("link_5")
    code, result = reach(*place(at), "--robot", str(arm), "--stay", capsys=capsys)
    assert (code, result["marker"], result["part"]) == (0, "link_5", "all")
    assert main(["reach", "--offline", "--object", "ball", "--robot", str(arm)]) == 2
    assert "unknown target of the offline world 'ball'. Valid: none." in capsys.readouterr().err
    _, result = reach("--object", "ball", "--robot", str(arm), "--world", "table", capsys=capsys)
    assert result["target"]["position"] == [-0.35, 0.0, -0.07]


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["--robot", "{arm}", "--marker", "left_palm"], "unknown marker 'left_palm'. Valid: link_5."),
        (["--robot", "{arm}", "--part", "left_arm"], "unknown part 'left_arm'. Valid: all."),
        (["--robot", "ikub"], "Did you mean 'icub'?"),
        (["--robot", "no.urdf"], "no.urdf: no such file"),
        (["--world", "tabel"], "Did you mean 'table'?"),
        (["--field", "0.03"], "field= is for URDF and MJCF files"),
    ],
)
def test_a_robot_or_world_that_cannot_be_used_is_refused_in_one_line(
    arm: Path, words: list[str], says: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["reach", "--offline", "--target", "-0.1", "0.1", "0.6", *(word.replace("{arm}", str(arm)) for word in words)]) == 2
    said = capsys.readouterr()
    assert said.out == "" and says in said.err and said.err.count("\n") == 1


def test_the_robot_of_the_running_system_cannot_be_chosen(capsys: pytest.CaptureFixture[str]) -> None:
    for words in (["--robot", "katana"], ["--world", "none"], ["--field", "0.03"]):
        assert main(["reach", "--target", "-0.3", "0.2", "0.1", *words]) == 2
        assert f"{words[0]} {words[1]}: only valid with --offline" in capsys.readouterr().err


def test_the_robot_of_a_run_is_that_of_its_settings(arm: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run = arm.parent / "run"
    run.mkdir()
    robot = load_robot(arm)
    space = Lattice(robot, ["joint_1", "joint_3"], neighbours=4)
    with ReachStore(run / STORE, "all") as store:
        agent = ReachAgent(space, OfflinePlant(Model(robot)), marker="link_5", store=store)
        agent.learn([ReachTarget(np.array([0.3, 0.0, 0.6]))], 2)
    (run / "scenario.toml").write_text(f'[services.controller]\nrobot = "{arm}"\n')
    _, result = reach("--target", "0.3", "0.0", "0.6", "--run", str(run), capsys=capsys)
    assert (result["marker"], result["part"]) == ("link_5", "all") and result["expected_reward"] is not None


def test_without_a_system_the_verb_says_how_to_start_one(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["reach", "--target", "-0.3", "0.2", "0.1", "--endpoint", "tcp/127.0.0.1:1"]) == 3
    assert "mobee launch" in capsys.readouterr().err
