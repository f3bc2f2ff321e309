# SPDX-License-Identifier: Apache-2.0
"""Runs many offline plants (simulated robots) at once: in one call of the compiled core, or in one process for each processor core.

The states of the plants of a `PlantBatch`, which have one model, are rows of arrays.
"""

from __future__ import annotations

import os
import reprlib
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import ExitStack
from multiprocessing import get_context
from typing import TypeVar

import numpy as np

from mobee._core import address
from mobee._core import plant as core
from mobee.arrays import Array, Ints, checked_count, checked_threads, real_array
from mobee.errors import ActionInterrupted, BatchInterrupted, InvalidValue
from mobee.model.model import Model
from mobee.plant import Outcome
from mobee.simulation.plant import OfflinePlant, PlantSettings
from mobee.simulation.runner import Trace, Work

T = TypeVar("T")


def advance_together(plants: Iterable[OfflinePlant], threads: int = 1) -> list[list[tuple[str, Outcome]]]:
    """Run each plant (simulated robot) until an action of it has ended; return the list of (part, outcome) of each plant, in their order.

    The results are bit-equal to those of separate calls of `OfflinePlant.advance`, for any number of threads.

    Raises:
        InvalidValue: before any plant moves, if threads are not valid, an object is no OfflinePlant, a plant is listed twice, or no action
            of a plant is in progress. Also if a plant shares its world with another one and could change it, which is so while a reach of
            it is in progress, or while it has a callback (`OfflinePlant.every`).
        BatchInterrupted: a plant's state is not finite, or its callback raised an exception; the other plants finish, and the attribute
            `results` of the exception holds the result of each plant, or the exception that ended it.
    """
    listed = _apart(plants)
    for number, plant in enumerate(listed):
        if not plant.acting:
            raise InvalidValue(f"plants[{number}]: no part of it is acting; call its begin, or leave it out")
    found = _finished([plant.advancing() for plant in listed], checked_threads(threads))
    _follow_last(listed)
    return found


def run_together(plants: Iterable[OfflinePlant], ticks: int, threads: int = 1) -> list[Trace]:
    """Run each plant (simulated robot) for a number of ticks; return their traces (records of each tick) in the order of the plants.

    The results are bit-equal to those of separate calls of `OfflinePlant.run`, for any number of threads.

    Raises:
        InvalidValue: before any plant moves, if ticks or threads are not valid, an object is no OfflinePlant, or a plant is listed twice.
            Also if a plant shares its world with another one and could change it, which is so while a reach of it is in progress, or while
            it has a callback (`OfflinePlant.every`).
        BatchInterrupted: a plant's state is not finite, or its callback raised an exception; the other plants finish, and the attribute
            `results` of the exception holds the trace of each plant, or the exception that ended it.
    """
    listed = _apart(plants)
    count, acting = checked_count("ticks", ticks), [len(plant.acting) for plant in listed]
    found = _finished([plant.running(count) for plant in listed], checked_threads(threads))
    _follow_last([plant for plant, before in zip(listed, acting, strict=True) if len(plant.acting) < before])
    return found


def run_batch(work: Callable[[int], T], seeds: Iterable[int], processes: int | None = None) -> list[T]:
    """Call `work(seed)` for every seed in several processes; return the results in the order of the seeds.

    `work`: a function defined at the top level of a module, so that processes can import it; it makes a plant with the seed, uses it, and
    returns an object that can be pickled. `processes`: number of processes; None: one for each processor core; 1: in this process.
    Exceptions of `work` are raised here.
    """
    given = list(seeds)
    count = min(_cores() if processes is None else checked_count("processes", processes, 1), len(given))
    if count <= 1:
        return [work(seed) for seed in given]
    with ProcessPoolExecutor(count, mp_context=get_context("spawn")) as pool:  # a fork could copy locks that are held by threads
        return list(pool.map(work, given))


