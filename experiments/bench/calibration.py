"""The calibration loop: fixed work, none of it MoBeE's, beside which figures are judged that have no peer.

A third of its time each goes to Python (calls, a dictionary, floating point numbers), to NumPy on arrays of a few numbers and to NumPy on
arrays of thousands: what programs of numbers are made of.  The *standard machine* does the loop in STANDARD seconds.  A time that
was measured here, times the speed of this machine beside it, is the time in seconds of the standard machine, and verdicts rest on that:
they stay what they are on a machine three times slower, and while others use this one.  Absolute figures are printed without a verdict.

For several processes at work together there is a `Crew`: helpers that do the same work, each a process.
"""

from __future__ import annotations

import contextlib
import math
import os
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from types import TracebackType
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

T = TypeVar("T")

STANDARD = 0.010
"""Seconds of the loop on the standard machine: one quiet core of the machine on which the requirements were set."""
STANDARD_EXCHANGE = 0.016
"""Seconds of the loop there for two processes that exchange a message for every portion."""
FRESH = 0.5  # s for which a measured speed counts as that of now
PORTIONS = 50  # that make up a loop: each about what a service does in a tick
_CALLS, _SMALL, _LARGE = 380, 12, 3  # of one portion
_MATRIX = np.random.default_rng(0).normal(size=(4, 4))
_ANGLES = np.linspace(0.0, 3.0, 2048)


def portion() -> float:
    """A fiftieth of the loop."""
    return _interpreted(_CALLS) + _on_small_arrays(_SMALL) + _on_large_arrays(_LARGE)


def loop() -> None:
    """The work itself."""
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
    """How fast this machine is now, in multiples of the standard machine: the median of some loops."""
    seconds = []
    for _ in range(loops):
        start = time.process_time()
        loop()
        seconds.append(time.process_time() - start)
    return STANDARD / float(np.median(seconds))


class Calibration:
    """Says how fast this machine was while something was measured, by looks before and after, at most two a second."""

    def __init__(self, look: Callable[[], float] = speed) -> None:
        """`look`: measures the speed; by default that of this process."""
        self._look_now = look
        self._last, self._at = 0.0, -math.inf
        self.speeds: list[float] = []
        """All that were seen."""

    def around(self, run: Callable[[], T]) -> tuple[T, float]:
        """What `run` gives, and the machine's speed about it: seconds, times that, are seconds of the standard machine."""
        before = self._look()
        result = run()
        return result, 0.5 * (before + self._look())

    @property
    def median(self) -> float:
        """The speed of this machine, over all."""
        return float(np.median(self.speeds))

    def _look(self) -> float:
        if time.monotonic() - self._at > FRESH:
            self._last = self._look_now()
            self._at = time.monotonic()
            self.speeds.append(self._last)
        return self._last


def told(speed: float) -> str:
    """A line about this machine, for reports."""
    return f"Calibration: {speed:.2f} x the standard machine's speed.  Required, in its time:"


class Crew:
    """Helper processes that do the calibration's work when they are told to.  A context: they end with it."""

    def __init__(self, count: int) -> None:
        self._ends: list[socket.socket] = []
        self._processes: list[subprocess.Popen[bytes]] = []
        for _ in range(count):
            here, there = socket.socketpair()
            self._processes.append(_helper(there, there))
            there.close()
            self._ends.append(here)
        self.loops(1)  # all are up

    def __enter__(self) -> Crew:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        _end(self._ends, self._processes)

    def loops(self, count: int = 3) -> float:
        """The machine's speed, in wall time, while everyone does the loop at once."""
        return STANDARD / self._told(_LOOP, 1, count)

    def exchanges(self, count: int = 5) -> float:
        """The same when each portion is asked for and answered by a message, and nobody goes on before everybody has answered."""
        return STANDARD_EXCHANGE / self._told(_PORTION, PORTIONS, count)

    def _told(self, what: bytes, times: int, count: int) -> float:
        seconds = []
        for _ in range(count):
            start = time.perf_counter()
            for _ in range(times):
                for end in self._ends:
                    end.sendall(what)
                for end in self._ends:
                    end.recv(1)
            seconds.append(time.perf_counter() - start)
        return float(np.median(seconds))


def bare_ages(rate: float, seconds: float, helpers: int = 2) -> NDArray[np.int64]:
    """Ages in ticks of the answers of a bare chain: what the machine's scheduling costs the live system.

    Once a tick this process looks for what the chain has answered, notes how many ticks ago that was asked, does a portion and sends
    the tick to the first of the helpers, each of which does a portion and hands it on.
    """
    pairs = [socket.socketpair() for _ in range(helpers + 1)]
    processes = [_helper(pairs[number][1], pairs[number + 1][0]) for number in range(helpers)]
    ages, answered = [], 0
    first, last = pairs[0][0], pairs[-1][1]
    try:
        first.sendall(_message(0))
        last.recv(_BYTES)  # all are up
        last.setblocking(False)
        start = time.monotonic()
        for tick in range(1, round(rate * seconds) + 1):
            time.sleep(max(0.0, start + tick / rate - time.monotonic()))
            with contextlib.suppress(BlockingIOError):
                answered = _newest(last.recv(65536), answered)
            ages.append(tick - answered)
            portion()
            first.sendall(_message(tick))
    finally:
        _end([end for pair in pairs for end in pair], processes)
    return np.array(ages)


_LOOP, _PORTION = b"l", b"p"
_BYTES = 16  # of a tick's message


def _message(tick: int) -> bytes:
    return f"t{tick:0{_BYTES - 1}}".encode()


def _newest(received: bytes, before: int) -> int:
    whole = received[: len(received) // _BYTES * _BYTES]
    return int(whole[1 - _BYTES :]) if whole else before


def _helper(gets: socket.socket, puts: socket.socket) -> subprocess.Popen[bytes]:
    argv = [sys.executable, "-m", "mobee_system.run", "experiments.bench.calibration", str(gets.fileno()), str(puts.fileno())]
    return subprocess.Popen(argv, pass_fds=(gets.fileno(), puts.fileno()))


def _end(ends: Sequence[socket.socket], processes: Sequence[subprocess.Popen[bytes]]) -> None:
    for end in ends:
        end.close()
    for process in processes:
        process.wait()


def _help(gets: int, puts: int) -> None:
    """Do what each message says and hand on its answer, until nobody sends any more."""
    while received := os.read(gets, 65536):
        if received[:1] == _LOOP:
            loop()
            answer = _LOOP
        else:
            portion()
            answer = received[-_BYTES:] if received[:1] == b"t" else _PORTION
        os.write(puts, answer)


if __name__ == "__main__":
    with contextlib.suppress(BrokenPipeError):
        _help(int(sys.argv[1]), int(sys.argv[2]))
