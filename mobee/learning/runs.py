# SPDX-License-Identifier: Apache-2.0
"""Change detection for the outcomes of each action: a posterior over the time since they changed, and numbers of outcomes since then.

Bayesian online change point detection (Adams and MacKay 2007) for discrete outcomes. A run is the time since the last change of an action's
outcomes. The hazard is the probability that they change before the action is performed once more. It is not a setting: it is one of
`HAZARDS` (0.1 to 0.0001), equally likely at first, and their probabilities are learned from the outcomes of all actions.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mobee.arrays import Array
from mobee.learning.space import Space

HAZARDS = np.array([1e-1, 1e-2, 1e-3, 1e-4])
STAY, GOAL, OTHER = 0.1, 0.3, 0.1  # counts imagined after a change: the first two are those of `TransitionModel.debiased`
NEGLIGIBLE = 1e-3  # probability below which a run is dropped


@dataclass(frozen=True, slots=True, eq=False)
class Runs:
    """The R hypotheses about the present run of an action, the longest run first. A run is the time since the action's outcomes changed.

    `weight`: (R, H) probability of each run, given each of the H hazards in HAZARDS; a hazard is the probability of a change before the
    action is performed once more. `counts`: (R, B) number of each of the B outcomes since the run began. `suspected`: if a neighbouring
    action changes, this action may change with it; `suspected` is the largest increase of the probability of a neighbour's change that was
    found since this action was last performed; 0: none was found.
    """

    weight: Array
    counts: Array
    suspected: float = 0.0


class OutcomeRuns:
    """Counts, for each action of a space, how often each outcome was observed since the outcomes of the action changed.

    The time since this change is the run of the action; it is not known, so each possible run has a probability. If the outcomes of an
    action have changed, the outcomes of its neighbours may have changed too. The neighbours of an action are the other actions with the
    same goal state, and the action from this goal state back to the state of the action. The share of neighbours that change together with
    an action is learned. If an outcome increases by p the probability that its action has changed, then each neighbour is assumed to have
    changed with the probability p * share.

    Args:
        space: states and actions.
    """

    def __init__(self, space: Space) -> None:
        self._goals = space.goals
        self._hazard: Array = np.full(len(HAZARDS), 1.0 / len(HAZARDS))
        self._shared, self._unshared = 1.0, 1.0  # Beta distribution of the share of neighbours
        self._runs: dict[tuple[int, int], Runs] = {}

    def counts(self, state: int, action: int, bins: int) -> Array:
        """Return how often each outcome of an action in a state was observed since the last change of the action, (bins,).

        These numbers are expected values over the possible times of the change, which is not known. `bins`: number of outcomes.
        """
        runs = self._of(state, action, bins)
        return self._expected(runs, self._hazard)

    def following(self, state: int, action: int, chosen: int, bins: int) -> Array:
        """Return what `counts` would return if the outcome with the index `chosen` were observed once more, (bins,).

        Nothing is changed. `bins`: number of outcomes of `action` in `state`.
        """
        runs, evidence = self._after(self._of(state, action, bins), chosen)
        return self._expected(runs, self._informed(evidence))

    def observe(self, state: int, action: int, chosen: int, bins: int) -> list[tuple[int, int]]:
        """Record that an action had the outcome with the index `chosen` among its `bins` outcomes.

        If this outcome makes a change of the action more probable, return the neighbours of the action (see the class) that were tried, as
        (state, action): they may have changed too, and `counts` now returns other numbers for them. Otherwise return an empty list.
        """
        before = self._of(state, action, bins)
        after, evidence = self._after(before, chosen)
        was_changed = self._changed(before)
        self._hazard = self._informed(evidence)
        changed = self._changed(after)
        self._shared += before.suspected * changed
        self._unshared += before.suspected * (1.0 - changed)
        kept = after.weight @ self._hazard >= NEGLIGIBLE
        weight = after.weight[kept]
        self._runs[state, action] = Runs(weight / weight.sum(axis=0), after.counts[kept])
        rise = changed - was_changed
        return self._suspect(state, action, rise) if rise > NEGLIGIBLE else []

    def _of(self, state: int, action: int, bins: int) -> Runs:
        known = self._runs.get((state, action))
        if known is None:
            return Runs(np.ones((1, len(HAZARDS))), np.zeros((1, bins)))
        if known.counts.shape[1] < bins:
            wider = np.pad(known.counts, [(0, 0), (0, bins - known.counts.shape[1])])
            return Runs(known.weight, wider, known.suspected)
        return known

    def _after(self, runs: Runs, chosen: int) -> tuple[Runs, Array]:
        """Return the runs of an action after one more outcome, with the index `chosen`, and the evidence of this outcome, (H,).

        The evidence is the probability of the outcome given each of the H hazards, up to a common factor.
        """
        prior = (STAY, GOAL)[chosen] if chosen < 2 else OTHER
        total = STAY + GOAL + OTHER
        likely = (runs.counts[:, chosen] + prior) / (runs.counts.sum(axis=1) + total)
        weight = np.vstack([runs.weight * likely[:, None] * (1.0 - HAZARDS), HAZARDS * (prior / total)])
        counts = np.vstack([runs.counts, np.zeros(runs.counts.shape[1])])
        counts[:, chosen] += 1.0
        evidence: Array = weight.sum(axis=0)
        return Runs(weight / evidence, counts), evidence

    def _informed(self, evidence: Array) -> Array:
        """Return the probabilities (H,) of the hazards (probabilities of a change) after an outcome.

        `evidence`: (H,), the probability of the outcome given each hazard, up to a common factor.
        """
        hazard: Array = self._hazard * evidence / (self._hazard @ evidence)
        return hazard

    def _expected(self, runs: Runs, hazard: Array) -> Array:
        expected: Array = (runs.weight @ hazard) @ runs.counts
        return expected

    def _changed(self, runs: Runs) -> float:
        """Return the probability that the action has changed since its longest run (the first hypothesis in `runs`) began."""
        return float((runs.weight[1:] @ self._hazard).sum())

    def _suspect(self, state: int, action: int, rise: float) -> list[tuple[int, int]]:
        """Add to each neighbour of an action that was tried the hypothesis that its run has ended, because it has changed too.

        The hypothesis has the probability `rise` times the expected share of neighbours that change. `rise`: increase of the probability
        that the action has changed. Returns these neighbours as (state, action).
        """
        share, found = rise * self._shared / (self._shared + self._unshared), []
        goal = int(self._goals[state, action])
        to_goal = [(int(one), int(other)) for one, other in np.argwhere(self._goals == goal)]
        back = [(goal, int(other)) for other in np.flatnonzero(self._goals[goal] == state)]
        for near in dict.fromkeys([*to_goal, *back]):  # both, if an action aims at its own state
            known = self._runs.get(near)
            if known is None or near == (state, action):
                continue
            weight = np.vstack([known.weight * (1.0 - share), np.full(len(HAZARDS), share)])
            counts = np.vstack([known.counts, np.zeros(known.counts.shape[1])])
            self._runs[near] = Runs(weight, counts, max(known.suspected, rise))
            found.append(near)
        return found
