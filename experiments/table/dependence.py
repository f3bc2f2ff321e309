"""Which actions end differently because of other parts, and whether an agent's interest finds them (paper 4.4).

With a ghost for a table no part disturbs another, but for hands that meet.  So an action that ends elsewhere at the table than at the
ghost depends on where the other parts are.  What is true is taken from the runs of other seeds than the one that is judged.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from experiments.table.interest import log_ratios
from experiments.table.runs import ARMS, EXPLORERS, Key, Run, spaces, with_ghosts
from mobee.robot.robot import Array

DIFFERENT = 0.1  # total variation between the outcomes at the table and at the ghost
LEARNERS = {"torso": ("torso",), "arms": ARMS}  # both arms have one graph
SCORES: dict[str, Callable[[Run, Run, str], Array]] = {
    "tries": lambda run, ghost, part: run.tries[part].astype(float),
    "beside_ghost": log_ratios,
}


@dataclass(frozen=True, eq=False)
class Judged:
    """A learner's actions (parts, actions) in one run, the most interesting first: which of them depend on other parts.

    The two arms of a run are no two runs: its numbers are means over the parts.
    """

    hits: NDArray[np.bool_]

    @property
    def chance(self) -> float:
        """The share that depend on other parts."""
        return float(self.hits.mean())

    @property
    def at_all(self) -> float:
        """Precision, which is recall too, when as many actions are called dependent as are."""
        return float(self.hits[:, : int(self.hits[0].sum())].mean())

    @property
    def precision(self) -> Array:
        """Of calling the first k dependent, for every k."""
        found: Array = (np.cumsum(self.hits, axis=1) / np.arange(1, self.hits.shape[1] + 1)).mean(axis=0)
        return found

    @property
    def recall(self) -> Array:
        """Of the same."""
        found: Array = (np.cumsum(self.hits, axis=1) / self.hits.sum(axis=1, keepdims=True)).mean(axis=0)
        return found


def dependent(runs: dict[Key, list[Run]], parts: Sequence[str], but: int) -> NDArray[np.bool_]:
    """Which actions (S, A) of these parts end differently at the table than at the ghost, by the runs of all seeds but one."""
    shares = []
    for world in ("table", "ghost"):
        counts = np.zeros((*spaces()[parts[0]].goals.shape, len(spaces()[parts[0]])))
        for run in (run for explorer in EXPLORERS for run in runs.get(("tree", explorer, world), []) if run.seed != but):
            for part in parts:
                np.add.at(counts, tuple(run.seen[part].T), 1.0)
        shares.append(counts / np.maximum(counts.sum(axis=-1, keepdims=True), 1.0))
    different: NDArray[np.bool_] = 0.5 * np.abs(shares[0] - shares[1]).sum(axis=-1) > DIFFERENT
    return different


def judged(runs: dict[Key, list[Run]], explorer: str, learner: str, score: str) -> list[Judged]:
    """Every run of an explorer; none where there is no other seed, or no action depends on other parts in the other seeds' runs."""
    found = []
    for run, ghost in with_ghosts(runs, "tree", explorer):
        truth = dependent(runs, LEARNERS[learner], run.seed)
        if truth.any():
            ranked = (SCORES[score](run, ghost, part) for part in LEARNERS[learner])
            found.append(Judged(np.array([truth.ravel()[np.argsort(-values, axis=None, kind="stable")] for values in ranked])))
    return found
