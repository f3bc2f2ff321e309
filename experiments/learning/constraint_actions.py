"""The actions that meet constraints, which are those that fail in more than half of all tries, and how often a run tries them.

What a run is judged by is chosen from the other runs: the tries of an action that fails by chance are not counted on both sides.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from experiments.learning.explored import Explored
from mobee.robot.robot import Array, Ints


def constraint_actions(runs: Sequence[Explored]) -> Array:
    """Which state-actions (E,) failed in more than half of the tries of all runs, at least one, together; all False without runs."""
    return np.asarray(2 * sum(run.failures for run in runs) > sum(run.tries for run in runs))


def relative_tries(tries: Ints, chosen: Array) -> float:
    """Mean tries of the chosen state-actions over those of the others; NaN if there are none to compare."""
    if not chosen.any() or not tries[~chosen].any():
        return float("nan")
    return float(tries[chosen].mean() / tries[~chosen].mean())


def relative_tries_of(judged: Sequence[Explored], runs: Sequence[Explored]) -> list[float]:
    """`relative_tries` of each judged run at what fails in the other `runs`; without those that have none to compare."""
    ratios = [relative_tries(one.tries, constraint_actions([run for run in runs if run is not one])) for one in judged]
    return [ratio for ratio in ratios if np.isfinite(ratio)]
