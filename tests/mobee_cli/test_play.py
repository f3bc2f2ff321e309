# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import json
import signal
import socket
import threading
import time
from pathlib import Path

import pytest

from experiments.kit.live.launch import free_endpoint
from mobee.errors import MobeeError
from mobee.rendering.mesh import read_pieces
from mobee.robot.load import load_robot
from mobee.store import TransitionStore
from mobee_cli.__main__ import main
from mobee_cli.playing.files import Files
from mobee_cli.playing.setup import PUBLISHED
from services.agents.config import Config as AgentConfig
from services.launcher.checks import check_robots, check_services
from services.launcher.scenario import read_scenario
from tests.mobee.robot.urdf_files import tetrahedron, write_stl
from tests.mobee_cli.test_learn import ARM


def test_without_a_robot_the_icub_finds_its_table(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["play", "--offline-only", "--transitions", "60", "--runs", str(tmp_path), "--json"]) == 0
    printed = capsys.readouterr()
    found = json.loads(printed.out)
    assert tuple(found["agents"]) == PUBLISHED and found["transitions"] == 60
    assert found["touched"]["table"] > 0
    assert len(printed.err.splitlines()) <= 10 and all(len(line) <= 80 for line in printed.err.splitlines()[:-1])
    agents = {part.who: part.config for part in read_scenario(found["scenario"]).parts if isinstance(part.config, AgentConfig)}
    assert set(agents) == {f"agent_{part}" for part in PUBLISHED}
    assert all(config.continues == found["store"] for config in agents.values())


