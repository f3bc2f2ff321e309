"""Weighted sums over histories.  Compiled."""

from __future__ import annotations

from math import exp, sqrt

import numpy as np

from mobee.engine.compiled import entry_exact
from mobee.robot.robot import Array, Ints

FAR = 30.0  # squared distance at which a Gaussian weight, 3e-7, is taken for none


@entry_exact("void(float64[:,::1], int64, float64[::1], float64, float64, int64[:,::1], float64[:,::1], int64, float64[::1], float64[::1])")
def weighted_sums(
    targets: Array, known: int, target: Array, scale: float, near: float, keys: Ints, sums: Array, used: int, totals: Array, weights: Array
) -> None:
    """Add up what each action brought on targets near this one, and how much that counts.

    `targets` (..., 3) m, of which so many are `known`, `target` (3,) m.  `keys` (..., 2): action and number of the target of each
    entry, of which so many are `used`; `sums` (..., 2): sum and number of its values.  The weight of a target at a distance d is
    1 / (1 + d / scale), none beyond `near` m.  `totals` and `weights`, (actions,), are added to.
    """
    weight = np.empty(known)
    for i in range(known):
        x, y, z = targets[i, 0] - target[0], targets[i, 1] - target[1], targets[i, 2] - target[2]
        distance = sqrt(x * x + y * y + z * z)
        weight[i] = 1.0 / (1.0 + distance / scale) if distance <= near else 0.0
    for k in range(used):
        action, share = keys[k, 0], weight[keys[k, 1]]
        totals[action] += share * sums[k, 0]
        weights[action] += share * sums[k, 1]


@entry_exact("void(float64[:,::1], float64[:,::1], int64, int64, float64[:,::1])")
def gaussian_sums(asked: Array, events: Array, first: int, end: int, sums: Array) -> None:
    """Add to `sums` (2, n), at each point asked about (n, d), the weights times values of events, and the weights.

    Events first to end are rows of a point and a value, (..., d + 1).  The weight at a distance r is exp(-r^2 / 2).
    """
    for k in range(first, end):
        for i in range(len(asked)):
            far = 0.0
            for axis in range(asked.shape[1]):
                gap = asked[i, axis] - events[k, axis]
                far += gap * gap
                if far > FAR:
                    break
            if far <= FAR:
                weight = exp(-0.5 * far)
                sums[0, i] += weight * events[k, asked.shape[1]]
                sums[1, i] += weight
