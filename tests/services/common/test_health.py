# SPDX-License-Identifier: Apache-2.0
"""What a process reports of its health."""

from __future__ import annotations

import pytest

from services.common import health
from services.common.health import RECOVERED, SETTLED, WINDOW, Beats, Health


class Clock:
    """The monotonic clock of the module, which the test turns."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.now = 1000.0
        monkeypatch.setattr(health.time, "monotonic", lambda: self.now)


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    return Clock(monkeypatch)


def test_rate_gap_and_age_are_those_of_the_last_window() -> None:
    beats = Beats(0.0)
    assert beats.age(1.0) is None
    for k in range(400):
        beats.note(0.01 * k)
    beats.note(4.29)
    beats.end_window(5.0)
    assert beats.rate == pytest.approx(401 / 5.0) and beats.gap == pytest.approx(0.71) and beats.age(6.0) == pytest.approx(1.71)
    beats.note(5.01)
    beats.end_window(5.02)
    assert beats.gap == pytest.approx(0.72)  # the gap that began in the window before


def test_a_slow_clock_is_reported_once_and_again_when_it_has_been_good_for_long_enough(clock: Clock) -> None:
    said: list[tuple[str, str]] = []
    watched = Health()

    def window(rate: float) -> None:
        for _ in range(round(rate * WINDOW)):
            clock.now += 1.0 / rate
            watched.beats.note(clock.now)
        watched.check(100.0, 0, 0, lambda level, text: said.append((level, text)))

    for _ in range(3):
        window(100.0)
    assert not said and not watched.bad
    for _ in range(3):
        window(50.0)
    assert said == [("warning", "gets 50 ticks a second of 100")] and set(watched.bad) == {"rate"}
    for _ in range(round(RECOVERED / WINDOW)):
        window(100.0)
    assert len(said) == 1
    window(100.0)
    assert said[1:] == [("info", f"rate has been within its limit for {RECOVERED:g} s")] and not watched.bad


def test_refusals_a_crowd_memory_that_grows_and_many_open_files_are_reported(clock: Clock, monkeypatch: pytest.MonkeyPatch) -> None:
    said: list[str] = []
    memory = 60.0
    monkeypatch.setattr(health, "_memory", lambda: memory)
    watched = Health(files_limit=1_000_000)

    def check(refused: int = 0, waiting: int = 0) -> None:
        clock.now += WINDOW
        watched.check(None, refused, waiting, lambda level, text: said.append(text))

    for _ in range(int(SETTLED / WINDOW) + 2):
        check()
    memory = 159.0
    check()
    assert not said
    memory = 161.0
    check(refused=51, waiting=501)
    assert said == ["refuses 10 messages a second", "501 messages and calls wait", "has 161 MB of memory, 60 MB after its start"]
    few = Health(files_limit=2)
    few.check(None, 0, 0, lambda level, text: said.append(text))
    assert len(said) == 4 and said[3].endswith("files open of 2")


def test_the_numbers_are_those_of_this_process() -> None:
    numbers = Health().numbers(waiting=3)
    assert numbers["rate"] is None and numbers["age_ms"] is None and numbers["waiting"] == 3
    assert 10.0 < (numbers["memory_mb"] or 0.0) < 5000.0 and (numbers["files"] or 0) >= 3 and (numbers["threads"] or 0) >= 1
