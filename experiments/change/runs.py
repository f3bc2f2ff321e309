"""The finished runs with a change, and what is counted in each."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from experiments.kit.arm_learning import arm_space
from experiments.kit.cells import CellResult
from mobee.robot.robot import Array, Ints

BEFORE = 3_000  # transitions, and as many after the change
EVERY = 50  # transitions between two looks at the model
CONDITIONS = (("curious", 1.0), ("curious", 0.95), ("curious", 0.8), ("least_tried", 1.0), ("least_tried", 0.8))  # explorer, forgetting
RELEARNED = 0.5  # of the error at the change
SOON = 500  # transitions after the change

Key = tuple[str, str, float]  # change, explorer, forgetting


@dataclass(frozen=True, eq=False)
class Run:
    """One run, see `experiments.change.work`: looks at the model are in rows of `series`, errors then values, each changed and same."""

    seen: Ints
    series: Array  # (looks, 4)
    at_change: float  # error of what changed, before the first transition after the change
    changed: NDArray[np.bool_]
    same: NDArray[np.bool_]

    @property
    def looks_before(self) -> int:
        """Before the change, as many as after."""
        return len(self.series) // 2

    @property
    def tries(self) -> Array:
        """How often an action that changed was tried between two looks, over the mean of all actions, (looks,)."""
        tried = self.changed[self.seen[:, 0], self.seen[:, 1]].reshape(len(self.series), -1).mean(axis=1)
        relative: Array = tried * arm_space().state_actions / self.changed.sum()
        return relative

    @property
    def eagerness(self) -> float:
        """The same soon after the change."""
        return float(self.tries[self.looks_before : self.looks_before + SOON // EVERY].mean())

    @property
    def eagerness_before(self) -> float:
        """The same as long before the change."""
        return float(self.tries[self.looks_before - SOON // EVERY : self.looks_before].mean())

    @property
    def value_jump(self) -> float:
        """The highest value of what changed soon after, over that just before."""
        return self._jump(self.looks_before)

    @property
    def value_jump_before(self) -> float:
        """The same where nothing has changed: over the last transitions before."""
        return self._jump(self.looks_before - SOON // EVERY)

    def _jump(self, look: int) -> float:
        values = self.series[:, 2]
        return float(values[look : look + SOON // EVERY].max() / values[look - 1])

    @property
    def errors(self) -> Array:
        """L1 where actions changed, after the change, over that at the change; (looks,)."""
        relative: Array = self.series[self.looks_before :, 0] / self.at_change
        return relative

    @property
    def relearned(self) -> float:
        """How many transitions after the change half of that error is gone; infinite if it never is."""
        small = np.flatnonzero(self.errors <= RELEARNED)
        return float(EVERY * (small[0] + 1)) if len(small) else float("inf")


def runs_of(found: Mapping[str, CellResult]) -> dict[Key, list[Run]]:
    """The finished runs of each condition."""
    grouped: dict[Key, list[Run]] = {}
    for result in found.values():
        chosen: dict[str, Any] = result.cell.settings
        values = result.values
        changed, same = (values[name].astype(bool) for name in ("changed", "same"))
        run = Run(values["seen"].astype(np.intp), values["series"], values["at_change"], changed, same)
        grouped.setdefault((chosen["change"], chosen["explorer"], chosen["forgetting"]), []).append(run)
    return grouped
