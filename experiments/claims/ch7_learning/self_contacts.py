"""A plant that records the contacts of the robot with itself during each action, tick by tick."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from mobee import OfflinePlant, Outcome
from mobee.arrays import Array
from mobee.control.gains import SettleTest


@dataclass(frozen=True, slots=True)
class SelfContact:
    """The deepest overlap of two fields during an action."""

    pair: tuple[str, str]  # links
    depth: float  # m


class SelfContactPlant:
    """Acts as its plant does, to the last bit; `contacts` holds a SelfContact, or None, for every action so far."""

    def __init__(self, plant: OfflinePlant) -> None:
        self._plant = plant
        self.robot = plant.robot
        self.contacts: list[SelfContact | None] = []

    @property
    def q(self) -> Array:
        """See Plant."""
        return self._plant.q

    def measure(self, part: str) -> Array:
        """As the plant's."""
        return self._plant.measure(part)

    def act(self, part: str, target: Array) -> Outcome:
        """As the plant's: runs from check to check of the settle test."""
        plant, settle = self._plant, self._plant.controller.gains.settle
        where, start = self.robot.part(part).slice, plant.time - plant.dt
        test, ticks = SettleTest(settle, start), _ticks(settle.first_look, plant.dt)
        deepest, pose = 0.0, None
        plant.begin(part, target)
        while True:
            trace = plant.run(ticks)
            at = int(trace.field.argmax())
            if trace.field[at] > deepest:
                deepest, pose = float(trace.field[at]), trace.encoders[at]
            velocity = trace.velocity[-2:, where]
            verdict = test.update(plant.time - plant.dt, velocity[1], (velocity[1] - velocity[0]) / plant.dt)
            if verdict != "moving":
                break
            ticks = _ticks(settle.interval, plant.dt)
        self.contacts.append(None if pose is None else SelfContact(self._pair(pose), deepest))
        return Outcome(plant.measure(part), verdict == "settled", plant.time - plant.dt - start, ())

    def _pair(self, q: Array) -> tuple[str, str]:
        """The links of the deepest overlap of fields in the pose q (n,) rad."""
        table = self._plant.model.evaluate(q).table
        row = int(np.where(table.kind == 1, table.depth, -1.0).argmax())
        first, second = sorted(self.robot.links[int(link[row])] for link in (table.first_link, table.second_link))
        return first, second


def _ticks(time: float, dt: float) -> int:
    return math.ceil(time / dt - 1e-9)
