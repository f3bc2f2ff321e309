"""The first run of all: the iCub at the table, three curious agents, everything but the monitor, in real time."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.system.live import AGENTS, launch
from tests.system.summed import check_that_nothing_touches, summary_line

pytestmark = pytest.mark.system


def test_live_at_the_table(tmp_path: Path) -> None:
    summary = launch(tmp_path, "default", duration=30).summary(timeout=90)
    print(summary_line(summary))
    for agent in AGENTS:
        counts = summary["agents"][agent]
        assert counts["transitions"] + counts["timeouts"] >= 1, "an action takes at most 20 of the 30 s, a second may not end"
    check_that_nothing_touches(summary)


def test_at_200_hertz(tmp_path: Path) -> None:
    summary = launch(tmp_path, "default", "services.robot_sim.rate=200", duration=8).summary(timeout=90)
    print(summary_line(summary))
    assert summary["ticks"] > 1300
    assert summary["command_age_ticks"]["p50"] <= 2
