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
from mobee.learning.reaching.reach_agent import NO_STATE
from mobee.learning.reaching.reaches import hands_of

STRATEGIES = ("intrinsic", "greedy", "random")


@dataclass(frozen=True, slots=True, eq=False)
class Runs:
    """The N runs of one strategy, sorted by seed.

    `values`: results of each run, as `reach_exploration.summary` returns them.  `seconds`: computing time of each, s.  `checkpoints`:
    numbers of problem-tries (attempts to reach one target) after which the agents were evaluated; the argument `checkpoint` of the methods
    is one of them.
    """

    values: tuple[Mapping[str, Any], ...]
    seconds: tuple[float, ...]
    checkpoints: tuple[int, ...]

    def __len__(self) -> int:
        return len(self.values)

    def scores(self, checkpoint: int) -> Array:
        """Return the score of each run, (N,): the sum of the rewards of all targets, averaged over the evaluations (fig. 8.2).

        `checkpoint`: number of problem-tries (attempts to reach one target) before the evaluations, one of `checkpoints`.
        """
        at = self.checkpoints.index(checkpoint)
        return np.array([one["rewards_grid"][at].sum(axis=-1).mean() for one in self.values])

    def chosen(self, checkpoint: int) -> Array:
        """Return the share of each run's reaches in the evaluations that started in each of the S states, (N, S) (figs. 8.4 to 8.6).

        `checkpoint`: number of problem-tries (attempts to reach one target) before the evaluation, one of `checkpoints`.
        """
        at = self.checkpoints.index(checkpoint)
        return np.array([_shares(one["states_grid"][at]) for one in self.values])

    def agreement(self, checkpoint: int) -> Array:
        """Return how well the choices of states of each run agree with those of the other runs, (N,), from 0 to 1.

        The agreement of two runs is the overlap of their shares of reaches by state (`chosen`): for each state the smaller share is taken,
        and these are added.  The result of a run is its mean agreement with the other runs.  `checkpoint`: number of problem-tries
        (attempts to reach one target) before the evaluation, one of `checkpoints`.
        """
        chosen = self.chosen(checkpoint)
        overlaps = np.minimum(chosen[:, None], chosen[None]).sum(axis=-1)
        others = max(len(self) - 1, 1)
        shared: Array = (overlaps.sum(axis=1) - overlaps.diagonal()) / others
        return shared

    def states_of_half(self, checkpoint: int) -> Array:
        """Return how many of the most frequent start states cover at least half of a run's reaches in the evaluations, (N,).

        `checkpoint`: number of problem-tries (attempts to reach one target) before the evaluation, one of `checkpoints`.
        """
        ordered = -np.sort(-self.chosen(checkpoint), axis=1)
        return np.array([np.searchsorted(np.cumsum(one), 0.5) + 1.0 for one in ordered])

    def height(self, checkpoint: int) -> Array:
        """Return how much higher the palm is in the states in which a run's reaches started than in all states, (N,) m.

        Both heights are means.  `checkpoint`: number of problem-tries (attempts to reach one target) before the evaluation, one of
        `checkpoints`.
        """
        heights = hands_of(reach_space(), MARKER)[:, 2]
        above: Array = self.chosen(checkpoint) @ heights - heights.mean()
        return above

    def tried(self, tries: int) -> Array:
        """Return the share of all pairs of a state and a target that were tried in the first `tries` problem-tries, (N,).

        A problem-try is one attempt to reach one target.
        """
        return np.array([float((_tried(one, slice(tries)) > 0).mean()) for one in self.values])

    def exploration(self, tries: int) -> Array:
        """Return how often each of the 27 targets was tried from each state in the first `tries` problem-tries, (27, S) (fig. 8.7).

        The numbers are means over the runs.  A problem-try is one attempt to reach one target.
        """
        mean: Array = np.array([_tried(one, slice(tries)) for one in self.values]).mean(axis=0)
        return mean

    def concentration(self, first: int, last: int) -> Array:
        """Return the share of reaches that started in the two most frequent states, (N,).

        Only the problem-tries (attempts to reach one target) from number `first` to number `last` - 1 are counted; numbers begin with 0.
        """
        sums = [np.sort(_tried(one, slice(first, last)).sum(axis=0))[::-1] for one in self.values]
        return np.array([one[:2].sum() / one.sum() for one in sums])

    def failures(self) -> Array:
        """Return the number of negative rewards, one for each failed action, that each run received while it explored, (N,)."""
        return np.array([float(one["failures"].sum()) for one in self.values])

    def hours(self) -> Array:
        """Return the robot time of the problem-tries (attempts to reach one target) of each run, without evaluations, (N,) h."""
        return np.array([float(one["hours"]) for one in self.values])

    def actions(self) -> Array:
        """Return the mean number of actions per problem-try (attempt to reach one target) of each run, reaches included, (N,)."""
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
    """Group the finished runs by the unit of distances in the equations, as "1 cm", and then by strategy; each group is sorted by seed."""

    def of(result: CellResult) -> tuple[Mapping[str, Any], float, tuple[int, ...]]:
        return result.values, result.seconds, tuple(result.cell.settings["checkpoints"])

    units: dict[str, dict[str, Runs]] = {}
    for (scale, strategy), cells in sorted(runs_by(found, of, "scale", "strategy").items(), key=lambda item: _order(*item[0])):
        values, seconds, checkpoints = zip(*cells, strict=True)
        units.setdefault(f"{100.0 * scale:g} cm", {})[strategy] = Runs(values, seconds, checkpoints[0])
    return units


def _order(scale: float, strategy: str) -> tuple[float, int]:
    return scale, STRATEGIES.index(strategy)