def test_saved_files_are_not_overwritten(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arm, folder = tmp_path / "arm.urdf", tmp_path / "mine"
    arm.write_text(ARM)
    assert main(["play", str(arm), "--offline-only", "--transitions", "4", "--save", str(folder)]) == 0
    assert "Tiny Arm: 2 motors in 1 part, 2 shapes\n" in capsys.readouterr().out
    saved = ["README.md", "tiny_arm.sqlite", "tiny_arm.sqlite-lock", "tiny_arm.toml", "tiny_arm.xml"]
    assert sorted(path.name for path in folder.iterdir()) == saved
    assert "mobee check tiny_arm.xml" in (folder / "README.md").read_text()
    capsys.readouterr()
    assert main(["play", str(arm), "--offline-only", "--transitions", "4", "--save", str(folder)]) == 2
    assert "tiny_arm.toml exists: run it with `mobee launch" in capsys.readouterr().err


@pytest.mark.parametrize("name", ["README.md", "tiny_arm.xml", "tiny_arm.sqlite"])
@pytest.mark.parametrize("options", [["--set", "foo=1"], ["--offline-only", "--transitions", "4"]])
def test_no_file_of_the_user_is_replaced_or_removed(
    name: str, options: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arm, mine = tmp_path / "arm.urdf", tmp_path / "mine" / name
    arm.write_text(ARM)
    mine.parent.mkdir()
    mine.write_text("mine")
    assert main(["play", str(arm), "--save", str(mine.parent), *options]) == 2
    assert f"{name} exists and would be replaced" in capsys.readouterr().err
    assert [path.name for path in mine.parent.iterdir()] == [name] and mine.read_text() == "mine"


@pytest.mark.parametrize("options", [["--explorer", "curios"], ["--seed", "-1"], ["--set", "foo=1"]])
def test_a_refused_command_leaves_no_files(options: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arm, folder = tmp_path / "arm.urdf", tmp_path / "mine"
    arm.write_text(ARM)
    offline = [] if "--set" in options else ["--offline-only"]
    assert main(["play", str(arm), "--save", str(folder), *offline, *options]) == 2
    assert capsys.readouterr().err.count("\n") == 1
    assert not folder.exists()


def test_a_robot_with_a_long_name_is_saved(tmp_path: Path) -> None:
    arm = tmp_path / "arm.urdf"
    arm.write_text(ARM.replace("Tiny Arm", "a" * 300))
    assert main(["play", str(arm), "--offline-only", "--transitions", "4", "--runs", str(tmp_path / "runs")]) == 0
    (saved,) = (tmp_path / "runs").glob("*/*.toml")
    assert saved.stem == "a" * 64


@pytest.mark.parametrize(
    "given",
    [
        ["katana"],
        ["--offline-only"],
        ["--part", "arm=shoulder"],
        ["--seed", "0"],
        ["--explorer", "curious"],
        ["--world", "table"],
        ["--field", "0.03"],
        ["--seconds", "3"],
        ["--transitions", "3"],
        ["--save", "folder"],
    ],
)
def test_options_of_a_new_setup_are_refused_with_a_learned_one(
    given: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("mobee_cli.play.launch", lambda options: 0)
    store = tmp_path / "out.sqlite"
    store.touch()
    store.with_suffix(".toml").touch()
    assert main(["play", "--learned", str(store), "--camera", "hand"]) == 0
    assert main(["play", *given, "--learned", str(store)]) == 2
    said = capsys.readouterr().err
    assert f"{given[0]}" in said and "not valid with --learned" in said and said.count("\n") == 1


def test_a_port_in_use_is_said_before_it_learns(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        command = ["play", "katana", "--runs", str(tmp_path), "--endpoint", free_endpoint(), "--set", f"services.monitor.web_port={port}"]
        assert main(command) == 3
    printed = capsys.readouterr()
    assert f"port {port} of monitor is in use: choose another with --set services.monitor.web_port=" in printed.err
    assert "actions tried" not in printed.out and not list(tmp_path.iterdir())


def test_a_ctrl_c_during_learning_keeps_all_transitions(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arm, store = tmp_path / "arm.urdf", tmp_path / "mine" / "tiny_arm.sqlite"
    arm.write_text(ARM)
    main_thread = threading.main_thread().ident
    assert main_thread is not None

    def interrupt() -> None:
        end = time.monotonic() + 60.0
        while kept(store) < 20 and time.monotonic() < end:
            time.sleep(0.02)
        signal.pthread_kill(main_thread, signal.SIGINT)

    watcher = threading.Thread(target=interrupt)
    watcher.start()
    assert main(["play", str(arm), "--offline-only", "--transitions", "10000000", "--save", str(store.parent)]) == 130
    watcher.join()
    said = capsys.readouterr().err
    assert f"{kept(store)} transitions are kept, and `mobee launch {store.with_suffix('.toml')}` continues live with them" in said


def kept(store: Path) -> int:
    """The number of transitions in a file, 0 while it is being made."""
    try:
        with TransitionStore(store, "arm", read_only=True) as opened:
            return len(opened.load())
    except MobeeError:
        return 0


def test_a_file_that_mobee_learn_did_not_write_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    Files(tmp_path / "x.sqlite").store.touch()
    assert main(["play", "--learned", str(tmp_path / "x.sqlite")]) == 2
    assert "x.toml: no such scenario beside" in capsys.readouterr().err


def test_the_visuals_and_cameras_of_the_file_are_used_live(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arm, folder = tmp_path / "arm.urdf", tmp_path / "mine"
    drawn = '<visual><geometry><mesh filename="lower.stl"/></geometry></visual>'
    arm.write_text(ARM.replace('<link name="lower">', f'<link name="lower">{drawn}'))
    write_stl(tmp_path / "lower.stl", tetrahedron())
    (tmp_path / "desk.xml").write_text(
        '<World version="2.0" name="desk"><sphere name="ball" radius="0.03" px="0.5" role="target" color="0.9 0.05 0.05"/></World>'
    )
    options = ["--offline-only", "--transitions", "4", "--save", str(folder), "--world", str(tmp_path / "desk.xml")]
    cameras = ["upper", "upper=0,0.1,0.2,1,0,0"]
    assert main(["play", str(arm), *options, "--camera", cameras[0], "--camera", cameras[1]]) == 0
    assert "  cameras upper, upper_2\n" in capsys.readouterr().out
    (visual,) = load_robot(folder / "tiny_arm.xml").visuals
    assert visual.mesh is not None and read_pieces(visual.mesh)
    scenario = read_scenario(str(folder / "tiny_arm.toml"))
    seeing = {part.who: list(part.config.cameras) for part in scenario.parts if part.who in ("renderer", "vision", "monitor")}
    assert seeing == {"renderer": cameras, "vision": cameras, "monitor": cameras}
    check_services(scenario, check_robots(scenario))
