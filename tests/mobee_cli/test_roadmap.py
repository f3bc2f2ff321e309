# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

import mobee
from mobee.roadmap.roadmap import Roadmap
from mobee_cli.__main__ import main
from mobee_cli.errors import UserError
from mobee_cli.roadmap.live import Running, in_running_world
from mobee_cli.roadmap.query import find_path
from mobee_cli.roadmap.show import TOUR_PLACES, marker_of, tour
from services.common.service import Service
from tests.services.robots import chain

MOTORS = ("r_shoulder_pitch", "r_shoulder_roll")
SIDE, STEP, TURN = 5, 0.1, 0.2


def square(folder: Path, name: str = "map.npz", block: bool = False) -> Path:
    """A map over two motors of the right arm, away from the body; `block`: with something in the middle of its world."""
    robot, world = mobee.load_robot("icub"), mobee.World()
    model = mobee.Model(robot, world)
    start = robot.home.copy()
    start[robot.motor_index("r_elbow")] = 0.8
    rows, columns = (one.ravel() for one in np.meshgrid(range(SIDE), range(SIDE), indexing="ij"))
    q = np.repeat(start[None], SIDE**2, axis=0)
    q[:, robot.motor_index(MOTORS[0])] = -0.9 + TURN * rows
    q[:, robot.motor_index(MOTORS[1])] = 0.6 + TURN * columns
    if block:
        world.add("block", mobee.sphere(0.01), position=model.evaluate(q[12]).position("right_palm"))
    edges = np.argwhere(np.triu(np.abs(rows[:, None] - rows) + np.abs(columns[:, None] - columns) == 1))
    y = STEP * np.stack([rows, columns], axis=1).astype(float)
    moved = [*MOTORS, "r_elbow"]
    settings = {"names": ["yaw", "elbow"], "units": ["rad", ""], "motors": moved, "box": [[0.0, 0.4], [0.0, 0.4]], "method": "by hand"}
    Roadmap(model, q, y, edges, np.array([STEP, STEP]), settings).save(folder / name)
    return folder / name


