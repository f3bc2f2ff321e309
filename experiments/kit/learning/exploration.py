# SPDX-License-Identifier: Apache-2.0
"""Exploration by one agent, or by several at the same time, and records of their transitions.

The records of a run are read from the SQLite stores of its agents, or from the results of a sweep's single runs (cells).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from experiments.kit.cells import FOLDER, load_cells
from mobee import CuriousAgent, OfflinePlant, Plant, Space
from mobee.arrays import Array, Ints
from mobee.errors import InvalidValue, MobeeError
from mobee.store import Transition, TransitionStore

SEEN = "seen"  # the array of a cell with one agent's transitions; with several agents seen_<part>


def begin_anywhere(space: Space, plant: OfflinePlant, seed: int) -> None:
    """Move the space's part of the robot towards a random state; no agent learns from this motion.

    The published runs begin with such a motion.  `seed`: seed of the choice of the state.
    """
    plant.act(space.part, space.target(int(np.random.default_rng(seed).integers(len(space)))))


def begin_nearby(space: Space, plant: Plant, seed: int) -> int:
    """Move the space's part of the robot to a random neighbour of its present state, and return the number of the state that was reached.

    No agent learns from this motion, because it may start anywhere in the cell of a state.  After it, an agent's first action starts where
    an action ended, as all later ones do.  `seed`: seed of the choice of the neighbour.
    """
    state = space.state_of(plant.measure(space.part))
    goal = int(np.random.default_rng(seed).choice(space.actions(state)))
    return space.state_of(plant.act(space.part, space.target(goal)).q)


def newest(agent: CuriousAgent) -> Transition:
    """Return the last transition of an agent; raises MobeeError if it has made none."""
    if agent.last is None:
        raise MobeeError(f"the agent of {agent.part} has observed nothing yet: let it make a step first.")
    return agent.last


def explore(agent: CuriousAgent, most: int, enough: Callable[[CuriousAgent], bool] = lambda agent: False) -> Ints:
    """Let an agent make up to `most` transitions, and return them, (T, 3): state, action, state reached.

    `enough`: function of the agent that is called before each transition; the agent stops when it returns True.
    """
    seen: list[tuple[int, int, int]] = []
    while len(seen) < most and not enough(agent):
        agent.step()
        last = newest(agent)
        seen.append((last.s, last.a, last.s_next))
    return np.array(seen, dtype=np.int64).reshape(-1, 3)


class LeastTries:
    """A stopping criterion for `explore`: every state-action was tried at least `least` times.

    `state_actions`: number of state-actions.  The tries are counted incrementally, so it must be called after every transition.
    """

    def __init__(self, least: int, state_actions: int) -> None:
        self._least, self._left = least, state_actions

    def __call__(self, agent: CuriousAgent) -> bool:
        """Return whether the criterion is met; must be called after every transition of the agent."""
        if agent.last is not None and agent.model.tries[agent.last.s, agent.last.a] == self._least:
            self._left -= 1
        return self._left == 0


@dataclass(eq=False)
class Log:
    """The T transitions of one part, as lists of length T.

    `seen`: state, action, state reached.  `settled`: whether the motors came to rest before the time limit of the action.  `durations`: s.
    `ends`: plant time, s.  `touched`: names of the world objects in contact at the end.  `poses`: positions of all motors at the end, (n,)
    rad.
    """

    seen: list[tuple[int, int, int]] = field(default_factory=list)
    settled: list[bool] = field(default_factory=list)
    durations: list[float] = field(default_factory=list)
    ends: list[float] = field(default_factory=list)
    touched: list[tuple[str, ...]] = field(default_factory=list)
    poses: list[Array] = field(default_factory=list)

    def arrays(self, part: str, count: int) -> dict[str, Any]:
        """Return the first T = `count` transitions as arrays, by name and part, as "seen_left_arm".

        "seen" (T, 3) holds state, action and state reached; "settled" (T,) bool, "durations" (T,) s and "ends" (T,) s are the fields of the
        log.
        """
        return {
            f"seen_{part}": np.array(self.seen[:count], dtype=np.uint16),
            f"settled_{part}": np.array(self.settled[:count], dtype=bool),
            f"durations_{part}": np.array(self.durations[:count], dtype=np.float32),
            f"ends_{part}": np.array(self.ends[:count], dtype=np.float64),
        }


def explore_together(agents: Sequence[CuriousAgent], plant: OfflinePlant, transitions: int) -> dict[str, Log]:
    """Let several agents act at the same time on one plant, as `mobee.run` does, and return the transitions of each part.

    The run ends when every agent has made `transitions` transitions; faster agents make more in the meantime.
    """
    logs = {agent.part: Log() for agent in agents}
    by_part, waiting = {agent.part: agent for agent in agents}, list(agents)
    while min(len(log.seen) for log in logs.values()) < transitions:
        for agent in waiting:
            plant.begin(agent.part, agent.target(agent.decide(agent.state)))
        waiting = []
        for part, outcome in plant.advance():
            agent, log = by_part[part], logs[part]
            agent.observe(outcome)
            last = newest(agent)
            log.seen.append((last.s, last.a, last.s_next))
            log.settled.append(outcome.settled)
            log.durations.append(outcome.duration)
            log.ends.append(plant.time)
            log.touched.append(outcome.touched)
            log.poses.append(plant.q)
            waiting.append(agent)
    return logs


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
