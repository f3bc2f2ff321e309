# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import json
import re
import signal
import subprocess
import sys
import time
import urllib.error
import urllib.request
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mobee import load_robot
from mobee_cli.__main__ import main
from tests.services.robots import ARM

pytest.importorskip("rerun")


def recorded(folder: Path) -> Path:
    """A run of ten seconds in which an arm turns, and its card changes in the middle."""
    (folder / "arm.xml").write_text(ARM)
    (folder / "monitor.toml").write_text(f'robot = "{folder / "arm.xml"}"\n')
    lines: list[tuple[float, str, Any]] = [(0.0, "robot", {"name": "arm", "parts": [], "shapes": []}), (0.0, "cards", [])]
    lines += [(0.2 * k, "q", [0.01 * k, 0.5]) for k in range(51)]
    lines += [(5.0, "cards", [{"part": "arm", "now": "pan +10°"}])]
    lines += [(when, "event", {"t": when, "level": "info", "who": "sim", "text": f"at {when}"}) for when in (1.0, 6.0)]
    (folder / "story.jsonl").write_text("".join(json.dumps(one) + "\n" for one in sorted(lines, key=lambda one: one[0])))
    return folder


def test_a_run_is_seen_again_at_any_time(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "mobee_cli", "replay", str(recorded(tmp_path)), "--port", "0"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as shown:
        assert shown.stdout and shown.stderr
        line = shown.stdout.readline()
        address = re.search(r"http://127\.0\.0\.1:\d+/", line)
        assert address, line + shown.stderr.read()

        def get(path: str) -> bytes:
            with urllib.request.urlopen(address[0] + path, timeout=30.0) as answer:
                return bytes(answer.read())

        def news_at(moment: float) -> dict[str, Any]:
            """All values at the moment at which the pages show the body."""
            give_up = time.monotonic() + 30.0
            while (seen := json.loads(get("news?after=0")))["body"]["t"] != moment:
                assert time.monotonic() < give_up, seen["player"]
            return dict(seen)

        assert b"<html" in get("").lower()
        get("seek?toggle=1")
        get("seek?at=2")
        seen = news_at(2.0)
        assert seen["player"] == {"at": 2.0, "length": 10.0, "plays": False}
        assert [event["text"] for event in seen["events"]] == ["at 1.0"]
        assert seen["cards"] == [] and seen["body"]["q"] == pytest.approx([0.1, 0.5])
        assert len(seen["body"]["links"]) == len(load_robot(tmp_path / "arm.xml").links)
        for wrong in ("seek?at=nan", "seek?at=soon"):
            with pytest.raises(urllib.error.HTTPError, match="400"):
                get(wrong)
        get("seek?at=7.3")
        seen = news_at(7.3)
        assert seen["cards"][0]["now"] == "pan +10°"
        assert [event["text"] for event in seen["events"]] == ["at 1.0", "at 6.0"] and "event" not in seen
        assert np.ptp([seen["body"]["q"][0], 0.36]) < 1e-9
        shown.send_signal(signal.SIGINT)
        try:
            assert shown.wait(timeout=20) == 0
        finally:
            shown.kill()  # or the end of `with` waits indefinitely
        assert shown.stderr.read() == ""


def test_a_folder_that_is_no_run_is_refused_in_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["replay", str(tmp_path / "none")]) == 2
    assert "there is no such folder" in capsys.readouterr().err
    assert main(["replay", str(tmp_path)]) == 2
    assert "only runs that had a monitor" in capsys.readouterr().err
    recorded(tmp_path)
    (tmp_path / "story.jsonl").write_text('[0.0,"cards",[]]\n')
    assert main(["replay", str(tmp_path)]) == 2
    assert "holds no pose" in capsys.readouterr().err