class PlantBatch:
    """Several offline plants (simulated robots) of one model; the results of each are bit-equal to those of a separate `OfflinePlant`.

    All plants have the seed 0, so that the noise of their encoders is equal; `plants[k].restart(seed)` gives a plant another seed. In all
    methods, `which` (k,) are indices of `plants`, each at most once; other values raise InvalidValue.

    Args:
        model: the robot in its world.
        count: number of plants.
        settings: settings of all plants; None: the defaults of `PlantSettings`.
        threads: number of threads of the simulation.

    Raises:
        InvalidValue: `count` or `threads` is not valid.
    """

    def __init__(self, model: Model, count: int, settings: PlantSettings | None = None, threads: int = 1) -> None:
        self.plants = [OfflinePlant(model, settings=settings) for _ in range(checked_count("count", count))]
        """The plants; each may be used separately between two calls."""
        self._model, self._threads, self._core = model, checked_threads(threads), core.calls()
        self._numbers = frozenset(range(len(self.plants)))
        self._addresses: Ints = np.array([plant.address for plant in self.plants], dtype=np.int64)
        self._deepest = np.zeros((count, core.RECORD_DEPTHS))

    def state(self) -> Array:
        """Return encoders [rad], attractors [rad] and velocities [rad/s] of all plants, in this order, (count, 3, n).

        An attractor is the position to which the controller moves a motor. The velocities are those of the control law's own state, which
        are not measured.
        """
        state = np.empty((len(self.plants), 3, len(self._model.robot.motors)))
        self._core.read_many(self._addresses.tobytes(), len(self.plants), address(state))
        return state

    def aim(self, which: Ints, attractors: Array) -> None:
        """Set the attractors of the plants `which` (k,) to `attractors` (k, n) rad, positions to which the controllers move the motors.

        No action begins, and the limits of the motors are not checked. Raises InvalidValue for another shape, and for numbers that are not
        finite.
        """
        places = self._addresses[self._checked(which)]
        wanted, shape = real_array("attractors", attractors), (len(places), len(self._model.robot.motors))
        if wanted.shape != shape or not np.isfinite(wanted).all():
            raise InvalidValue(f"attractors of shape {wanted.shape}: must be {shape} rad, finite.")
        self._core.aim_many(places.tobytes(), len(places), wanted.tobytes())

    def run(self, which: Ints, ticks: int) -> Array:
        """Run exactly `ticks` ticks of each of the plants `which` (k,); return the depths of their deepest contacts.

        The end of an action does not stop the run. The result is (k, 2) m, of contacts of solids and of fields (volumes that cause
        repulsive forces) during these ticks; 0 without contacts. Raises InvalidValue unless `ticks` is a whole number of at least 0, and
        BatchInterrupted if a plant's state is not finite; the attribute `results` of the exception then holds the rows of the other plants.
        """
        which, ticks = self._checked(which), checked_count("ticks", ticks)
        chosen = [self.plants[number] for number in which.tolist()]
        if not all([plant.prepare_batch(self._deepest[number]) for number, plant in zip(which.tolist(), chosen, strict=True)]):
            return _run_traced(chosen, ticks, self._threads)
        self._deepest[which] = 0.0
        self._core.run_for(self._addresses[which].tobytes(), len(which), ticks, self._threads)
        deepest, lost = self._deepest[which], dict[int, ActionInterrupted]()
        for row, plant in enumerate(chosen):
            try:
                plant.conclude()
            except ActionInterrupted as error:
                lost[row] = error
        if lost:
            raise BatchInterrupted([lost.get(row, depths) for row, depths in enumerate(deepest)]) from lost[min(lost)]
        return deepest

    def _checked(self, which: Ints) -> Ints:
        """Return the indices as an array; raises InvalidValue unless they are distinct indices of plants."""
        given = np.asarray(which)
        whole = given.ndim == 1 and (given.dtype.kind in "iu" or not given.size)
        numbers = set(given.tolist()) if whole else set()  # NumPy is slower for so few
        if not whole or len(numbers) < len(given) or not numbers <= self._numbers:
            valid = f"indices of plants, 0 to {len(self.plants) - 1}, each at most once" if self.plants else "empty, as there are no plants"
            text = " ".join(reprlib.repr(given).split())
            raise InvalidValue(f"which is {text}; it must be {valid}; use np.flatnonzero(mask) for a mask.")
        return given.astype(np.intp, copy=False)


