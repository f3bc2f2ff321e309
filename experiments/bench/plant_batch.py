"""Many plants that go on together, against one plant alone: processor time on one core, and what a second thread brings."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from experiments.bench.plant_workload import DT, LEFT, LEVELS, SEED, robot
from experiments.bench.verdicts import one_core, some_cores
from experiments.kit.command_line import Progress
from mobee import Gains, Lattice, Model, OfflinePlant, advance_together
from mobee.robot.robot import Robot

PLANTS = 64
LEAST = 1.5  # ticks a second of processor time of the batch, times those of one plant alone


@dataclass(frozen=True, slots=True)
class Spent:
    """What some ticks took."""

    ticks: int
    processor: float  # s
    wall: float  # s

    @property
    def numbers(self) -> dict[str, float]:
        """For people and scripts."""
        return {"us_per_tick": 1e6 * self.processor / self.ticks, "ticks_per_second": self.ticks / self.processor}


class Batch:
    """Plants of one robot, one arm each, that go to random goals of the lattice; in worlds of their own, as learners have them."""

    def __init__(self, body: Robot, count: int = PLANTS) -> None:
        self.plants = [OfflinePlant(Model(body), SEED + k, Gains.published_2014(), dt=DT, active=LEFT) for k in range(count)]
        self._space, self._rng = Lattice(body, LEFT, LEVELS), np.random.default_rng(SEED)

    def alone(self, actions: int) -> Spent:
        """That many actions of each plant, one action after the other."""
        return self._timed(actions, lambda goals: [plant.act("left_arm", goal) for plant, goal in zip(self.plants, goals, strict=True)])

    def together(self, actions: int, threads: int = 1) -> Spent:
        """That many actions of each plant, all plants at once."""
        return self._timed(actions, lambda goals: self._go(goals, threads))

    def _go(self, goals: Sequence[Any], threads: int) -> None:
        for plant, goal in zip(self.plants, goals, strict=True):
            plant.begin("left_arm", goal)
        advance_together(self.plants, threads)

    def _timed(self, actions: int, go: Callable[[Sequence[Any]], object]) -> Spent:
        states = self._rng.integers(len(self._space), size=(actions, len(self.plants)))
        goals = [[self._space.target(int(state)) for state in row] for row in states]
        before, wall, processor = self._ticks, time.perf_counter(), time.process_time()
        for row in goals:
            go(row)
        return Spent(self._ticks - before, time.process_time() - processor, time.perf_counter() - wall)

    @property
    def _ticks(self) -> int:
        return sum(round(plant.time / plant.dt) for plant in self.plants)


def measure(actions: int, rounds: int) -> dict[str, Any]:
    """Medians of rounds in which all take turns; `actions`: of each plant of the batch in a round."""
    body = robot()
    one, many, shared = Batch(body, 1), Batch(body), Batch(body)
    for batch in (many, shared):
        batch.together(1)
    one.alone(actions)
    pairs, walls = [], []
    with Progress() as progress:
        with one_core():
            for number in range(rounds):
                progress.show(0.5 * number / rounds, f"{PLANTS} plants in a batch")
                pairs.append((one.alone(actions * PLANTS), many.together(actions)))
        with some_cores(2) as cores:
            for number in range(rounds if len(cores) == 2 else 0):
                progress.show(0.5 + 0.5 * number / rounds, f"{PLANTS} plants, two threads")
                walls.append((many.together(actions), shared.together(actions, threads=2)))
    found = {
        name: {key: float(np.median([pair[place].numbers[key] for pair in pairs])) for key in pairs[0][place].numbers}
        for place, name in enumerate(("alone", "together"))
    }
    ratio = [together.numbers["ticks_per_second"] / alone.numbers["ticks_per_second"] for alone, together in pairs]
    gains = [two.ticks / two.wall / (single.ticks / single.wall) for single, two in walls]
    return {"plants": PLANTS, **found, "ratio": float(np.median(ratio)), "two_threads": float(np.median(gains)) if gains else None}


def told(result: dict[str, Any]) -> str:
    """The same for people."""
    alone, together = (result[name]["us_per_tick"] for name in ("alone", "together"))
    threads = "not measured on one core" if result["two_threads"] is None else f"{result['two_threads']:.2f} x the ticks a second"
    return (
        f"{result['plants']} plants in a batch: {together:.3f} us a tick, one alone {alone:.3f}; {result['ratio']:.2f} x the ticks\n"
        f"a second of processor time; two threads against one: {threads}."
    )
