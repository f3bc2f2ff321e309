# SPDX-License-Identifier: Apache-2.0
"""The iCub at the table, three curious agents, all services but the monitor, in real time and at twice the default rate.

At the default rate the other system tests run.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.system.live import AGENTS, launch
from tests.system.summed import check_that_nothing_touches, summary_line

pytestmark = pytest.mark.system


DURATION, RATE = 23, 200  # s, Hz; an action takes at most 20 s, a second one may not end


def test_live_at_the_table_at_200_hertz(tmp_path: Path) -> None:
    summary = launch(tmp_path, "default", f"services.robot_sim.rate={RATE}", duration=DURATION).summary(timeout=90)
    print(summary_line(summary))
    for agent in AGENTS:
        counts = summary["agents"][agent]
        assert counts["transitions"] + counts["timeouts"] >= 1
    check_that_nothing_touches(summary)
    assert summary["ticks"] > 0.81 * DURATION * RATE
    assert summary["command_age_ticks"]["p50"] <= 2
