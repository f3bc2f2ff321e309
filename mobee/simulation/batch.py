"""Many offline plants: in one process through one call of the core, or in one process a core."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import ExitStack
from multiprocessing import get_context
from typing import TypeVar

import numpy as np

from mobee._core import plant as core
from mobee.arrays import checked_threads
from mobee.errors import BatchInterrupted, InvalidValue
from mobee.plant import Outcome
from mobee.simulation.plant import OfflinePlant
from mobee.simulation.runner import Trace, Work

T = TypeVar("T")


def advance_together(plants: Iterable[OfflinePlant], threads: int = 1) -> list[list[tuple[str, Outcome]]]:
    """Each plant's `advance()`, in their order; to the last bit the same as one after the other, for any number of threads.

    Raises InvalidValue before anything moves: for what is no OfflinePlant, a plant listed twice, one without an action under way, and
    plants in one world while one of them reaches or has a function to call (`every`).  Raises BatchInterrupted if a plant's state is
    lost or a function that it calls raises: the other plants go on to their ends, and its `results` hold how.
    """
    listed = _apart(plants)
    for number, plant in enumerate(listed):
        if not plant.acting:
            raise InvalidValue(f"plants[{number}]: no part of it is acting; call its begin, or leave it out")
    found = _finished([plant.advancing() for plant in listed], checked_threads(threads))
    last_in = {id(plant.model.world): plant for plant in listed}
    if len(last_in) < len(listed):  # they came to their ends in another order
        for plant in last_in.values():
            plant.follow()
    return found


def run_together(plants: Iterable[OfflinePlant], ticks: int, threads: int = 1) -> list[Trace]:
    """Each plant's `run(ticks)`; otherwise as `advance_together`, but no action needs to be under way."""
    listed = _apart(plants)
    if isinstance(ticks, bool) or not isinstance(ticks, int) or ticks < 0:
        raise InvalidValue(f"ticks={ticks!r}: give a whole number, 0 or more.")
    return _finished([plant.running(ticks) for plant in listed], checked_threads(threads))


def _apart(plants: Iterable[OfflinePlant]) -> list[OfflinePlant]:
    """The plants; raises InvalidValue if something is none, or if what one plant does could change how another goes on."""
    listed = list(plants)
    known: dict[int, int] = {}
    for number, plant in enumerate(listed):
        if not isinstance(plant, OfflinePlant):
            raise InvalidValue(f"plants[{number}] is {plant!r}; it must be an OfflinePlant.")
        if known.setdefault(id(plant), number) != number:
            raise InvalidValue(f"plants[{number}] is plants[{known[id(plant)]}] once more: list every plant once.")
    sharing = Counter(id(plant.model.world) for plant in listed)
    for number, plant in enumerate(listed):
        if plant.may_edit and sharing[id(plant.model.world)] > 1:
            raise InvalidValue(
                f"plants[{number}] reaches or calls a function meanwhile (every), and other plants share its world, which that edits: "
                "give each a Model of its own, with a World of its own."
            )
    return listed


def _finished(works: Sequence[Work[T]], threads: int) -> list[T]:
    """What each comes to; raises BatchInterrupted when all have come to an end."""
    results: dict[int, T] = {}
    lost: dict[int, Exception] = {}
    try:
        _go_on(dict(enumerate(works)), results, lost, threads)
    except BaseException:  # a Ctrl-C: each plant takes in what was run
        with ExitStack() as stack:
            for work in works:
                stack.callback(work.close)
        raise
    if lost:
        raise BatchInterrupted([lost.get(number, results.get(number)) for number in range(len(works))]) from lost[min(lost)]
    return [results[number] for number in range(len(works))]


def _go_on(waiting: dict[int, Work[T]], results: dict[int, T], lost: dict[int, Exception], threads: int) -> None:
    """Until all have come to an end."""
    run = core.calls().run_many
    while waiting:
        ready: dict[int, int] = {}
        for number, work in waiting.items():
            try:
                ready[number] = next(work)
            except StopIteration as end:
                results[number] = end.value
            except Exception as error:  # of whatever the plant calls: the others have to take in what they did
                lost[number] = error
        run(np.array([*ready.values()], dtype=np.int64).tobytes(), len(ready), threads)
        waiting = {number: waiting[number] for number in ready}


def run_batch(work: Callable[[int], T], seeds: Iterable[int], processes: int | None = None) -> list[T]:
    """`work(seed)` for every seed, in the order of the seeds, whatever finishes first.

    `work`: a function of a module, which makes a plant of that seed, uses it, and returns what can be pickled.  `processes`: how
    many at once; None: as many as there are cores, and with 1 all is done here.  Exceptions of `work` are raised here.
    """
    if processes is not None and (isinstance(processes, bool) or not isinstance(processes, int) or processes < 1):
        raise InvalidValue(f"processes={processes!r}: give a whole number from 1 on, or None for one a core.")
    given = list(seeds)
    count = min(processes or _cores(), len(given))
    if count <= 1:
        return [work(seed) for seed in given]
    with ProcessPoolExecutor(count, mp_context=get_context("spawn")) as pool:  # a fork would share locks that threads hold
        return list(pool.map(work, given))


def _cores() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
