"""Rates of several programs in one run: on one core, turn by turn, medians, because the machine's speed drifts.

Processor time of this process is counted, so that what else the machine does matters little.
"""

from __future__ import annotations

import contextlib
import gc
import os
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mobee.robot.robot import Array


@dataclass(frozen=True, slots=True)
class Contestant:
    """What is timed: `run` evaluates `poses` poses."""

    run: Callable[[], object]
    poses: int


@contextlib.contextmanager
def one_core() -> Iterator[int | None]:
    """Keep every thread of this process on one core, whose number it gives; None where the system has no such call."""
    with some_cores(1) as cores:
        yield cores[0] if cores else None


@contextlib.contextmanager
def some_cores(count: int) -> Iterator[tuple[int, ...]]:
    """Keep every thread of this process on so many cores, whose numbers it gives; on all, (), where the system has no such call."""
    if not hasattr(os, "sched_setaffinity"):
        yield ()
        return
    allowed = os.sched_getaffinity(0)
    cores = tuple(sorted(allowed, reverse=True)[:count])
    _pin(set(cores))
    try:
        yield cores
    finally:
        _pin(allowed)


def _pin(cores: set[int]) -> None:
    for thread in Path("/proc/self/task").iterdir():
        with contextlib.suppress(ProcessLookupError):  # it has ended meanwhile
            os.sched_setaffinity(int(thread.name), cores)


def rates(contestants: Mapping[str, Contestant], rounds: int) -> dict[str, Array]:
    """Poses per second of each contestant in each round, (rounds,); each round begins with another one."""
    names = list(contestants)
    measured: dict[str, list[float]] = {name: [] for name in names}
    for one in contestants.values():
        one.run()  # caches and lazy set-up
    with _old_kept():
        for number in range(rounds):
            turn = number % len(names)
            for name in names[turn:] + names[:turn]:
                measured[name].append(_rate(contestants[name]))
    return {name: np.array(values) for name, values in measured.items()}


@contextlib.contextmanager
def _old_kept() -> Iterator[None]:
    """Meanwhile the garbage collector passes over what is there already."""
    gc.freeze()
    try:
        yield
    finally:
        gc.unfreeze()


def _rate(one: Contestant) -> float:
    gc.collect()
    gc.disable()
    start = time.process_time()
    one.run()
    seconds = time.process_time() - start
    gc.enable()
    return one.poses / seconds
