"""What the runs of a sweep of lone explorers did, by where they explored and how."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from experiments.kit.cells import CellResult
from experiments.learning.outcomes import exists_in, failures_of, tries_of, visits_of
from mobee import Lattice
from mobee.robot.robot import Ints


@dataclass(frozen=True, eq=False)
class Explored:
    """One run: tries and failures (E,) of the E state-actions, visits (S,) of the states, and all `values` of its cell."""

    seed: int
    tries: Ints
    failures: Ints
    visits: Ints
    values: Mapping[str, Any]


Groups = dict[tuple[str, str], list[Explored]]  # where and how


def explored(found: Mapping[str, CellResult], space_of: Callable[[str], Lattice], where: str, how: str) -> Groups:
    """The runs that saw transitions ("seen"), by two of their settings, in the order of the seeds; `where` decides the space."""
    grouped: Groups = {}
    for result in sorted(found.values(), key=lambda result: result.cell.seed):
        settings, seen = result.cell.settings, result.values["seen"]
        space = space_of(settings[where])
        exists = exists_in(space)
        one = Explored(
            result.cell.seed,
            tries_of(space, seen)[exists],
            failures_of(space, seen)[exists],
            visits_of(space, seen),
            result.values,
        )
        grouped.setdefault((settings[where], settings[how]), []).append(one)
    return grouped