@pytest.fixture(scope="module")
def free(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return square(tmp_path_factory.mktemp("maps"))


@pytest.fixture(scope="module")
def blocked(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return square(tmp_path_factory.mktemp("maps"), block=True)


Say = Callable[..., tuple[int, str, str]]


@pytest.fixture
def say(capsys: pytest.CaptureFixture[str]) -> Say:
    """Run `mobee roadmap`; return its exit code, its output and its errors."""

    def run(*words: object) -> tuple[int, str, str]:
        try:
            code = main(["roadmap", *map(str, words)])
        except SystemExit as end:
            code = int(end.code or 0)
        printed = capsys.readouterr()
        assert all(len(line) <= 80 for line in printed.out.splitlines() if not line.lstrip().startswith(('"', "{", "[")))
        return code, printed.out, printed.err

    return run


def _flat(text: str) -> str:
    """Without the breaks of lines, which come where the paths in it are long."""
    return " ".join(text.split())


def test_show_describes_a_map_and_draws_it(say: Say, free: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    drawn: list[Any] = []
    monkeypatch.setattr("mobee.rendering.sheet.marker_cloud", lambda *given, **_: drawn.append(given) or given[3])
    code, out, _ = say("show", free, "--check", "--picture", tmp_path / "a.png")
    lines = out.splitlines()
    assert code == 0
    assert "25 poses, 40 edges." in _flat(out) and "r_shoulder_pitch, r_shoulder_roll, r_elbow" in _flat(out)
    assert next(line for line in lines if line.startswith("yaw [rad]")).split()[2:] == ["0.1", "0.000", "0.400", "0", "0.4"]
    assert "None of the 40 edges has contacts" in _flat(out)
    assert f"right_palm in all poses: {tmp_path}" in _flat(out)
    assert drawn[0][1].shape == (25, 41) and drawn[0][2:] == ("right_palm", tmp_path / "a.png")


def test_all_of_the_robot_is_checked_along_the_edges_not_only_the_marker(
    say: Say, free: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("mobee.rendering.sheet.marker_cloud", lambda *given, **_: given[3])
    trm = mobee.load_roadmap(free)
    at = trm.model.evaluate(trm.q[2:4].mean(axis=0)).position("right_palm")
    trm.model.world.add("block", mobee.sphere(0.002), position=at)  # between poses, not in one
    trm.save(tmp_path / "map.npz")
    code, out, _ = say("show", tmp_path / "map.npz", "--check", "--marker", "left_palm", "--json")
    assert code == 0 and json.loads(out)["touching"] >= 1


def test_a_marker_whose_name_only_begins_the_name_of_a_coordinate_is_not_that_of_the_map(free: Path) -> None:
    trm = mobee.load_roadmap(free)
    robot = trm.model.robot
    base = replace(robot.marker("left_eye"), name="ya")  # the coordinates are yaw and elbow
    trm = replace(trm, model=mobee.Model(replace(robot, markers={**robot.markers, "ya": base})))
    assert marker_of(trm) == "right_palm"
    assert marker_of(replace(trm, settings=trm.settings | {"names": ["ya x", "elbow"]})) == "ya"


def test_a_tour_of_the_map_goes_over_its_edges_from_end_to_end(free: Path) -> None:
    trm = mobee.load_roadmap(free)
    stretches = tour(trm)
    moves = [trm.model.robot.motor_index(name) for name in MOTORS]
    seen = np.concatenate([one.poses for one in stretches])[:, moves]
    assert len(stretches) == TOUR_PLACES - 1 and all("yaw" in one.title and "elbow" in one.title for one in stretches)
    assert np.abs(np.diff(seen, axis=0)).max() < 0.05
    np.testing.assert_allclose([seen.min(axis=0), seen.max(axis=0)], [[-0.9, 0.6], [-0.1, 1.4]], atol=1e-5)


def test_query_prints_the_path(say: Say, free: Path) -> None:
    code, out, _ = say("query", free, "--from", 0, 0, "--to", 0.4, 0.2)
    assert code == 0
    assert "To yaw 0.4, elbow 0.2, 0.00 spacings from the goal: over 7 poses" in _flat(out)
    assert "The path has no contacts" in _flat(out)
    code, out, _ = say("query", free, "--from", 0, 0, "--to", 0.4, 0.2, "--json")
    found = json.loads(out)
    assert code == 0 and found["free"] and found["vertices"][0] == 0 and found["vertices"][-1] == 22
    assert found["length"] == pytest.approx(1.2) and len(found["poses"]) == 7


def test_a_path_from_home_begins_at_home(say: Say, free: Path) -> None:
    robot = mobee.load_robot("icub")
    found = json.loads(say("query", free, "--to", 0, 0, "--json")[1])
    assert found["poses"][0] == robot.home.tolist() and found["entry"] > 0.2
    again = json.loads(say("query", free, "--to", 0, 0, "--from", *robot.home, "--json")[1])
    assert again["poses"] == found["poses"]


@pytest.mark.parametrize("names", [["right_palm x", "elbow"], ["yaw", "elbow"]])
def test_the_path_moves_motors_that_carry_a_marker_of_the_map(free: Path, names: list[str]) -> None:
    trm = mobee.load_roadmap(free)
    robot = trm.model.robot
    trm = replace(trm, settings=trm.settings | {"names": names})
    torso, left = robot.motor_index("torso_yaw"), robot.motor_index("l_elbow")
    start = trm.q[0].copy()
    start[[torso, left]] += 0.15
    end = np.array(find_path(trm, start, [0.4, 0.2])["poses"][-1])
    assert end[left] == start[left]
    assert end[torso] == (trm.q[22, torso] if names[0] != "yaw" else start[torso])


def test_a_path_avoids_an_obstacle(say: Say, blocked: Path) -> None:
    code, out, _ = say("query", blocked, "--from", 0.2, 0.1, "--to", 0.2, 0.3)
    assert code == 0 and "The shortest path has contacts: this one avoids them." in _flat(out)


def test_an_obstacle_that_cannot_be_avoided_is_reported_with_exit_code_1(say: Say, blocked: Path) -> None:
    robot = mobee.load_robot("icub")
    start = mobee.load_roadmap(blocked).q[12]
    assert mobee.load_roadmap(blocked).model.evaluate(start).count and len(start) == len(robot.motors)
    code, out, _ = say("query", blocked, "--from", *start, "--to", 0.2, 0.3)
    assert code == 1 and "The path has contacts: no path without contacts: the straight lines" in _flat(out)
    code, out, err = say("play", blocked, "--from", *start, "--to", 0.2, 0.3)
    assert code == 1 and out == "" and "--anyway" in err


def test_play_arrives_offline(say: Say, free: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    drawn: list[Any] = []
    monkeypatch.setattr("mobee.rendering.sheet.filmstrip", lambda strips, path: drawn.extend(strips) or path)
    code, out, _ = say("play", free, "--from", 0, 0, "--to", 0.4, 0.2, "--picture", tmp_path / "film.png")
    assert code == 0
    assert out.startswith("Arrived at yaw 0.4, elbow 0.2 after ") and "No solids touched" in _flat(out)
    assert f"Filmstrip: {tmp_path}" in _flat(out) and drawn[0].motion.moved() == ("right_arm",)
    found = json.loads(say("play", free, "--from", 0, 0, "--to", 0.4, 0.2, "--json")[1])
    assert found["arrived"] and found["missing"] < 0.05 and found["solid"] == 0.0
    error = 1e3 * found["remaining_error"]
    assert f"the remaining error of right_palm is {error:.1f} mm (tolerance 10 mm)" in _flat(out)


def test_a_remaining_error_beyond_the_tolerance_is_no_arrival(say: Say, free: Path) -> None:
    code, out, _ = say("play", free, "--from", 0, 0, "--to", 0.4, 0.2, "--tolerance", 0.1)
    assert code == 1
    assert out.startswith("Did not arrive at yaw 0.4, elbow 0.2 after ") and "(tolerance 0.1 mm)" in _flat(out)


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (["query", "{map}", "--to", "9", "0"], "the nearest vertex"),
        (["query", "{map}", "--to", "0"], "it must be (2,) finite numbers: yaw, elbow"),
        (["query", "{map}", "--to", "0", "0", "--from", "1", "2", "3"], "give 2 task coordinates (yaw, elbow), or 41 motor positions"),
        (["query", "{map}", "--to", "0", "0", "--from", *["9"] * 41], "cannot be at 9 rad"),
        (["query", "no.npz", "--to", "0"], "no such file"),
        (["play", "{map}", "--to", "0", "0", "--speed", "2"], "--speed 2: must be above 0"),
        (["play", "{map}", "--to", "0", "0", "--gains", "soft"], "unknown gain set 'soft'"),
        (["play", "{map}", "--to", "0", "0", "--picture", "a.jpg"], "ends in .png"),
        (["show", "{map}", "--marker", "palm"], "unknown marker 'palm'"),
        (["show", "{map}", "--picture", "/nowhere/a.png"], "there is no folder /nowhere"),
        (["show", "{map}", "--robot", "icub_2014"], "made for robot"),
        (["query", "{map}", "--to", "0", "0", "--from", "nan", "0.1"], "'nan' is not a finite number"),
        (["play", "{map}", "--to", "inf", "0"], "'inf' is not a finite number"),
        (["play", "{map}", "--to", "0", "0", "--seed", "-1"], "must be a whole number, 0 or more"),
        (["build", "palm-down", "-o", "{map}.new.npz", "--seed", "-1"], "must be a whole number, 0 or more"),
        (["build", "palm-down", "--longest", "-1"], "--longest -1: must be finite and above 0, or 0 for no limit"),
        (["build", "palm-down", "-o", "{map}.new.npz", "--longest", "inf"], "--longest inf: must be finite and above 0"),
        (["build", "palm-dwn"], "Did you mean 'palm-down'?"),
        (["build", "no.py"], "there is no such file"),
        (["build", "palm-down", "-o", "/nowhere/a.npz"], "there is no folder /nowhere"),
    ],
)
def test_invalid_input_is_refused_in_one_line(say: Say, free: Path, words: list[str], text: str) -> None:
    code, out, err = say(*(word.replace("{map}", str(free)) for word in words))
    assert code == 2 and out == ""
    assert text in err and err.count("\n") == 1


@pytest.mark.parametrize("words", [["show", "--picture"], ["show", "--save"], ["play", "--to", "0", "0", "--picture"]])
def test_a_folder_cannot_be_written_as_a_file(say: Say, free: Path, words: list[str], tmp_path: Path) -> None:
    folder = tmp_path / ("a.rrd" if words[-1] == "--save" else "a.png")
    folder.mkdir()
    code, out, err = say(words[0], free, *words[1:], folder)
    assert code == 2 and out == ""
    assert f"{words[-1]} {folder}: cannot be written (Is a directory)" in err and err.count("\n") == 1


def test_the_result_of_a_motion_is_printed_if_its_picture_cannot_be_drawn(
    say: Say, free: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: Any) -> Path:
        raise OSError(28, "No space left on device", "film.png")

    monkeypatch.setattr("mobee.rendering.sheet.filmstrip", fail)
    code, out, err = say("play", free, "--from", 0, 0, "--to", 0.4, 0.2, "--picture", tmp_path / "film.png")
    assert code == 3 and out.startswith("Arrived at yaw 0.4") and "film.png cannot be read or written" in err


def test_live_the_ball_may_have_moved_but_not_the_table(free: Path) -> None:
    made = mobee.load_roadmap(free)
    made = replace(made, model=mobee.Model(made.model.robot, mobee.load_world("table")))

    def now(name: str) -> Running:
        world = mobee.load_world("table")
        world.move(name, position=world.objects[name].position + np.array([0.001, 0.0, 0.0]))
        return Running(made.model.robot, world, mobee.Gains.default(), cast("Service", None))

    vision = now("ball")
    assert in_running_world(made, vision, other_world=False).model.world is vision.world
    with pytest.raises(UserError, match=r"world \(table\) and of the running model's world \(table\) differ: build a map in that world"):
        in_running_world(made, now("table"), other_world=False)
    in_running_world(made, now("table"), other_world=True)


def test_without_a_system_live_says_so(say: Say, free: Path) -> None:
    code, _, err = say("play", free, "--to", 0, 0, "--live", "--endpoint", "tcp/127.0.0.1:1")
    assert code == 3 and "mobee launch" in err
    code, _, err = say("play", free, "--to", 0, 0, "--from", 0, 0, "--live", "--endpoint", "tcp/127.0.0.1:1")
    assert code == 2 and "begins where the robot is" in _flat(err)


def test_tasks_are_listed_with_their_figures(say: Say) -> None:
    code, out, _ = say("tasks")
    assert code == 0 and any(line.split()[:3] == ["pregrasp", "4.8", "pre-grasp"] for line in out.splitlines())


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("x = (\n", r"task.py:1: SyntaxError"),
        ("import mobee\n1 / 0\n", r"task.py:2: ZeroDivisionError"),
        ("x = 1\n", "no function example()"),
        ("def example():\n    return 1\n", "example() returned int"),
    ],
)
def test_an_invalid_task_file_is_refused_with_its_line(say: Say, tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / "task.py").write_text(text)
    code, out, err = say("build", tmp_path / "task.py")
    assert code == 2 and out == "" and message in err and err.count("\n") == 1


TASK = """
import mobee
from experiments.kit.roadmap_task import Example

def example():
    model = mobee.Model(mobee.load_robot("icub"))
    start = model.robot.home.copy()
    start[model.robot.motor_index("r_shoulder_roll")] = 0.9
    task = mobee.tasks.motors({"r_elbow": (0.5, 0.9), "r_shoulder_roll": (0.7, 1.0)})
    motors = ("r_elbow", "r_shoulder_roll")
    return Example("own", "", model, (mobee.costs.collision(), mobee.costs.home()), task, 0.1, motors, (), start=start)
"""


def test_a_map_of_a_task_of_ones_own_is_built_kept_and_played(say: Say, tmp_path: Path) -> None:
    (tmp_path / "own.py").write_text(TASK)
    path = tmp_path / "own.npz"
    code, out, _ = say("build", tmp_path / "own.py", "-o", path, "--method", "least_squares", "--neighbours", 4)
    assert code == 0 and "Made by method least_squares, seed 0, neighbours 4" in _flat(out)
    before = path.read_bytes()
    assert say("build", tmp_path / "own.py", "-o", path, "--method", "least_squares", "--neighbours", 4)[0] == 0
    assert path.read_bytes() == before
    code, _, err = say("build", tmp_path / "own.py", "-o", path, "--method", "least_squares")
    assert code == 2 and "differ in neighbours" in _flat(err)
    assert say("play", path, "--from", 0.6, 0.8, "--to", 0.8, 0.9)[0] == 0


TASK_OF_ANY_ROBOT = """
import mobee
from experiments.kit.roadmap_task import Example

def example(model):
    task = mobee.tasks.motors({"joint_1": (0.5, 0.9), "joint_3": (0.7, 1.0)})
    return Example("own", "", model, (mobee.costs.collision(), mobee.costs.home()), task, 0.1, ("joint_1", "joint_3"), ())
"""


@pytest.fixture
def arm(tmp_path: Path) -> Path:
    (tmp_path / "arm.urdf").write_text(chain(4))
    (tmp_path / "task.py").write_text(TASK_OF_ANY_ROBOT)
    return tmp_path / "arm.urdf"


def test_a_task_file_is_built_shown_asked_and_played_for_another_robot(
    say: Say, arm: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("mobee.rendering.sheet.marker_cloud", lambda *given, **_: given[3])
    path, robot = tmp_path / "task.npz", ("--robot", arm)
    assert say("build", tmp_path / "task.py", "-o", path, "--method", "least_squares", "--neighbours", 4, *robot)[0] == 0
    code, out, _ = say("show", path, *robot)
    assert code == 0 and "Robot chain" in _flat(out) and "(nothing)" in _flat(out) and "Picture of link_3" in _flat(out)
    code, out, _ = say("query", path, *robot, "--from", 0.6, 0.8, "--to", 0.8, 0.9)
    assert code == 0 and "The path has no contacts" in _flat(out)
    assert say("play", path, *robot, "--from", 0.6, 0.8, "--to", 0.8, 0.9)[0] == 0
    code, out, err = say("query", path, "--to", 0.8, 0.9)
    assert code == 2 and out == "" and "--robot FILE" in err


def test_a_map_of_a_robot_without_markers_is_described_and_not_played(say: Say, tmp_path: Path) -> None:
    text = TASK_OF_ANY_ROBOT.replace("joint_1", "arm_0").replace("joint_3", "arm_1").replace("(0.7, 1.0)", "(1.0, 1.3)")
    (tmp_path / "task.py").write_text(text)
    path = tmp_path / "task.npz"
    assert say("build", tmp_path / "task.py", "-o", path, "--method", "least_squares", "--robot", "katana")[0] == 0
    code, out, _ = say("show", path, "--robot", "katana", "--check")
    assert code == 0 and "None of the" in out and "No picture: robot 'katana400' has no markers" in _flat(out)
    code, out, err = say("play", path, "--robot", "katana", "--from", 0.6, 1.1, "--to", 0.8, 1.2)
    assert code == 2 and out == "" and "has no markers: add a <marker>" in _flat(err)


def test_a_path_is_checked_in_another_world(say: Say, arm: Path, tmp_path: Path) -> None:
    path, words = tmp_path / "task.npz", ("--from", 0.6, 0.8, "--to", 0.8, 0.9)
    assert say("build", tmp_path / "task.py", "-o", path, "--method", "least_squares", "--robot", arm)[0] == 0
    at = mobee.load_roadmap(path, robot=mobee.load_robot(arm)).model.evaluate(np.array([0.0, 0.8, 0.0, 0.9])).position("link_3")
    place = " ".join(f'p{axis}="{value:.4f}"' for axis, value in zip("xyz", at, strict=True))
    (tmp_path / "ball.xml").write_text(f'<World name="ball"><sphere name="ball" radius="0.1" {place}/></World>')
    code, out, _ = say("query", path, "--robot", arm, "--world", tmp_path / "ball.xml", *words)
    assert code == 1 and "The path has contacts" in out
    assert say("query", path, "--robot", arm, "--world", "none", *words)[0] == 0
    code, _, err = say("play", path, "--robot", arm, "--world", "none", "--live", "--to", 0.8, 0.9)
    assert code == 2 and "--world none: only valid offline" in err


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (["build", "palm-down", "--robot", "{arm}"], "the task 'palm-down' uses the markers and motors of the icub"),
        (["build", "palm-down", "--world", "none"], "--world none: the task 'palm-down'"),
        (["build", "{folder}/fixed.py", "--robot", "{arm}"], "fixed.py makes its own model; to use the option, write `def example(model)`"),
        (["build", "{folder}/many.py"], "many.py: example has 2 parameters"),
        (["build", "{folder}/task.py", "--robot", "no.urdf"], "no.urdf: no such file"),
        (["build", "{folder}/task.py", "--robot", "{arm}", "--world", "tabel"], "Did you mean 'table'?"),
        (["build", "{folder}/task.py", "-o", "{folder}/a.npz"], "unknown part or motor 'joint_1'"),
        (["build", "{folder}/wrong.py"], "wrong.py:3: ZeroDivisionError"),
        (["query", "{map}", "--to", "0", "0", "--field", "0.1"], "--field 0.1: only valid with --robot FILE"),
    ],
)
def test_a_robot_that_does_not_fit_is_refused_in_a_line(say: Say, free: Path, arm: Path, words: list[str], text: str) -> None:
    folder = arm.parent
    (folder / "fixed.py").write_text(TASK)
    (folder / "many.py").write_text("def example(model, world):\n    return None\n")
    (folder / "wrong.py").write_text("\ndef example(model):\n    return 1 / 0\n")
    code, out, err = say(*(word.format(arm=arm, folder=folder, map=free) for word in words))
    assert code == 2 and out == ""
    assert text in err and err.count("\n") == 1


