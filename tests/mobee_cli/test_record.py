# SPDX-License-Identifier: Apache-2.0
"""`mobee record` beside a simulator that no launcher has started."""

from __future__ import annotations

import signal
from pathlib import Path

import pytest

from mobee import load_robot
from mobee_cli.__main__ import main
from mobee_cli.replaying.page import Player
from services.recorder.files import parts_of
from services.recorder.reader import Recording
from tests.services.harness import rig, wait_for


def test_a_recording_has_the_settings_of_the_running_services_and_can_be_played(tmp_path: Path, free_port: int) -> None:
    folder = tmp_path / "recording"
    (folder / "a folder.toml").mkdir(parents=True)
    (folder / "another.toml").write_text("secret = 1\n")
    with rig(tmp_path, load_robot("katana")) as made:
        made.start("services.robot_sim", "robot_sim", "--robot", "katana", "--backend", "kinematic")
        program = made.spawn("-m", "mobee_cli", "record", "--to", str(folder), "--robot", "katana", "--endpoint", made.endpoint)

        def has_ticks() -> bool:
            assert program.is_running, program.says
            is_begun = any(path.stat().st_size for path in parts_of(folder))
            return is_begun and any(message.type == "Tick" for message in Recording(folder))

        wait_for(has_ticks, "ticks in the recording", 60.0)
        assert program.stop(signal.SIGINT) == 0, program.says
    assert set(Recording(folder).settings()) == {"robot_sim.toml"}
    Player(Recording(folder), free_port, tmp_path)  # it needs the robot of the settings


def test_a_recording_is_not_mixed_with_an_earlier_one(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "messages-0003.mcap").write_bytes(b"an earlier one")
    assert main(["record", "--to", str(tmp_path)]) == 2
    said = capsys.readouterr()
    assert "holds a recording already, messages-0003.mcap" in said.err and "--to" in said.err and not said.out


@pytest.mark.parametrize("size", ["inf", "nan", "5"])
def test_a_size_that_is_not_valid_is_refused_with_its_option(tmp_path: Path, capsys: pytest.CaptureFixture[str], size: str) -> None:
    assert main(["record", "--to", str(tmp_path), "--largest", size]) == 2
    said = capsys.readouterr()
    assert said.err.startswith("mobee record: --largest: ") and len(said.err.splitlines()) == 1 and not said.out
