# SPDX-License-Identifier: Apache-2.0
"""Times the work of benchmarks, and converts the times to those of a standard machine by fixed work, the calibration loop.

Processor time is measured on chosen cores, with the compared programs in turns.

The calibration loop is for benchmarks without a program to compare with.  It has nothing of MoBeE, and consists of three parts of equal
time: Python (calls, a dictionary, floating point numbers), NumPy with arrays of a few numbers, and NumPy with arrays of thousands, as in
most numerical programs.  The *standard machine* does the loop in STANDARD_SECONDS.  A time that is measured here, multiplied by the speed
of this machine at that moment, is the time on the standard machine.  Verdicts rest on that time, so they are the same on a machine three
times slower, and while other programs use this one.  Times that are not converted are printed, but not judged.

For work of several processes at once there is a `Crew`: helper processes that do the same loop.
"""

from __future__ import annotations

import contextlib
import gc
import math
import os
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

T = TypeVar("T")

STANDARD_SECONDS = 0.010
"""Processor time [s] of the calibration loop on the standard machine: one quiet core of the machine for which the requirements were set."""
STANDARD_EXCHANGE_SECONDS = 0.016
"""Wall time [s] of the loop on the standard machine if two helper processes exchange messages for every portion, as in `Crew.exchanges`."""
SPEED_LIFETIME = 0.5  # s for which a measured speed counts as the present one
PORTIONS = 50  # of a loop; each is about the work of a service in a tick
_CALLS, _SMALL, _LARGE = 380, 12, 3  # repetitions in one portion
_MATRIX = np.random.default_rng(0).normal(size=(4, 4))
_ANGLES = np.linspace(0.0, 3.0, 2048)
_LOOP, _PORTION = b"l", b"p"
_MESSAGE_BYTES = 16  # of a tick


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


def rates(contestants: Mapping[str, Contestant], rounds: int) -> dict[str, NDArray[np.float64]]:
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


def portion() -> float:
    """Do one portion (1/50) of the calibration loop.  Returns a number that depends on all the work."""
    return _interpreted(_CALLS) + _on_small_arrays(_SMALL) + _on_large_arrays(_LARGE)


def loop() -> None:
    """Do the whole calibration loop once: PORTIONS (50) portions."""
    for _ in range(PORTIONS):
        portion()


def _interpreted(count: int) -> float:
    state, kept = {"a": 0.5, "b": 0.25}, []
    for number in range(count):
        a, b = state["a"], state["b"]
        state["a"] = math.cos(a) + 0.1 * b
        state["b"] = 0.5 * abs(a - b)
        kept.append((number, a))
    return state["a"]


def _on_small_arrays(count: int) -> float:
    v = np.ones(4)
    for _ in range(count):
        v = _MATRIX @ v
        v /= np.abs(v).max()
        v = np.where(v > 0.9, 0.5 * v, v) + 0.1
    return float(v[0])


def _on_large_arrays(count: int) -> float:
    x = _ANGLES
    for _ in range(count):
        x = np.sin(x) + 0.5 * np.sqrt(np.abs(x)) * x
    return float(x[-1])


def speed(loops: int = 3) -> float:
    """Return the present speed of this machine in multiples of the speed of the standard machine (STANDARD_SECONDS, 0.01 s).

    It is STANDARD_SECONDS over the median processor time of `loops` calibration loops.
    """
    seconds = []
    for _ in range(loops):
        start = time.process_time()
        loop()
        seconds.append(time.process_time() - start)
    return STANDARD_SECONDS / float(np.median(seconds))


class Calibration:
    """Measures the speed of this machine before and after other measurements; a measured speed is reused for half a second."""

    def __init__(self, measure_speed: Callable[[], float] = speed) -> None:
        """`measure_speed` returns the machine's speed in multiples of the standard machine's; the default measures it in this process."""
        self._measure_speed = measure_speed
        self._last, self._last_time = 0.0, -math.inf
        self.speeds: list[float] = []
        """All speeds measured so far, in multiples of the standard machine's speed."""

    def around(self, run: Callable[[], T]) -> tuple[T, float]:
        """Return the result of `run`, and the mean of the machine's speeds before and after it.

        The speeds are in multiples of that of the standard machine, the one for which the requirements were set.  A time in seconds
        multiplied by this speed is the time on the standard machine.
        """
        before = self._present_speed()
        result = run()
        return result, 0.5 * (before + self._present_speed())

    @property
    def median(self) -> float:
        """The median of all speeds measured so far, in multiples of the standard machine's speed.

        The standard machine is the one for which the requirements were set.
        """
        return float(np.median(self.speeds))

    def _present_speed(self) -> float:
        if time.monotonic() - self._last_time > SPEED_LIFETIME:
            self._last = self._measure_speed()
            self._last_time = time.monotonic()
            self.speeds.append(self._last)
        return self._last