def test_tasks_name_the_robot_they_need(say: Say) -> None:
    assert "All of them need the robot icub." in _flat(say("tasks")[1])
    assert {one["robot"] for one in json.loads(say("tasks", "--json")[1])} == {"icub"}


def test_build_takes_a_task_and_describes_the_map(say: Say, free: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    given: dict[str, Any] = {}

    def built(model: mobee.Model, **settings: Any) -> Roadmap:
        given.update(settings)
        settings["progress"](SimpleNamespace(vertices=3, evaluations=40, open=1, seconds=0.5))
        return mobee.load_roadmap(free)

    monkeypatch.setattr(mobee, "build_roadmap", built, raising=False)
    path = tmp_path / "own.npz"
    (tmp_path / "own.py").write_text("from experiments.claims.ch3_roadmaps.trm_tasks import palm_down as example\n")
    code, out, _ = say("build", tmp_path / "own.py", "-o", path, "--method", "nes", "--neighbours", 8, "--longest", 0, "--seed", 4)
    assert code == 0 and out.startswith(f"{path}"[:20])
    settings = given["settings"]
    assert (settings.method, settings.neighbours, settings.longest, given["seed"], given["file"]) == ("nes", 8, None, 4, path)
    assert given["spacing"] == 0.02 and given["task"].names == ("right_palm x", "right_palm y")


def test_an_interrupted_build_prints_how_to_continue(say: Say, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(model: mobee.Model, **settings: Any) -> Roadmap:
        settings["progress"](SimpleNamespace(vertices=30, evaluations=400, open=10, seconds=12.0))
        settings["file"].write_bytes(b"")
        raise KeyboardInterrupt

    monkeypatch.setattr(mobee, "build_roadmap", interrupted, raising=False)
    code, out, err = say("build", "palm-down", "-o", tmp_path / "map.npz")
    assert code == 130 and out == ""
    assert "interrupted at 30 vertices, 10 open" in err and "holds all but the last seconds of it; the same command resumes" in _flat(err)
