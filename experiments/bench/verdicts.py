"""Requirements and verdicts of benchmarks, and the interleaved measurement of rates.

Figures that are judged are ratios, sizes or counts, or times on the standard machine (calibration.py): never bare times.
"""

from __future__ import annotations

import contextlib
import gc
import os
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from mobee.arrays import Array


def judged(
    name: str, found: float, *, at_least: float | None = None, at_most: float | None = None, aim: float | None = None
) -> dict[str, Any]:
    """One requirement as JSON has it; `aim`: what is hoped for, which decides nothing."""
    passed = (at_least is None or found >= at_least) and (at_most is None or found <= at_most)
    bounds = {"at_least": at_least, "at_most": at_most, "aim": aim}
    return {
        "name": name,
        "found": float(found),
        **{key: bound for key, bound in bounds.items() if bound is not None},
        "passed": bool(passed),
    }


def all_passed(requirements: Iterable[Mapping[str, Any]]) -> bool:
    """Whether everything required is met."""
    return all(one["passed"] for one in requirements)


def lines(requirements: Iterable[Mapping[str, Any]]) -> list[str]:
    """A line each of at most 80 columns, that ends with its verdict."""
    return [
        f"  {one['name']:<44}{_number(one['found']):>9} {_bound(one):>8} {_aim(one):<9} {'pass' if one['passed'] else 'SHORT'}"
        for one in requirements
    ]


def _number(value: float) -> str:
    return f"{value:.0f}" if 1e4 <= abs(value) < 1e7 else f"{value:.4g}"


def _bound(one: Mapping[str, Any]) -> str:
    return f">= {_number(one['at_least'])}" if "at_least" in one else f"<= {_number(one['at_most'])}"


def _aim(one: Mapping[str, Any]) -> str:
    return f"aim {one['aim']:g}" if "aim" in one else ""


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
