# SPDX-License-Identifier: Apache-2.0
"""The two threads of thesis figure 2.3, of which one moves every joint and one evaluates the model; and random boxes for the world."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np

from mobee import Model
from mobee.arrays import Array
from mobee.model import Geometry, box
from mobee.model.kinematics import matrix_from_quaternion
from mobee.model.pose import Pose
from mobee.robot.robot import Robot

CONTROL_PERIOD = 0.01  # s (thesis 2.4)
FREQUENCIES = (0.1, 0.5)  # Hz, a different one for each motor, so that the pose never repeats
# By default a thread waits 5 ms for another that computes in Python, as the editing one does; that would dominate the measurement.
SWITCH_INTERVAL = 5e-5  # s

SPACE = 1.0  # m, edge of the cube that holds the centres
EDGES = (0.02, 0.1)  # m
# Centre of that cube, in the reach of the robot.
MIDDLE = {"icub": (-0.5, 0.0, 0.1), "katana": (0.0, 0.0, 0.0)}


class Oscillator:
    """Moves every motor sinusoidally through its whole range, each with its own random frequency (0.1 to 0.5 Hz) and phase."""

    def __init__(self, robot: Robot, rng: np.random.Generator) -> None:
        low, high = robot.limits.T
        self._middle, self._amplitude = (low + high) / 2.0, (high - low) / 2.0
        self._rate = 2.0 * np.pi * rng.uniform(*FREQUENCIES, len(low))
        self._phase = rng.uniform(0.0, 2.0 * np.pi, len(low))

    def at(self, t: float) -> Array:
        """Return the positions of all motors (n,) rad at time `t` [s]."""
        posture: Array = self._middle + self._amplitude * np.sin(self._rate * t + self._phase)
        return posture


class MovingModel:
    """A context manager in which one thread moves the robot and another evaluates the model without a pause.

    `watch` is called in the evaluating thread with every pose.  `evaluations`: number so far.  `error`: the exception that has ended a
    thread, or None.
    """

    def __init__(self, model: Model, oscillator: Oscillator, watch: Callable[[Pose], None] = lambda _: None) -> None:
        self.evaluations = 0
        self.error: BaseException | None = None
        self._model, self._oscillator, self._watch = model, oscillator, watch
        self._q = oscillator.at(0.0)
        self._end = threading.Event()
        self._threads = [threading.Thread(target=self._guarded, args=(work,), daemon=True) for work in (self._move, self._evaluate)]

    def __enter__(self) -> MovingModel:
        for thread in self._threads:
            thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._end.set()
        for thread in self._threads:
            thread.join()

    def check(self) -> None:
        """Raise the exception that has ended one of the threads; return if there is none."""
        if self.error is not None:
            raise self.error

    def _guarded(self, work: Callable[[], None]) -> None:
        try:
            work()
        except BaseException as error:  # raised again by `check` in the thread that waits for it
            self.error = error
            self._end.set()

    def _move(self) -> None:
        begin = time.perf_counter()
        while not self._end.wait(CONTROL_PERIOD):
            self._q = self._oscillator.at(time.perf_counter() - begin)

    def _evaluate(self) -> None:
        while not self._end.is_set():
            pose = self._model.evaluate(self._q)
            self._model.world.follow(pose)
            _ = pose.table
            self.evaluations += 1
            self._watch(pose)


@contextmanager
def fast_thread_switching() -> Iterator[None]:
    """Let the threads of Python switch every SWITCH_INTERVAL (50 us) in this context manager, not every 5 ms."""
    before = sys.getswitchinterval()
    sys.setswitchinterval(SWITCH_INTERVAL)
    try:
        yield
    finally:
        sys.setswitchinterval(before)


@dataclass(frozen=True, slots=True, eq=False)
class Box:
    """A box and its pose, as `World.add` takes them.

    `position` (3,) m and `rotation` (3, 3), root frame.
    """

    shape: Geometry
    position: Array
    rotation: Array


def random_boxes(rng: np.random.Generator, robot: str, count: int) -> list[Box]:
    """Return `count` boxes of random size, orientation and position.

    The edges are 2 to 10 cm long.  The centres are in a cube of 1 m within reach of the robot; `robot`: "icub" or "katana".
    """
    middle = np.array(MIDDLE[robot])
    boxes = []
    for _ in range(count):
        quaternion = rng.normal(size=4)
        place = middle + rng.uniform(-SPACE / 2.0, SPACE / 2.0, 3)
        boxes.append(Box(box(*rng.uniform(*EDGES, 3)), place, matrix_from_quaternion(quaternion / np.linalg.norm(quaternion))))
    return boxes
