# SPDX-License-Identifier: Apache-2.0
"""What the summary of a run at the table must say, and a line of it for people."""

from __future__ import annotations

from typing import Any


def check_that_nothing_touches(summary: dict[str, Any]) -> None:
    assert summary["pairs_watched"] > 50
    assert summary["deepest_solid_contact_m"] <= 0.010
    assert summary["closest_gap_m"] > 0.005
    assert not any(summary["restarts"].values())


def summary_line(summary: dict[str, Any]) -> str:
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
