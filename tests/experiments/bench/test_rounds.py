from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable

import numpy as np
import pytest

from experiments.bench.rounds import Contestant, one_core, rates


def busy(seconds: float) -> Callable[[], None]:
    def run() -> None:
        end = time.process_time() + seconds
        while time.process_time() < end:
            pass

    return run


def test_everyone_runs_once_before_and_once_in_each_round_and_takes_turns_to_begin() -> None:
    order: list[str] = []
    contestants = {name: Contestant(lambda name=name: order.append(name), 1) for name in "abc"}
    rates(contestants, rounds=3)
    assert "".join(order) == "abc" + "abc" + "bca" + "cab"


def test_a_rate_is_poses_per_second_of_processor_time() -> None:
    found = rates({"fast": Contestant(busy(0.01), 100), "slow": Contestant(busy(0.02), 100)}, rounds=3)
    assert found["fast"].shape == (3,)
    assert np.median(found["fast"] / found["slow"]) == pytest.approx(2.0, rel=0.2)


def test_waiting_is_not_counted() -> None:
    def run() -> None:
        time.sleep(0.05)
        busy(0.01)()

    assert rates({"idle": Contestant(run, 1)}, rounds=1)["idle"][0] > 50.0


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
