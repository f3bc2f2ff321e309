"""Makes the postures of neighbours alike, so that a map has few edges on which the robot would turn itself inside out."""

from __future__ import annotations

import numpy as np

from mobee.roadmap.building.goals import Goals
from mobee.robot.robot import Array, Ints

STEP = 0.25  # rad: where a motor moves further along an edge, the postures about it are drawn together
SWEEPS = 32


def made_alike(goals: Goals, wanted: Array, q: Array, y: Array, pairs: Ints, rng: np.random.Generator) -> tuple[Array, Array]:
    """Poses q (V, n) and task points y (V, m), of which some have been solved anew from between their neighbours' postures.

    `wanted`: (V, m) task points that are to be met; `pairs`: (E, 2) neighbours.  A new pose is taken if it is valid and nearer to its
    neighbours in joint space: it has a smaller sum of squares.
    """
    q, y = q.copy(), y.copy()
    both = np.concatenate([pairs, pairs[:, ::-1]])
    for _ in range(SWEEPS):
        far = np.abs(q[pairs[:, 0]] - q[pairs[:, 1]]).max(axis=1) > STEP
        rough = np.zeros(len(q), dtype=bool)
        rough[pairs[far]] = True
        rough[both[rough[both[:, 0]], 1]] = True
        rough &= rng.random(len(q)) < 0.5  # two that change places with each other would never meet
        chosen = np.flatnonzero(rough)
        if not len(chosen):
            continue
        number = np.full(len(q), -1)
        number[chosen] = np.arange(len(chosen))
        own, other = (both[rough[both[:, 0]]]).T
        slot = number[own]
        middle = np.zeros((len(chosen), q.shape[1]))
        np.add.at(middle, slot, q[other])
        middle /= np.bincount(slot, minlength=len(chosen))[:, None]
        share = rng.choice([0.5, 1.0], (len(chosen), 1))
        there, task, wrong, _ = goals.solve(wanted[chosen], q[chosen] + share * (middle - q[chosen]))
        before = np.bincount(slot, ((q[other] - q[own]) ** 2).sum(axis=1), len(chosen))
        after = np.bincount(slot, ((q[other] - there[slot]) ** 2).sum(axis=1), len(chosen))
        better = (wrong == 0.0) & (after < before)
        q[chosen[better]], y[chosen[better]] = there[better], task[better]
    return q, y
