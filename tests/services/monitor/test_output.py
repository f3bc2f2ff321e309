# SPDX-License-Identifier: Apache-2.0
"""The outputs of a monitor in a folder that has files of an earlier one, or on a full disk."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from mobee.robot.load import load_robot

pytest.importorskip("rerun")
from services.monitor.config import Config  # noqa: E402  # only where Rerun is
from services.monitor.viewer.output import ROOM, open_output  # noqa: E402  # only where Rerun is

ROBOT = load_robot("katana")


def key(folder: Path, port: int) -> str:
    """The key of the page that a new monitor in the folder serves."""
    with open_output(Config(run_dir=str(folder), web_port=port), ROBOT, lambda: 0.0) as output:
        return output.url.partition("?key=")[2]


@pytest.mark.parametrize("is_there", [True, False])
def test_a_page_has_a_key_although_its_file_was_not_written(
    tmp_path: Path, free_port: int, monkeypatch: pytest.MonkeyPatch, is_there: bool
) -> None:
    if is_there:
        (tmp_path / "page.key").touch(mode=0o600)  # as a monitor leaves it that ended on a full disk
    else:

        def full(path: Path, text: str) -> int:
            raise OSError(28, "No space left on device")

        monkeypatch.setattr(Path, "write_text", full)
    assert key(tmp_path, free_port)
    assert (tmp_path / "page.key").stat().st_mode & 0o077 == 0


def test_a_monitor_that_is_started_again_keeps_the_key_and_the_recording_of_the_one_before(tmp_path: Path, free_port: int) -> None:
    keys = {key(tmp_path, free_port)}
    before = (tmp_path / "recording.rrd").read_bytes()
    keys |= {key(tmp_path, free_port) for _ in range(2)}
    assert len(keys) == 1
    assert sorted(path.name for path in tmp_path.glob("*.rrd")) == ["recording-2.rrd", "recording-3.rrd", "recording.rrd"]
    assert (tmp_path / "recording.rrd").read_bytes() == before


def test_a_full_disk_does_not_prevent_the_page(
    tmp_path: Path, free_port: int, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    usage = shutil.disk_usage(tmp_path)
    monkeypatch.setattr(shutil, "disk_usage", lambda path: usage._replace(free=ROOM - 1))
    assert key(tmp_path, free_port)
    assert not list(tmp_path.glob("*.rrd"))
    assert "the 3D view is not recorded" in capsys.readouterr().err
