# SPDX-License-Identifier: Apache-2.0
"""Several offline plants (simulated robots) of one model; their states are rows of arrays; one call of the core reads or runs them all."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mobee._core import address
from mobee._core import plant as core
from mobee.arrays import Array, Ints, checked_threads
from mobee.errors import ActionInterrupted, BatchInterrupted
from mobee.model.model import Model
from mobee.simulation.batch import run_together
from mobee.simulation.plant import OfflinePlant, PlantSettings
from mobee.simulation.runner import Trace


class PlantBatch:
    """Several offline plants (simulated robots) of one model; the results of each are bit-equal to those of a separate `OfflinePlant`.

    In all methods, `which` (k,) are indices of `plants`, each at most once.

    Args:
        model: the robot in its world.
        count: number of plants.
        settings: settings of all plants; None: the defaults of `PlantSettings`.
        threads: number of threads of the simulation.
    """

    def __init__(self, model: Model, count: int, settings: PlantSettings | None = None, threads: int = 1) -> None:
        self.plants = [OfflinePlant(model, settings=settings) for _ in range(count)]
        """The plants; each may be used separately between two calls."""
        self._model, self._threads, self._core = model, checked_threads(threads), core.calls()
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

        No action begins, and the limits of the motors are not checked.
        """
        self._core.aim_many(self._addresses[which].tobytes(), len(which), np.ascontiguousarray(attractors).tobytes())

    def run(self, which: Ints, ticks: int) -> Array:
        """Run exactly `ticks` ticks of each of the plants `which` (k,); return the depths of their deepest contacts.

        The end of an action does not stop the run. The result is (k, 2) m, of contacts of solids and of fields (volumes that cause
        repulsive forces) during these ticks; 0 without contacts. Raises BatchInterrupted if a plant's state is not finite; the attribute
        `results` of the exception then holds the rows of the other plants.
        """
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


def _run_traced(plants: Sequence[OfflinePlant], ticks: int, threads: int) -> Array:
    """Do what `PlantBatch.run` does, for plants some of which need Python in their ticks."""
    try:
        return np.array([_deepest(trace) for trace in run_together(plants, ticks, threads)])
    except BatchInterrupted as error:
        results = [_deepest(one) if isinstance(one, Trace) else one for one in error.results]
        raise BatchInterrupted(results) from error.__cause__


def _deepest(trace: Trace) -> Array:
    return np.array([trace.solid.max(initial=0.0), trace.field.max(initial=0.0)])