class Crew:
    """`count` helper processes that do the calibration loop on request.  A context manager: the processes end when the context is left."""

    def __init__(self, count: int) -> None:
        self._ends: list[socket.socket] = []
        self._processes: list[subprocess.Popen[bytes]] = []
        for _ in range(count):
            here, there = socket.socketpair()
            self._processes.append(_start_helper(there, there))
            there.close()
            self._ends.append(here)
        self.loops(1)  # returns when all are up

    def __enter__(self) -> Crew:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        _end(self._ends, self._processes)

    def loops(self, count: int = 3) -> float:
        """Return the speed of this machine while all helpers do the calibration loop at the same time.

        In each of `count` measurements every helper does one loop.  The result is STANDARD_SECONDS (0.01 s) divided by the median wall
        time.  It is a multiple of the speed of the standard machine, the one for which the requirements were set.
        """
        return STANDARD_SECONDS / self._request(_LOOP, 1, count)

    def exchanges(self, count: int = 5) -> float:
        """Return the speed of this machine while processes exchange messages, in multiples of the standard machine's speed.

        The standard machine is the one for which the requirements were set.  In a measurement, this process sends 50 messages to all
        helpers.  For each message a helper does a portion (1/50) of the calibration loop and answers; when all helpers have answered, the
        next message is sent.  The speed is STANDARD_EXCHANGE_SECONDS (0.016 s) over the median wall time of `count` measurements.
        """
        return STANDARD_EXCHANGE_SECONDS / self._request(_PORTION, PORTIONS, count)

    def _request(self, message: bytes, times: int, count: int) -> float:
        """Return the median wall time [s] of `count` measurements: `times` messages to all helpers, each answered by all of them."""
        seconds = []
        for _ in range(count):
            start = time.perf_counter()
            for _ in range(times):
                for end in self._ends:
                    end.sendall(message)
                for end in self._ends:
                    end.recv(1)
            seconds.append(time.perf_counter() - start)
        return float(np.median(seconds))


def bare_ages(rate: float, seconds: float, helpers: int = 2) -> NDArray[np.int64]:
    """Measure the delay that the scheduling of this machine causes, with a chain of processes that do nothing but calibration portions.

    At each tick (`rate` [Hz], for `seconds`) this process reads the newest tick number that has passed through the whole chain, and records
    its age: how many ticks ago it was sent.  Then it does a portion of the calibration loop and sends the number of the tick to the first
    helper. Each of the `helpers` does a portion and sends the number to the next one, and the last helper sends it back to this process.

    Returns the ages [ticks] in all ticks, shape (round(rate * seconds),).
    """
    pairs = [socket.socketpair() for _ in range(helpers + 1)]
    processes = [_start_helper(pairs[number][1], pairs[number + 1][0]) for number in range(helpers)]
    ages, answered = [], 0
    first, last = pairs[0][0], pairs[-1][1]
    try:
        first.sendall(_message(0))
        last.recv(_MESSAGE_BYTES)  # returns when all are up
        last.setblocking(False)
        start = time.monotonic()
        for tick in range(1, round(rate * seconds) + 1):
            time.sleep(max(0.0, start + tick / rate - time.monotonic()))
            with contextlib.suppress(BlockingIOError):
                answered = _newest_tick(last.recv(65536), answered)
            ages.append(tick - answered)
            portion()
            first.sendall(_message(tick))
    finally:
        _end([end for pair in pairs for end in pair], processes)
    return np.array(ages)


def _message(tick: int) -> bytes:
    return f"t{tick:0{_MESSAGE_BYTES - 1}}".encode()


def _newest_tick(received: bytes, before: int) -> int:
    whole = received[: len(received) // _MESSAGE_BYTES * _MESSAGE_BYTES]
    return int(whole[1 - _MESSAGE_BYTES :]) if whole else before


def _start_helper(receives: socket.socket, sends: socket.socket) -> subprocess.Popen[bytes]:
    argv = [sys.executable, "-m", "mobee_system.run", "experiments.bench.timing", str(receives.fileno()), str(sends.fileno())]
    return subprocess.Popen(argv, pass_fds=(receives.fileno(), sends.fileno()))


def _end(ends: Sequence[socket.socket], processes: Sequence[subprocess.Popen[bytes]]) -> None:
    for end in ends:
        end.close()
    for process in processes:
        process.wait()


def _serve(receives: int, sends: int) -> None:
    """Do the work that each received message names and send the answer, until the other end is closed.

    Arguments: file descriptors for receiving and sending.
    """
    while received := os.read(receives, 65536):
        if received[:1] == _LOOP:
            loop()
            answer = _LOOP
        else:
            portion()
            answer = received[-_MESSAGE_BYTES:] if received[:1] == b"t" else _PORTION
        os.write(sends, answer)


if __name__ == "__main__":
    with contextlib.suppress(BrokenPipeError):
        _serve(int(sys.argv[1]), int(sys.argv[2]))
