# SPDX-License-Identifier: Apache-2.0
"""The iCub at the table, three curious agents, all services but the monitor, in real time and at twice the default rate.

At the default rate the other system tests run.
"""

from __future__ import annotations

import signal
from pathlib import Path

import pytest

from tests.system.live import launch, transitions, until
from tests.system.summed import check_that_nothing_touches, summary_line

pytestmark = pytest.mark.system

RATE = 200  # Hz
SEED = 1  # with it the first action of every agent settles within seconds


def test_live_at_the_table_at_200_hertz(tmp_path: Path) -> None:
    system = launch(tmp_path, "default", f"services.robot_sim.rate={RATE}", f"shared.seed={SEED}")
    try:
        until(lambda: "all ready" in system.errors.read_text(), 60.0, "the system is ready")
        until(lambda: all(transitions(system.run_dir).values()), 90.0, "every agent has a transition")
    finally:
        system.process.send_signal(signal.SIGINT)
        summary = system.summary(timeout=30)
    print(f"{summary_line(summary)}; {summary['duration_s']:.1f} s")
    check_that_nothing_touches(summary)
    assert summary["ticks"] > 0.81 * summary["duration_s"] * RATE
    assert summary["command_age_ticks"]["p50"] <= 2
