# SPDX-License-Identifier: Apache-2.0
"""A run in lockstep is recorded; its recorder is killed without effect; its controller and model say the same again."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import urllib.request
from pathlib import Path
from typing import Any

import pytest

from experiments.kit.live.launch import free_port
from mobee_cli.__main__ import main
from services.recorder.reader import Recording
from tests.system.live import launch, until

pytestmark = [pytest.mark.system, pytest.mark.untimed]
TICKS = 300  # 6 s of the robot: all parts move


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Any]]:
    system = launch(tmp_path_factory.mktemp("recorder"), "lockstep", "shared.patience=30", ticks=TICKS, record=True)
    summary = system.summary(timeout=240.0)
    return system.run_dir, summary


def test_everything_is_recorded_and_nothing_lost(run: tuple[Path, dict[str, Any]]) -> None:
    folder, summary = run
    assert summary["lockstep"]["repeatable"]
    assert summary["services"]["recorder"]["lost"] == 0
    messages = list(Recording(folder))
    assert sum(message.type == "Commands" for message in messages) == TICKS
    calls = {message.key for message in messages if message.type == "Served"}
    assert {"served/controller", "served/robot_sim"} <= calls
    assert {"controller.toml", "model.toml", "robot_sim.toml"} <= Recording(folder).settings().keys()


@pytest.mark.parametrize("who", ["controller", "model"])
def test_it_says_the_same_again(run: tuple[Path, dict[str, Any]], who: str, capsys: pytest.CaptureFixture[str]) -> None:
    code = main(["replay", str(run[0]), "--into", who, "--json"])
    result = json.loads(capsys.readouterr().out)
    assert (code, result["difference"]) == (0, None)
    assert result["ticks"] == TICKS - 2
    assert set(result["says"]) == ({"Commands", "Motion"} if who == "controller" else {"Forces"})


def test_another_law_is_noticed(run: tuple[Path, dict[str, Any]], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    content = (run[0] / "messages-0000.mcap").read_bytes()
    assert b"speed_scale = 1.0\n" in content
    (tmp_path / "changed.mcap").write_bytes(content.replace(b"speed_scale = 1.0\n", b"speed_scale = 0.1\n"))
    assert main(["replay", str(tmp_path / "changed.mcap"), "--into", "controller", "--json"]) == 1
    found = json.loads(capsys.readouterr().out)["difference"]
    assert found["key"].endswith("/motion") or found["key"] == "commands"


def test_its_kill_changes_nothing(tmp_path: Path, run: tuple[Path, dict[str, Any]]) -> None:
    system = launch(tmp_path, "lockstep", "shared.patience=30", ticks=TICKS, record=True)
    until(lambda: "all ready" in system.errors.read_text(), 120.0, "the system is ready")
    log = system.log("recorder")
    until(lambda: any(system.run_dir.glob("messages-*.mcap")), 30.0, "a recording")
    pid = int(log.split("ready as i")[1].split("_")[0])
    os.kill(pid, signal.SIGKILL)
    summary = system.summary(timeout=240.0)
    assert summary["lockstep"]["repeatable"]
    assert summary["lockstep"]["states_sha256"] == run[1]["lockstep"]["states_sha256"]
    assert next(iter(Recording(system.run_dir))).key == "alive"  # the file that was not ended can be read


def test_its_page_is_played_from_the_messages(run: tuple[Path, dict[str, Any]]) -> None:
    port = str(free_port())
    command = [sys.executable, "-m", "mobee_cli", "replay", str(run[0] / "messages-0000.mcap"), "--port", port, "--speed", "4"]

    def news() -> dict[str, Any]:
        with urllib.request.urlopen(f"http://127.0.0.1:{port}/news?after=0", timeout=30.0) as answer:
            return dict(json.loads(answer.read()))

    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as shown:
        try:
            assert shown.stdout is not None and shown.stdout.readline().rstrip().endswith(f"http://127.0.0.1:{port}/")
            until(lambda: news().get("status", {}).get("time", 0.0) > 4.0, 60.0, "the robot's time passes")
            seen = news()
            assert [card["part"] for card in seen["cards"]] == ["torso", "left_arm", "right_arm"]
            assert "table" in [one["name"] for one in seen["objects"]]
        finally:
            shown.send_signal(signal.SIGINT)
            code = shown.wait(timeout=30)
        assert code == 0
