# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import pytest

from services.common import rate
from services.common.rate import Rate


class Watch:
    """A clock that advances only when the test calls it."""

    def __init__(self) -> None:
        self.now = 100.0

    def monotonic(self) -> float:
        return self.now


@pytest.fixture
def watch(monkeypatch: pytest.MonkeyPatch) -> Watch:
    made = Watch()
    monkeypatch.setattr(rate, "time", made)
    return made


def test_deadlines_are_absolute_so_that_late_waking_does_not_add_up(watch: Watch) -> None:
    ticks = Rate(0.01)
    for n in range(1, 1001):
        deadline = ticks.next()
        assert deadline == pytest.approx(100.0 + 0.01 * n)
        watch.now = deadline + 0.003
    assert ticks.missed == 0


def test_a_long_delay_is_skipped_and_counted_and_never_caught_up(watch: Watch) -> None:
    ticks = Rate(0.01)
    ticks.next()
    watch.now = 100.0 + 0.01 + 0.0552  # five whole periods late, and a little
    first = ticks.next()
    assert ticks.missed == 4
    assert watch.now - first < 0.01
    watch.now = max(watch.now, first)
    assert ticks.next() == pytest.approx(first + 0.01)
    assert ticks.missed == 4


def test_ticks_made_and_ticks_missed_add_up_to_the_time_that_passed(watch: Watch) -> None:
    ticks, made = Rate(0.01), 0
    for work in [0.002, 0.013, 0.009, 0.05, 0.0, 0.0301, 0.004] * 20:
        watch.now = max(watch.now, ticks.next())
        made += 1
        watch.now += work
    watch.now = max(watch.now, ticks.next())
    assert (watch.now - 100.0) / 0.01 == pytest.approx(made + 1 + ticks.missed, abs=1.0)


def test_a_delay_below_one_period_is_made_up_by_the_next_tick(watch: Watch) -> None:
    ticks = Rate(0.01)
    watch.now = ticks.next() + 0.009
    assert ticks.next() == pytest.approx(100.02)
    assert ticks.missed == 0