def _run_traced(plants: Sequence[OfflinePlant], ticks: int, threads: int) -> Array:
    """Return the result of `PlantBatch.run` for plants of which at least one cannot prepare its ticks for the core.

    The result is (k, 2) m, the depths of the deepest contacts of solids and of fields in each plant. Raises BatchInterrupted like `run`.
    """
    try:
        return np.array([_deepest(trace) for trace in run_together(plants, ticks, threads)])
    except BatchInterrupted as error:
        results = [_deepest(one) if isinstance(one, Trace) else one for one in error.results]
        raise BatchInterrupted(results) from error.__cause__


def _deepest(trace: Trace) -> Array:
    return np.array([trace.solid.max(initial=0.0), trace.field.max(initial=0.0)])


def _apart(plants: Iterable[OfflinePlant]) -> list[OfflinePlant]:
    """Return the plants as a list; raises InvalidValue if an entry is no plant, or if one plant could change the world of another."""
    listed = list(plants)
    known: dict[int, int] = {}
    for number, plant in enumerate(listed):
        if not isinstance(plant, OfflinePlant):
            raise InvalidValue(f"plants[{number}] is {plant!r}; it must be an OfflinePlant.")
        if known.setdefault(id(plant), number) != number:
            raise InvalidValue(f"plants[{number}] is plants[{known[id(plant)]}] again: list every plant once.")
    sharing = Counter(id(plant.model.world) for plant in listed)
    for number, plant in enumerate(listed):
        if plant.may_edit and sharing[id(plant.model.world)] > 1:
            raise InvalidValue(
                f"plants[{number}] reaches or calls a function meanwhile (every), and other plants share its world, which that edits: "
                "give each a Model of its own, with a World of its own."
            )
    return listed


def _follow_last(plants: Sequence[OfflinePlant]) -> None:
    """Let each world that several plants share follow the last of them, as after separate calls: they may have ended in another order."""
    last_in = {id(plant.model.world): plant for plant in plants}
    if len(last_in) < len(plants):
        for plant in last_in.values():
            plant.follow()


def _finished(works: Sequence[Work[T]], threads: int) -> list[T]:
    """Return the result of each; raises BatchInterrupted, after all have ended, if some failed."""
    results: dict[int, T] = {}
    lost: dict[int, Exception] = {}
    try:
        _run_all(dict(enumerate(works)), results, lost, threads)
    except BaseException:  # a Ctrl-C: each plant takes over the ticks that were run
        with ExitStack() as stack:
            for work in works:
                stack.callback(work.close)
        raise
    if lost:
        raise BatchInterrupted([lost.get(number, results.get(number)) for number in range(len(works))]) from lost[min(lost)]
    return [results[number] for number in range(len(works))]


def _run_all(waiting: dict[int, Work[T]], results: dict[int, T], lost: dict[int, Exception], threads: int) -> None:
    """Run all until each has ended; results and exceptions are collected by number."""
    run = core.calls().run_many
    while waiting:
        ready: dict[int, int] = {}
        for number, work in waiting.items():
            try:
                ready[number] = next(work)
            except StopIteration as end:
                results[number] = end.value
            except Exception as error:  # of a function that the plant calls: the other plants continue
                lost[number] = error
        run(np.array([*ready.values()], dtype=np.int64).tobytes(), len(ready), threads)
        waiting = {number: waiting[number] for number in ready}


def _cores() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
