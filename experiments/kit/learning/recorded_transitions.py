# SPDX-License-Identifier: Apache-2.0
"""Reads all transitions of a run: from the SQLite stores of its agents, and from the results of a sweep's single runs (cells)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from experiments.kit.cells import FOLDER, load_cells
from mobee.errors import InvalidValue
from mobee.store import TransitionStore

SEEN = "seen"  # the array of a cell with one agent's transitions; with several agents seen_<part>


@dataclass(frozen=True)
class Record:
    """The transitions of one agent.

    They come from a database, or from a cell, which is one run of a sweep.  `source`: the file of the transitions, relative to the run's
    folder.  `agent`: name of the agent; "" if a cell has only one agent.  `settings`: settings of the agent, or of the cell.  `columns`:
    dict from a column's name to its values, a value for each transition.  A cell has only the columns n (number of the transition, from 1),
    s (state), a (action) and s_next (state reached).
    """

    source: str
    agent: str
    settings: dict[str, Any]
    columns: dict[str, list[Any]]


def records(folder: Path) -> Iterator[Record]:
    """Yield the transitions of every agent in the folder of a run, or in one database if `folder` is a file.

    Raises InvalidValue if there are no transitions or an array has the wrong shape, MobeeError for a damaged file.
    """
    found = False
    for record in (*_of_stores(folder), *_of_cells(folder)):
        found = True
        yield record
    if not found:
        raise InvalidValue(f"{folder}: no transitions are kept there, neither in a file *.sqlite nor in the cells of a sweep.")


def stores_of(run: Path) -> list[tuple[Path, str]]:
    """Return the path and the relative name of each database below the folder of a run; if `run` is a database itself, only this one."""
    if run.is_file():
        return [(run, run.name)]
    return [(file, str(file.relative_to(run))) for file in sorted(run.rglob("*.sqlite"))]


def _of_stores(folder: Path) -> Iterator[Record]:
    for file, name in stores_of(folder):
        with TransitionStore(file, "", read_only=True) as store:
            for agent in store.agents():
                made = store.load(agent)
                names = ("n", "s", "a", "s_next", "reward", "settled", "duration", "q", "touched")
                columns: dict[str, list[Any]] = {name: [getattr(one, name) for one in made] for name in names}
                yield Record(name, agent, store.settings(agent), columns | {"time": store.times(agent)})


def _of_cells(folder: Path) -> Iterator[Record]:
    for cells in sorted(folder.rglob(FOLDER)):  # a run of several experiments has one folder of cells each
        for result in load_cells(cells.parent).values():
            source = str(result.path.relative_to(folder))
            settings = {**result.cell.settings, "seed": result.cell.seed}
            for key, array in result.values.items():
                if key == SEEN or key.startswith(f"{SEEN}_"):
                    made = _checked(array, f"{folder}: {key} of {source}")
                    columns = dict(zip(("s", "a", "s_next"), made.T.tolist(), strict=True))
                    yield Record(source, key[len(SEEN) + 1 :], settings, {"n": list(range(1, len(made) + 1)), **columns})


def _checked(array: Any, where: str) -> Any:
    if not isinstance(array, np.ndarray) or array.ndim != 2 or array.shape[1] != 3:
        raise InvalidValue(f"{where} is not an array of transitions, shape (T, 3): state, action, state reached.")
    return array
