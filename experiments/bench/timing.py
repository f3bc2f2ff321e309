# SPDX-License-Identifier: Apache-2.0
"""Timing for benchmarks: on chosen cores, in processor time, with the compared programs in turns."""

from __future__ import annotations

import contextlib
import gc
import os
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import numpy as np

from mobee.arrays import Array

T = TypeVar("T")


@contextlib.contextmanager
def one_core() -> Iterator[int | None]:
    """Keep every thread of this process on one core in this context; yields the core's number, or None if the system cannot do that."""
    with some_cores(1) as cores:
        yield cores[0] if cores else None


@contextlib.contextmanager
def some_cores(count: int) -> Iterator[tuple[int, ...]]:
    """Keep every thread of this process on at most `count` cores in this context.

    Yields the numbers of the cores, or () if the operating system cannot do that.
    """
    if not hasattr(os, "sched_setaffinity"):
        yield ()
        return
    allowed = os.sched_getaffinity(0)
    cores = tuple(sorted(allowed, reverse=True)[:count])
    _pin_threads(set(cores))
    try:
        yield cores
    finally:
        _pin_threads(allowed)


def _pin_threads(cores: set[int]) -> None:
    for thread in Path("/proc/self/task").iterdir():
        with contextlib.suppress(ProcessLookupError):  # the thread has ended meanwhile
            os.sched_setaffinity(int(thread.name), cores)


def cores_text(core: int | None) -> str:
    """Return a text for reports that states whether processor time was measured on one core.  `core`: its number, or None."""
    return "of one core" if core is not None else "(not pinned to a core)"


def processor_time(run: Callable[[], T]) -> tuple[T, float]:
    """Call `run`.  Returns its result and the processor time of this process meanwhile [s]."""
    start = time.process_time()
    result = run()
    return result, time.process_time() - start


def medians(rounds: Sequence[Mapping[str, float]]) -> dict[str, float]:
    """Return a dict from the key of each number to its median over the rounds.

    `rounds`: the numbers of each round, all with the same keys.
    """
    return {key: float(np.median([one[key] for one in rounds])) for key in rounds[0]}


@dataclass(frozen=True, slots=True)
class Contestant:
    """One of the programs that are compared: a call of `run` does `count` units of work (poses, plans)."""

    run: Callable[[], object]
    count: int


def rates(contestants: Mapping[str, Contestant], rounds: int) -> dict[str, Array]:
    """Return the units of work per second of processor time in each round, shape (rounds,), by the name of the contestant.

    Each contestant runs once without timing, then once per round.  The order rotates: each round begins with the next contestant.
    """
    names = list(contestants)
    measured: dict[str, list[float]] = {name: [] for name in names}
    for one in contestants.values():
        one.run()  # fills caches, does lazy set-up
    with _objects_frozen():
        for number in range(rounds):
            turn = number % len(names)
            for name in names[turn:] + names[:turn]:
                measured[name].append(_rate(contestants[name]))
    return {name: np.array(values) for name, values in measured.items()}


@contextlib.contextmanager
def _objects_frozen() -> Iterator[None]:
    """Exclude the objects that exist already from garbage collection."""
    gc.freeze()
    try:
        yield
    finally:
        gc.unfreeze()


def _rate(one: Contestant) -> float:
    gc.collect()
    gc.disable()
    _, seconds = processor_time(one.run)
    gc.enable()
    return one.count / seconds
