# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

from experiments.bench.play import LEARNING, REQUIREMENTS, SHOWN, STEPS, _left, report
from experiments.bench.verdicts import verdict


def start(robot: str, shown: float, clean: bool = True) -> dict[str, Any]:
    steps = dict.fromkeys(STEPS, LEARNING) | {SHOWN: shown}
    return {"robot": robot, "steps": steps, "ending_s": 1.0, "clean": clean, "standard_s": shown, "load": 3.25}


def test_the_start_with_the_median_time_is_reported() -> None:
    starts = [start("a/panda.urdf", seconds) for seconds in (31.0, 11.0, 12.5)]
    result = {"python": "Python 3.12.1", "starts": starts, "speed": 1.0, "slowest_standard_s": 12.5}
    text = report(result | verdict(result, REQUIREMENTS, ends_clean=True))
    assert "panda.urdf, load 3.2:" in text and f"{SHOWN:<28}{12.5:>7.1f}" in text
    assert "31.0" not in text and all(len(line) <= 80 for line in text.splitlines())


def test_a_service_that_is_left_is_found(tmp_path: Path) -> None:
    command = [sys.executable, "-c", "print('runs', flush=True); input()", "--config", str(tmp_path / "model.toml")]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as child:
        assert child.stdout is not None and child.stdout.readline() == b"runs\n"  # before, the system may list it with its parent's command
        assert _left(str(tmp_path)) == [child.pid]
        child.communicate(b"\n")
    assert _left(str(tmp_path)) == []
