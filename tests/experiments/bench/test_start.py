# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import os
import subprocess
import sys
from typing import Any

import pytest

from experiments.bench.start import IMPORT, NUMPY, POSE, mebibytes, summarized


def system(ready: float = 2.0, model: float = 60.0) -> dict[str, Any]:
    return {"ready_s": 3.0 * ready, "standard_ready_s": ready, "speed": 1.0 / 3.0, "mebibytes": {"launcher": 40.0, "model": model}}


def rounds(slower: float = 1.0) -> list[dict[str, tuple[float, float]]]:
    """Of a machine that is so much slower, with one round disturbed."""
    times = {NUMPY: 0.08, IMPORT: 0.16, POSE: 0.24}
    usual = {name: (3.0 * slower * seconds, slower * seconds) for name, seconds in times.items()}
    return [usual, usual | {IMPORT: (9.0, 9.0)}, usual]


@pytest.mark.parametrize("slower", [1.0, 3.0])
def test_the_verdict_is_the_same_on_a_slower_machine(slower: float) -> None:
    result = summarized(rounds(slower), [system()])
    assert result["times_numpy"] == pytest.approx({IMPORT: 2.0, POSE: 3.0})
    assert result["processor_s"][POSE] == pytest.approx(slower * 0.24)
    assert result["passed"]


@pytest.mark.skipif(not os.path.exists("/proc/self/smaps_rollup"), reason="the system does not report memory")
def test_memory_of_a_process_and_its_children_is_measured_and_named() -> None:
    children = [
        subprocess.Popen([sys.executable, "-c", "print(flush=True); input()", *words], stdin=subprocess.PIPE, stdout=subprocess.PIPE)
        for words in (("-m", "services.model"), ("-m", "services.agents", "--config", "runs/x/agent_torso.toml"))
    ]
    try:
        for child in children:
            assert child.stdout is not None and child.stdout.readline()  # it runs: before, the system may not know its command
        found = mebibytes(os.getpid())
        assert {"launcher", "services.model", "agent_torso"} <= found.keys()
        assert found["launcher"] > 5.0
    finally:
        for child in children:
            child.communicate(b"\n")
