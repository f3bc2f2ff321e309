"""The issue's first run: the iCub at the table, three curious agents, everything but the monitor."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from tests.system.live import AGENTS, launch

pytestmark = pytest.mark.system

LOCKSTEP = ("shared.mode=lock", "services.robot_sim.rate=50")  # robot time, several times faster than real time


def test_two_minutes_at_the_table(tmp_path: Path) -> None:
    summary = launch(tmp_path, "default", *LOCKSTEP, ticks=6000).summary(timeout=200)
    print(summary_line(summary))
    for agent in AGENTS:
        assert summary["agents"][agent]["transitions"] >= 12
        assert 2.0 < summary["agents"][agent]["mean_action_time_s"] < 10.0
    assert summary["table_contact_ticks"] >= 20
    check_that_nothing_touches(summary)


def test_live_at_the_table(tmp_path: Path) -> None:
    summary = launch(tmp_path, "default", duration=30).summary(timeout=90)
    print(summary_line(summary))
    for agent in AGENTS:
        assert summary["agents"][agent]["transitions"] >= 2
    check_that_nothing_touches(summary)


def test_without_contact_forces_solids_touch(tmp_path: Path) -> None:
    summary = launch(tmp_path, "default", *LOCKSTEP, "services.model.contact_forces=false", ticks=2500).summary(timeout=150)
    print(summary_line(summary))
    assert summary["solid_contact_ticks"] > 0
    assert summary["deepest_solid_contact_m"] > 0.0
    assert summary["closest_gap_m"] < 0.001


def test_at_200_hertz(tmp_path: Path) -> None:
    summary = launch(tmp_path, "default", "services.robot_sim.rate=200", duration=15).summary(timeout=90)
    print(summary_line(summary))
    assert summary["ticks"] > 2500
    assert summary["command_age_ticks"]["p50"] <= 2


def check_that_nothing_touches(summary: dict[str, Any]) -> None:
    assert summary["pairs_watched"] > 50
    assert summary["deepest_solid_contact_m"] <= 0.010
    assert summary["closest_gap_m"] > 0.005
    assert not any(summary["restarts"].values())


def summary_line(summary: dict[str, object]) -> str:
    names = (
        "agents",
        "table_contact_ticks",
        "closest_gap_m",
        "deepest_solid_contact_m",
        "solid_contact_ticks",
        "pairs_watched",
        "command_age_ticks",
    )
    return "; ".join(f"{name} {summary[name]}" for name in (*names, "hold_ticks", "missed_ticks", "rejected_commands"))
