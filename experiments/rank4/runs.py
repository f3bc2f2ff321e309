"""The finished runs on the two lattices of rank 4, and the states and actions that the thesis names."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from experiments.kit.arm_learning import RANK4, STRETCHED, arm_space
from experiments.kit.cells import CellResult
from experiments.kit.outcomes import failure_shares, goals_of, visits_of
from mobee import Lattice
from mobee.robot.robot import Array, Ints

LEVELS = {"small": RANK4, "stretched": STRETCHED}
ACTIONS = {"small": 14_597, "stretched": 26_963}
NEVER, HARDLY = (60, 124, 188, 252), (61, 125, 189, 253)
ASIDE = {(57, 61): 62, (121, 125): 126, (249, 253): 254}  # (source, goal): where it ends


@dataclass(frozen=True, eq=False)
class Run:
    """One exploration; see `experiments.rank4.work`."""

    space: Lattice
    seen: Ints
    values: Array
    pairs: list[str]
    touching: Ints
    depths: Array

    @cached_property
    def visits(self) -> Ints:
        """Of each state, (256,)."""
        return visits_of(self.space, self.seen)

    @property
    def unreached(self) -> tuple[int, ...]:
        """States that were never reached."""
        return tuple(np.flatnonzero(self.visits == 0).tolist())

    @property
    def succeeded(self) -> Ints:
        """Whether each transition ended in its goal, (T,)."""
        return self.seen[:, 2] == goals_of(self.space, self.seen)

    @property
    def uncertain(self) -> int:
        """How many actions failed in 10 to 90 % of their tries."""
        shares = failure_shares(self.space, self.seen)
        return int(((shares > 0.1) & (shares < 0.9)).sum())


def runs_of(found: Mapping[str, CellResult]) -> dict[str, list[Run]]:
    """The finished runs of each lattice."""
    spaces = {lattice: arm_space(levels) for lattice, levels in LEVELS.items()}
    runs: dict[str, list[Run]] = {lattice: [] for lattice in LEVELS}
    for result in found.values():
        lattice, values = result.cell.settings["lattice"], result.values
        seen = values["seen"].astype(np.intp)
        runs[lattice].append(Run(spaces[lattice], seen, values["values"], values["pairs"], values["touching"], values["depths"]))
    return {lattice: mine for lattice, mine in runs.items() if mine}
