# SPDX-License-Identifier: Apache-2.0
"""The first run of all, in robot time: the iCub at the table, three curious agents, everything but the monitor, in lockstep."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from tests.system.live import AGENTS, launch
from tests.system.summed import check_that_nothing_touches, summary_line

pytestmark = [pytest.mark.system, pytest.mark.untimed]

PATIENCE = "shared.patience=20"  # s for a tick, as other tests have the cores as well


def in_lockstep(folder: Path, ticks: int, *settings: str) -> dict[str, Any]:
    system = launch(folder, "default", "shared.mode=lock", PATIENCE, "services.robot_sim.rate=50", *settings, ticks=ticks)
    summary = system.summary(timeout=240)
    print(summary_line(summary))
    return summary


def test_forty_seconds_at_the_table(tmp_path: Path) -> None:
    summary = in_lockstep(tmp_path, 2000)
    for agent in AGENTS:
        assert summary["agents"][agent]["transitions"] >= 4
        assert 2.0 < summary["agents"][agent]["mean_action_time_s"] < 10.0
    assert summary["table_contact_ticks"] >= 20
    check_that_nothing_touches(summary)


def test_without_contact_forces_solids_touch(tmp_path: Path) -> None:
    summary = in_lockstep(tmp_path, 800, "services.model.contact_forces=false")
    assert summary["solid_contact_ticks"] > 0
    assert summary["deepest_solid_contact_m"] > 0.0
    assert summary["closest_gap_m"] < 0.001
