# SPDX-License-Identifier: Apache-2.0
"""The calibration's arithmetic, on a clock that the tests set; no speed is measured."""

from __future__ import annotations

import numpy as np
import pytest

from experiments.bench import timing
from experiments.bench.timing import SPEED_LIFETIME, STANDARD_SECONDS, Calibration, Crew, bare_ages


class Clock:
    """A clock that advances only when a test says so."""

    def __init__(self) -> None:
        self.now = 0.0

    def __call__(self) -> float:
        return self.now


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    found = Clock()
    monkeypatch.setattr(timing.time, "process_time", found)
    monkeypatch.setattr(timing.time, "monotonic", found)
    return found


def test_the_speed_is_that_of_the_median_loop(clock: Clock, monkeypatch: pytest.MonkeyPatch) -> None:
    seconds = iter([2.0 * STANDARD_SECONDS, 50.0 * STANDARD_SECONDS, 3.0 * STANDARD_SECONDS])

    def loop() -> None:
        clock.now += next(seconds)

    monkeypatch.setattr(timing, "loop", loop)
    assert timing.speed(loops=3) == pytest.approx(1.0 / 3.0)


def test_the_speed_is_measured_before_and_after_but_not_too_often(clock: Clock) -> None:
    speeds = iter([1.0, 0.5, 0.25])
    calibrated = Calibration(lambda: next(speeds))

    def spend(seconds: float) -> str:
        clock.now += seconds
        return "done"

    assert calibrated.around(lambda: spend(2.0 * SPEED_LIFETIME)) == ("done", 0.75)
    assert calibrated.around(lambda: spend(0.1 * SPEED_LIFETIME)) == ("done", 0.5)  # known
    assert calibrated.around(lambda: spend(2.0 * SPEED_LIFETIME)) == ("done", 0.375)
    assert calibrated.speeds == [1.0, 0.5, 0.25]
    assert calibrated.median == 0.5


def test_a_crew_does_the_work_and_ends() -> None:
    with Crew(2) as crew:
        assert crew.loops(1) > 0.0 and crew.exchanges(1) > 0.0
        processes = crew._processes
        assert [process.poll() for process in processes] == [None, None]
    assert [process.poll() for process in processes] == [0, 0]


def test_ages_of_a_bare_chain_count_ticks_since_the_last_answer() -> None:
    ages = bare_ages(rate=100.0, seconds=0.3)
    assert len(ages) == 30 and ages.dtype == np.int64
    assert ages[0] == 1 and (ages >= 1).all()


def test_the_newest_of_several_messages_counts() -> None:
    three = b"".join(timing._message(tick) for tick in (6, 7, 8))
    assert timing._newest_tick(three, 5) == 8
    assert timing._newest_tick(three[:-1], 5) == 7  # the last one is not whole yet
    assert timing._newest_tick(b"t", 5) == 5
