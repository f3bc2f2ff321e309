# SPDX-License-Identifier: Apache-2.0
"""A short schedule of faults breaks no promise of docs/reliability.md; `mobee bench faults` performs many."""

from __future__ import annotations

import pytest

from experiments.bench.faults import Settings, measure, report

pytestmark = pytest.mark.system

SCHEDULE = 146  # an agent without disk for 2 s, a kill of the model during these, a kill of another agent


def test_under_a_schedule_of_faults_nothing_is_lost_and_every_part_is_back() -> None:
    result = measure(Settings(schedules=1, seed=SCHEDULE, seconds=5.0, period=1.7))
    print(report(result))
    performed = [text.split(" s ", 1)[1] for text in result["rows"][0]["schedule"]]
    assert performed == ["disk agent_torso for 2.0 s", "kill model", "kill agent_right_arm"]
    assert result["broken"] == []
    assert result["never_held"] == 0
    kept = result["transitions"]
    assert (kept["lost"], kept["differing"], kept["repeated"]) == (0, 0, 0)
