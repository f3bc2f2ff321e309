"""Many independent plants at once, each in a process of its own core; the result is that of one after the other."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from typing import TypeVar

from mobee.errors import InvalidValue

T = TypeVar("T")


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
