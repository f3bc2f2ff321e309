# SPDX-License-Identifier: Apache-2.0
"""Measures of runs in which an agent explores reaching: scores, choices of states, tries, failed actions and robot time (thesis 8.4)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from experiments.kit.cells import CellResult
from experiments.kit.reaching.arm import MARKER, reach_space
from experiments.kit.reaching.targets import grid
from experiments.kit.sweep import Cells, runs_by
from mobee.arrays import Array, Ints
from mobee.learning.reaching.evaluation import NO_STATE
from mobee.learning.reaching.reaches import hands_of

STRATEGIES = ("intrinsic", "greedy", "random")


@dataclass(frozen=True, slots=True, eq=False)
class Runs:
    """The N runs of one strategy, by seed: values of their cells, and the computing time of each, s."""

    values: tuple[Mapping[str, Any], ...]
    seconds: tuple[float, ...]
    checkpoints: tuple[int, ...]

    def __len__(self) -> int:
        return len(self.values)

    def scores(self, checkpoint: int) -> Array:
        """Return the sum of the rewards of all targets, mean of the evaluations, (N,), as in figure 8.2."""
        at = self.checkpoints.index(checkpoint)
        return np.array([one["rewards_grid"][at].sum(axis=-1).mean() for one in self.values])

    def chosen(self, checkpoint: int) -> Array:
        """Return the share of each state among those from which the evaluations reached, (N, S): figures 8.4 to 8.6."""
        at = self.checkpoints.index(checkpoint)
        return np.array([_shares(one["states_grid"][at]) for one in self.values])

    def agreement(self, checkpoint: int) -> Array:
        """Return the mean overlap of each run's choices with those of the other runs, (N,), 0 to 1."""
        chosen = self.chosen(checkpoint)
        overlaps = np.minimum(chosen[:, None], chosen[None]).sum(axis=-1)
        others = max(len(self) - 1, 1)
        shared: Array = (overlaps.sum(axis=1) - overlaps.diagonal()) / others
        return shared

    def states_of_half(self, checkpoint: int) -> Array:
        """Return the smallest number of states from which half of a run's reaches started, (N,)."""
        ordered = -np.sort(-self.chosen(checkpoint), axis=1)
        return np.array([np.searchsorted(np.cumsum(one), 0.5) + 1.0 for one in ordered])

    def height(self, checkpoint: int) -> Array:
        """Return the mean height of the palm in the chosen states minus that in all states, (N,) m."""
        heights = hands_of(reach_space(), MARKER)[:, 2]
        above: Array = self.chosen(checkpoint) @ heights - heights.mean()
        return above

    def tried(self, tries: int) -> Array:
        """Return the share of all pairs of a state and a target that were tried in the first `tries` problem-tries, (N,)."""
        return np.array([float((_tried(one, slice(tries)) > 0).mean()) for one in self.values])

    def exploration(self, tries: int) -> Array:
        """Return the mean number of reaches by target and state in the first `tries` problem-tries, (27, S): fig. 8.7."""
        mean: Array = np.array([_tried(one, slice(tries)) for one in self.values]).mean(axis=0)
        return mean

    def concentration(self, first: int, last: int) -> Array:
        """Return the share of the two most frequent states among the reaches of problem-tries `first` to `last`, (N,)."""
        sums = [np.sort(_tried(one, slice(first, last)).sum(axis=0))[::-1] for one in self.values]
        return np.array([one[:2].sum() / one.sum() for one in sums])

    def failures(self) -> Array:
        """Return the number of negative rewards of each run during exploration, (N,)."""
        return np.array([float(one["failures"].sum()) for one in self.values])

    def hours(self) -> Array:
        """Return the robot time of exploration, (N,) h."""
        return np.array([float(one["hours"]) for one in self.values])

    def actions(self) -> Array:
        """Return the mean number of actions per problem-try, (N,)."""
        return np.array([float(one["mean_actions"]) for one in self.values])


def _shares(states: Ints) -> Array:
    counts = np.bincount(states[states != NO_STATE], minlength=len(reach_space())).astype(np.float64)
    shares: Array = counts / max(counts.sum(), 1.0)
    return shares


def _tried(one: Mapping[str, Any], part: slice) -> Ints:
    tried = np.zeros((len(grid()), len(reach_space())), dtype=np.intp)
    state, problem = one["reach_state"][part], one["problem"][part]
    reached = state != NO_STATE
    np.add.at(tried, (problem[reached], state[reached]), 1)
    return tried


ByStrategy = Mapping[str, Runs]
Units = Mapping[str, ByStrategy]  # by unit of distances, as "1 cm"


def runs_of(found: Cells) -> Units:
    """Return the runs by unit of distances and strategy, in the order of the seeds."""

    def of(result: CellResult) -> tuple[Mapping[str, Any], float, tuple[int, ...]]:
        return result.values, result.seconds, tuple(result.cell.settings["checkpoints"])

    units: dict[str, dict[str, Runs]] = {}
    for (scale, strategy), cells in sorted(runs_by(found, of, "scale", "strategy").items(), key=lambda item: _order(*item[0])):
        values, seconds, checkpoints = zip(*cells, strict=True)
        units.setdefault(f"{100.0 * scale:g} cm", {})[strategy] = Runs(values, seconds, checkpoints[0])
    return units


def _order(scale: float, strategy: str) -> tuple[float, int]:
    return scale, STRATEGIES.index(strategy)
