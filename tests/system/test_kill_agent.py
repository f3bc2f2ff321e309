# SPDX-License-Identifier: Apache-2.0
"""kill -9 of a learning agent at random moments, many times in a row: nothing observed is lost or doubled, and it learns on as ever.

MOBEE_KILLS=50 kills fifty times instead of six.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from mobee.store import Transition, TransitionStore
from tests.services.harness import ROOT
from tests.system.learner import curious_agent, digest

pytestmark = [pytest.mark.system, pytest.mark.untimed]

KILLS = int(os.environ.get("MOBEE_KILLS", "6"))
AT_START = 0.2  # share of the kills while the agent starts; the others come while it learns
REPORT = re.compile(r"^(\d+) ([0-9a-f]{64})\n", re.MULTILINE)


def live_and_die(file: Path, reports: Path, rng: np.random.Generator) -> None:
    """Start an agent and kill it."""
    before = reports.stat().st_size if reports.exists() else 0
    agent = subprocess.Popen([sys.executable, "-m", "tests.system.learner", str(file), str(reports)], cwd=ROOT)
    try:
        give_up = time.monotonic() + (rng.uniform(0.0, 1.5) if rng.random() < AT_START else 60.0)
        while time.monotonic() < give_up and (reports.stat().st_size if reports.exists() else 0) < before + 2 * 66:
            assert agent.poll() is None
            time.sleep(0.001)
        time.sleep(rng.uniform(0.0, 0.3))
    finally:
        agent.kill()
        agent.wait()


def stored(file: Path) -> list[Transition]:
    if not file.exists():
        return []
    with TransitionStore(file, "left_arm") as store:
        return store.load()


def test_an_agent_killed_again_and_again_has_learnt_what_one_never_killed_has(tmp_path: Path) -> None:
    file, reports = tmp_path / "transitions.sqlite", tmp_path / "reports"
    rng = np.random.default_rng(0)
    before: list[Transition] = []
    for _ in range(KILLS):
        live_and_die(file, reports, rng)
        now = stored(file)
        reported = [int(n) for n, _ in REPORT.findall(reports.read_text())] if reports.exists() else []
        assert now[: len(before)] == before
        assert len(now) - max(reported, default=0) in (0, 1)  # the kill may have prevented the report of the last observation
        before = now

    one = curious_agent(None)
    digests = [digest(one)]
    for transition in before:
        one.step()
        assert one.last == transition
        digests.append(digest(one))
    told_digests = [(int(n), hashed) for n, hashed in REPORT.findall(reports.read_text())]
    assert [hashed for _, hashed in told_digests] == [digests[n] for n, _ in told_digests]
    assert len(before) > 10 * KILLS
    print(f"{KILLS} kills, {len(before)} transitions, {len(told_digests)} digests of the model")
