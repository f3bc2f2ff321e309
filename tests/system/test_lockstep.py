# SPDX-License-Identifier: Apache-2.0
"""Lockstep with all services: the same run under any scheduling, equal to the run of the offline plant."""

from __future__ import annotations

from pathlib import Path

import pytest

from experiments.bench.agree import AGENTS, MAX_DIFFERENCE, PATIENCE, compare, lockstep, offline
from experiments.kit.live.launch import summary_of
from services.common.lockstep import TEST_DELAY

pytestmark = [pytest.mark.system, pytest.mark.untimed]

TICKS, SEED = 400, 4


def test_random_delays_change_no_state_and_the_offline_plant_does_the_same(tmp_path: Path) -> None:
    observed, quick = lockstep(TICKS, SEED, tmp_path / "quick")
    slow = summary_of("lockstep", [f"shared.seed={SEED}", PATIENCE], ticks=TICKS, environment={TEST_DELAY: "5"})
    for summary in (quick, slow):
        assert (summary["lockstep"]["ticks"], summary["lockstep"]["repeatable"]) == (TICKS, True)
    assert slow["lockstep"]["speed"] < 6.0  # the delays were there: 10 ms a tick of 20 in the mean, one after the other
    assert slow["lockstep"]["states_sha256"] == quick["lockstep"]["states_sha256"]
    agreement = compare(observed, offline(sum(map(len, observed.values())) + 2 * len(AGENTS), SEED, tmp_path))
    assert agreement.actions >= 3
    assert agreement.first_difference == ""
    assert agreement.worst <= MAX_DIFFERENCE
