from __future__ import annotations

import os
import threading

import pytest

from experiments.bench import verdicts as rounds
from experiments.bench.verdicts import Contestant, one_core, rates


class ProcessorTime:
    """A clock that the test sets."""

    def __init__(self) -> None:
        self.now = 0.0

    def __call__(self) -> float:
        return self.now

    def spent(self, seconds: float) -> None:
        self.now += seconds


def test_everyone_runs_once_before_and_once_in_each_round_and_takes_turns_to_begin() -> None:
    order: list[str] = []
    contestants = {name: Contestant(lambda name=name: order.append(name), 1) for name in "abc"}
    rates(contestants, rounds=3)
    assert "".join(order) == "abc" + "abc" + "bca" + "cab"


def test_a_rate_is_poses_per_second_of_processor_time(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = ProcessorTime()
    monkeypatch.setattr(rounds.time, "process_time", clock)
    fast, slow = Contestant(lambda: clock.spent(0.01), 100), Contestant(lambda: clock.spent(0.02), 100)
    found = rates({"fast": fast, "slow": slow}, rounds=3)
    assert found["fast"] == pytest.approx([1e4] * 3) and found["slow"] == pytest.approx([5e3] * 3)


@pytest.mark.skipif(not hasattr(os, "sched_getaffinity"), reason="the system cannot keep a process on a core")
def test_every_thread_stays_on_one_core_and_is_free_again_after() -> None:
    before = os.sched_getaffinity(0)
    seen: list[set[int]] = []
    go, looked = threading.Event(), threading.Event()

    def look() -> None:
        go.wait()
        seen.append(os.sched_getaffinity(0))
        looked.set()

    thread = threading.Thread(target=look)
    thread.start()
    with one_core() as core:
        go.set()
        assert looked.wait(10.0)
        assert os.sched_getaffinity(0) == {core}
    thread.join()
    assert seen == [{core}]
    assert os.sched_getaffinity(0) == before
