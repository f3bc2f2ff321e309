"""Thesis Algorithm 1, FLOOD_MODEL: boxes are removed and created without any waiting, ever more of them."""

from __future__ import annotations

import itertools
import random
import time
from collections.abc import Callable, Iterator

import numpy as np

from experiments.flood.boxes import random_boxes
from experiments.flood.rates import NUMBERS
from experiments.flood.records import Record
from experiments.flood.threads import MovingModel, Oscillator, quick_hand_over
from mobee import Model, World, load_robot

STILL_FOR = 0.5  # s
POOL = 4000  # boxes made beforehand: the flood shall not wait for random numbers


class Flood:
    """Any number of boxes in a world, and the quickest way to replace a random one."""

    def __init__(self, world: World, robot: str, seed: int) -> None:
        self._world = world
        self._boxes = itertools.cycle(random_boxes(np.random.default_rng(seed), robot, POOL))
        self._numbers = itertools.count()
        self._choose = random.Random(seed).randrange
        self.names: list[str] = []

    def create_object(self) -> None:
        """Add a box."""
        self.names.append(self._new())

    def replace_objects(self, times: int) -> None:
        """Remove a random box and create one, so many times."""
        for _ in range(times):
            place = self._choose(len(self.names))
            self._world.remove(self.names[place])
            self.names[place] = self._new()

    def _new(self) -> str:
        name, made = f"box {next(self._numbers)}", next(self._boxes)
        self._world.add(name, made.shape, position=made.position, rotation=made.rotation)
        return name


def flood_model(robot: str, *, first: int, last: int, edits: int, seed: int, is_over: Callable[[], bool]) -> Iterator[Record]:
    """FLOOD_MODEL from `first` to `last` objects, `edits` removals and creations at each number; a record a number.

    After the flood at each of NUMBERS comes a record without edits.  Ends early when `is_over`.
    """
    model = Model(load_robot(robot))
    flood = Flood(model.world, robot, seed)
    while len(flood.names) < first - 1:
        flood.create_object()
    oscillator = Oscillator(model.robot, np.random.default_rng(seed))
    with quick_hand_over(), MovingModel(model, oscillator) as moving:
        timer = _Timer(robot, moving)
        time.sleep(STILL_FOR)  # what is loaded or built at first is not timed
        if first == 1:
            yield timer.record(0, 0, lambda: time.sleep(STILL_FOR))
        for objects in range(first, last + 1):
            if is_over():
                return
            flood.create_object()
            yield timer.record(objects, edits, lambda: flood.replace_objects(edits))
            if objects in NUMBERS:
                yield timer.record(objects, 0, lambda: time.sleep(STILL_FOR))


class _Timer:
    def __init__(self, robot: str, moving: MovingModel) -> None:
        self._robot, self._moving = robot, moving

    def record(self, objects: int, edits: int, work: Callable[[], None]) -> Record:
        begin, before = time.perf_counter(), self._moving.evaluations
        work()
        seconds, evaluations = time.perf_counter() - begin, self._moving.evaluations - before
        self._moving.check()
        return Record(robot=self._robot, objects=objects, edits=2 * edits, seconds=round(seconds, 6), evaluations=evaluations)
