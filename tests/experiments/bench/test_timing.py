# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import os
import threading

import pytest

from experiments.bench import timing
from experiments.bench.timing import Contestant, one_core, rates


class ProcessorTime:
    """A clock that the test sets."""

    def __init__(self) -> None:
        self.now = 0.0

    def __call__(self) -> float:
        return self.now

    def spend(self, seconds: float) -> None:
        self.now += seconds


def test_all_run_once_before_and_once_in_each_round_and_take_turns_to_begin() -> None:
    order: list[str] = []
    contestants = {name: Contestant(lambda name=name: order.append(name), 1) for name in "abc"}
    rates(contestants, rounds=3)
    assert "".join(order) == "abc" + "abc" + "bca" + "cab"


def test_a_rate_is_work_per_second_of_processor_time(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = ProcessorTime()
    monkeypatch.setattr(timing.time, "process_time", clock)
    fast, slow = Contestant(lambda: clock.spend(0.01), 100), Contestant(lambda: clock.spend(0.02), 100)
    found = rates({"fast": fast, "slow": slow}, rounds=3)
    assert found["fast"] == pytest.approx([1e4] * 3) and found["slow"] == pytest.approx([5e3] * 3)


@pytest.mark.skipif(not hasattr(os, "sched_getaffinity"), reason="the system cannot keep a process on a core")
def test_every_thread_stays_on_one_core_and_is_free_again_after() -> None:
    before = os.sched_getaffinity(0)
    seen: list[set[int]] = []
    go, done = threading.Event(), threading.Event()

    def read_affinity() -> None:
        go.wait()
        seen.append(os.sched_getaffinity(0))
        done.set()

    thread = threading.Thread(target=read_affinity)
    thread.start()
    with one_core() as core:
        go.set()
        assert done.wait(10.0)
        assert os.sched_getaffinity(0) == {core}
    thread.join()
    assert seen == [{core}]
    assert os.sched_getaffinity(0) == before
