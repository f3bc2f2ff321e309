"""The runs of one setting, and what is counted in each."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from experiments.kit.arm_learning import arm_space
from experiments.kit.cells import CellResult
from experiments.kit.outcomes import exists_in, failures_of, visits_of
from mobee import Lattice
from mobee.robot.robot import Array, Ints

HARD = (24, 51, 78)  # the thesis' states that are hard to get into: pitch low, roll and yaw high, any elbow
FAILING = ((15, 24), (42, 51), (69, 78))  # (source, goal), in red in fig. 7.4
ENTERING = ((21, 24), (48, 51), (75, 78))  # actions into the same states that succeed

Key = tuple[str, float]  # initialisation, discount


@dataclass(frozen=True, eq=False)
class Run:
    """One exploration: what it saw (T, 3), how often it tried everything, and the values it ended with, both (81, 8)."""

    space: Lattice
    seen: Ints
    tries: Ints
    values: Array

    @property
    def transitions(self) -> int:
        """How many it took."""
        return len(self.seen)

    @cached_property
    def visits(self) -> Ints:
        """How often each state was reached, (81,)."""
        return visits_of(self.space, self.seen)

    @cached_property
    def failures(self) -> Ints:
        """How often each state-action did not end in its goal, (81, 8)."""
        return failures_of(self.space, self.seen)

    @property
    def exists(self) -> Array:
        """Which entries of (81, 8) are state-actions."""
        return exists_in(self.space)

    def share_failed(self, pairs: Sequence[tuple[int, int]]) -> float:
        """Of all tries of these (source, goal)."""
        at = tuple(np.array([self.index(pair) for pair in pairs]).T)
        return float(self.failures[at].sum() / self.tries[at].sum())

    def relative_tries(self, pairs: Sequence[tuple[int, int]]) -> float:
        """Mean tries of these (source, goal) over those of all."""
        return float(np.mean([self.tries[self.index(pair)] for pair in pairs]) / self.tries[self.exists].mean())

    def index(self, pair: tuple[int, int]) -> tuple[int, int]:
        """State and action of a (source, goal)."""
        return pair[0], int(np.flatnonzero(self.space.actions(pair[0]) == pair[1])[0])

    @property
    def out_of_hard(self) -> list[tuple[int, int]]:
        """The (source, goal) of all actions of the hard states."""
        return [(state, int(goal)) for state in HARD for goal in self.space.actions(state)]


def groups(found: Mapping[str, CellResult]) -> dict[Key, list[Run]]:
    """The runs of each setting, by seed."""
    space, grouped = arm_space(), dict[Key, list[Run]]()
    for result in sorted(found.values(), key=lambda result: (*_key(result), result.cell.seed)):
        values = result.values
        grouped.setdefault(_key(result), []).append(Run(space, values["seen"], values["tries"], values["values"]))
    return grouped


def _key(result: CellResult) -> Key:
    return result.cell.settings["initial"], result.cell.settings["discount"]
