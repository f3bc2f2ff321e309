# SPDX-License-Identifier: Apache-2.0
"""Keeps the observations and changes of an adaptive roadmap on disk."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mobee.arrays import Ints
from mobee.database import damaged, explained, json_of, transaction
from mobee.errors import UnknownName
from mobee.plant import Outcome
from mobee.roadmap.adaptive.adaptive import AdaptiveRoadmap
from mobee.store import Transition, TransitionStore

TABLE = """
CREATE TABLE IF NOT EXISTS map_changes (
    agent TEXT NOT NULL, number INTEGER NOT NULL, n INTEGER NOT NULL, change TEXT NOT NULL, PRIMARY KEY (agent, number))
"""


@dataclass(frozen=True, slots=True)
class Change:
    """A recorded change of an adaptive roadmap.

    `n`: number of observed tries of edges (transitions) before the change. `what`: name of the method of AdaptiveRoadmap ("grow", "join" or
    "prune"). `given`: the arguments of the method by name, as plain JSON values.
    """

    n: int
    what: str
    given: dict[str, Any]


class MapStore(TransitionStore):
    """Stores the observed tries of edges of an adaptive roadmap as transitions, and the changes of the roadmap between these tries.

    Args:
        path: the SQLite file of the run; it is created if it does not exist.
        agent: the name under which the data are stored.
        read_only: whether to open the file for reading only.

    Raises:
        MobeeError: from every method, if the file cannot be read or written, as in `mobee.store.AgentFile`.
    """

    def __init__(self, path: str | Path, agent: str, read_only: bool = False) -> None:
        super().__init__(path, agent, read_only)
        if not read_only:
            with explained(self.path), transaction(self._db):
                self._db.execute(TABLE)

    def changed(self, what: str, **given: Any) -> None:
        """Commit a change of the roadmap; it is on disk when the method returns.

        `what`: name of the method of AdaptiveRoadmap. `given`: its arguments, plain JSON values.
        """
        with explained(self.path), transaction(self._db):
            (number,) = self._db.execute("SELECT count(*) FROM map_changes WHERE agent = ?", (self.agent,)).fetchone()
            self._db.execute("INSERT INTO map_changes VALUES (?, ?, ?, ?)", (self.agent, number, self._last, json.dumps([what, given])))

    def changes(self) -> list[Change]:
        """Return all changes of this agent's map, the oldest first."""
        with explained(self.path):
            if self._db.execute("SELECT 1 FROM sqlite_master WHERE name = 'map_changes'").fetchone() is None:
                return []
            rows = self._db.execute("SELECT n, change FROM map_changes WHERE agent = ? ORDER BY number", (self.agent,)).fetchall()
        return [self._change(n, change) for n, change in rows]

    def _change(self, n: int, text: object) -> Change:
        match json_of(self.path, f"a change of the map of {self.agent}", text):
            case [str(what), dict(given)]:
                return Change(n, what, given)
        raise damaged(self.path, f"a change of the map of {self.agent} is not what MoBeE writes")


CHANGES = ("grow", "join", "prune")


class MapRecord:
    """An adaptive roadmap together with its store: applies observations and changes to the map, and writes them to the store.

    Args:
        roadmap: the map. If the store has content, the recorded observations and changes are applied to it.
        store: the file of observations and changes; None: nothing is written.
        settings: settings of the object that moves the robot along the map (`Walker` or `MapExplorer`). They must equal those in the store.

    Raises:
        MobeeError: the store belongs to another map or to other settings.
    """

    def __init__(self, roadmap: AdaptiveRoadmap, store: MapStore | None, settings: dict[str, Any]) -> None:
        self.roadmap, self._store = roadmap, store
        self.transitions = 0
        """Number of observed tries of edges, those read from the store included."""
        self.joined: set[int] = set()
        """Numbers of the vertices that were added by `join`."""
        self.on_renumbered: Callable[[Ints], None] = lambda number: None
        """Called after a change has given the vertices other numbers, with the result of `prune`: new numbers (S,), -1 for removed ones."""
        if store is not None:
            store.bind(settings)
            self._replay(store)

    def observe(self, state: int, action: int, arrived: int, outcome: Outcome) -> None:
        """Learn and record the outcome of a motion along the edge `action` of vertex `state`.

        `arrived`: the goal of the edge if the motion ended there, else `state`. `outcome`: what the plant returned for the action.
        """
        made = Transition(
            n=self.transitions + 1,
            s=state,
            a=action,
            s_next=arrived,
            reward=0.0,
            settled=outcome.settled,
            duration=outcome.duration,
            q=tuple(outcome.q.tolist()),
            touched=outcome.touched,
        )
        if self._store is not None:
            self._store.append(made)
        self._learn(made)

    def change(self, what: str, **given: Any) -> Any:
        """Change the roadmap and record the change; return the result of the method.

        `what`: name of the method of AdaptiveRoadmap, "grow", "join" or "prune". `given`: its arguments, plain JSON values. Raises
        UnknownName for another method. A change that the roadmap refuses is not recorded. If the store cannot be written, MobeeError is
        raised after the roadmap has changed; then create roadmap and record again from the store.
        """
        if what not in CHANGES:
            raise UnknownName("change of a map", what, CHANGES)
        result = self._apply(what, given)
        if self._store is not None:
            self._store.changed(what, **given)
        if what == "prune":
            self.on_renumbered(result)
        return result

    def _apply(self, what: str, given: dict[str, Any]) -> Any:
        result = getattr(self.roadmap, what)(**given)
        if what == "join":
            self.joined.update(result.tolist())
        elif what == "prune":
            self.joined = {int(result[vertex]) for vertex in self.joined if result[vertex] >= 0}
        return result

    def _learn(self, made: Transition) -> None:
        self.roadmap.observe(made.s, made.a, made.s_next)
        self.transitions = made.n

    def _replay(self, store: MapStore) -> None:
        changes = store.changes()[::-1]
        for made in store.load():
            while changes and changes[-1].n < made.n:
                change = changes.pop()
                self._apply(change.what, change.given)
            self._learn(made)
        for change in changes[::-1]:
            self._apply(change.what, change.given)
