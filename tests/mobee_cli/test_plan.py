# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mobee import CuriousAgent, Lattice, Model, OfflinePlant, load_robot
from mobee.learning.tabular import TabularPlant
from mobee.store import STORE, TransitionStore
from mobee_cli.__main__ import main
from tests.services.robots import chain

ROBOT = load_robot("icub")
TORSO = Lattice(ROBOT, ["torso_yaw", "torso_roll", "torso_pitch"], neighbours="equidistant")


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A torso that knows its space, where nothing ever gets into state 1."""
    folder = tmp_path_factory.mktemp("run")
    stays = np.arange(27)[:, None].repeat(TORSO.goals.shape[1], axis=1)
    outcomes = np.where(TORSO.goals == 1, stays, TORSO.goals)[:, :, None]
    probabilities = (TORSO.goals >= 0)[:, :, None].astype(float)
    with TransitionStore(folder / STORE, "torso") as store:
        CuriousAgent(TORSO, TabularPlant(TORSO, np.maximum(outcomes, 0), probabilities, start=13), store=store).run(600)
    return folder


def planned(run: Path, *words: str, capsys: pytest.CaptureFixture[str]) -> dict[str, Any]:
    assert main(["plan", "--run", str(run), "--json", *words]) == 0
    return dict(json.loads(capsys.readouterr().out))


def test_the_path_avoids_actions_that_never_succeeded_and_names_them(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["plan", "--run", str(run), "--from", "0", "--to", "2"]) == 0
    first, *steps, mean, shortest, failing, avoided = capsys.readouterr().out.splitlines()
    assert first.startswith("torso, by 600 transitions: from state 0 to 2 by 4 actions, all as expected with probability 0.9")
    assert len(steps) == 4 and all("->" in line and "tried" in line for line in steps)
    assert mean.startswith("With a new plan after each action, 4.")
    assert shortest.startswith("If every action succeeded, 2 would be enough. Expected to fail")
    assert failing.split()[:3] == ["0", "->", "1"] and float(failing.split()[3]) < 0.1
    assert avoided.startswith("Avoided states (probability of passing): 1 (0.0")


def test_a_plan_that_will_fail_says_so_and_names_better_goals(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["plan", "--run", str(run), "--from", "0", "--to", "1"]) == 0
    last = capsys.readouterr().out.splitlines()[-1]
    assert last.startswith("This plan will probably fail: ")
    goals = {int(goal): float(chance) for goal, chance in re.findall(r"(\d+) \((0\.\d+|1\.00)\)", last)}
    assert len(goals) == 3 and 1 not in goals and min(goals.values()) > 0.9


def test_as_json_with_poses(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    plan = planned(run, "--from", "0", "--to", "2", capsys=capsys)
    path = plan["path"]
    assert isinstance(path, list) and (path[0], path[-1], len(path)) == (0, 2, 5) and 1 not in path
    assert plan["goals"] == path[1:]
    np.testing.assert_allclose(plan["poses"], TORSO.samples[path])
    assert plan["success"] == pytest.approx(np.prod(plan["probabilities"]))
    assert (plan["agent"], plan["transitions"], plan["shortest"], plan["avoided"][0]["state"]) == ("torso", 600, 2, 1)
    assert [(one["state"], one["goal"]) for one in plan["distrusted"]] == [(0, 1)]


def test_a_place_may_be_given_as_angles_and_the_start_left_out(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    angles = [f"{angle:.2f}" for angle in TORSO.samples[26] + 0.05]
    plan = planned(run, "--to", *angles, "--agent", "torso", capsys=capsys)
    with TransitionStore(run / STORE, "torso") as store:
        assert plan["path"][0] == store.load()[-1].s_next
    assert plan["path"][-1] == 26
    assert main(["plan", "--run", str(run), "--from", "0", "--to", *angles]) == 0
    assert capsys.readouterr().out.startswith(f"{' '.join(angles)} rad is in state 26.\ntorso, by 600 transitions: from state 0 to 26")
    here = str(plan["path"][0])
    assert main(["plan", "--run", str(run / STORE), "--to", here]) == 0
    assert capsys.readouterr().out == f"torso, by 600 transitions: state {here} is the goal already.\n"


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["--to", "27"], "torso has no such state. Valid are 0 to 26"),
        (["--to", "0.1", "0.2"], "give the 3 joints (torso_yaw, torso_roll, torso_pitch)"),
        (["--to", "there"], "'there' is not valid"),
        (["--to", "nan", "0", "0"], "not finite"),
        (["--to", "0", "2", "0"], "torso_roll cannot be at 2 rad: valid is -0.524 to 0.524. Give one state only."),
        (["--to", "0", "0", "-0.5"], "torso_pitch cannot be at -0.5 rad"),
        (["--to", "3", "--agent", "tors"], "Did you mean 'torso'?"),
        (["--to", "3", "--robot", "icub_2014"], "of robot 'icub', given 'icub_2014'"),
        (["--to", "3", "--discount", "1"], "discount=1.0"),
    ],
)
def test_an_impossible_plan_is_refused_in_one_line(run: Path, words: list[str], says: str, capsys: pytest.CaptureFixture[str]) -> None:
    code = main(["plan", "--run", str(run), *words])
    error = capsys.readouterr().err
    assert code == 2
    assert says in error and error.count("\n") == 1


@pytest.fixture
def own(tmp_path: Path) -> Path:
    """A run of an agent of a robot that does not come with mobee; its folder also holds the robot's file."""
    (tmp_path / "arm.urdf").write_text(chain(3))
    robot = load_robot(tmp_path / "arm.urdf")
    space = Lattice(robot, robot.motors, neighbours=8)
    with TransitionStore(tmp_path / STORE, "all") as store:
        CuriousAgent(space, OfflinePlant(Model(robot), seed=0), store=store).run(3)
    return tmp_path


def test_a_run_whose_robot_is_not_known_says_how_to_name_it(own: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["plan", "--run", str(own), "--to", "0"]) == 2
    said = capsys.readouterr().err
    assert "unknown robot 'chain'" in said and said.endswith("name it with --robot FILE.\n")
    assert planned(own, "--to", "0", "--robot", str(own / "arm.urdf"), capsys=capsys)["path"][-1] == 0
    assert main(["plan", "--run", str(own), "--to", "0", "--field", "0.02"]) == 2
    assert "--field 0.02: only valid with --robot FILE" in capsys.readouterr().err


def test_the_settings_of_a_run_name_its_robot(own: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (own / "scenario.toml").write_text(f'title = ""\n[services.model]\nrobot = "{own}/arm.urdf"\n')
    assert planned(own, "--to", "0", capsys=capsys)["path"][-1] == 0
    (own / "arm.urdf").rename(own / "moved.urdf")
    assert main(["plan", "--run", str(own), "--to", "0"]) == 2
    assert "it does not exist: name it with --robot FILE" in capsys.readouterr().err
    (own / "scenario.toml").write_text("title = ")
    assert main(["plan", "--run", str(own / STORE), "--to", "0"]) == 2
    assert "the settings of the run cannot be read" in capsys.readouterr().err


def test_a_run_without_transitions_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["plan", "--run", str(tmp_path), "--to", "0"]) == 2
    assert f"{tmp_path / STORE}: there is no such file; runs of `mobee launch`" in capsys.readouterr().err
    TransitionStore(tmp_path / STORE, "torso").close()
    assert main(["plan", "--run", str(tmp_path), "--to", "0"]) == 2
    assert "holds no transitions yet" in capsys.readouterr().err
