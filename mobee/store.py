# SPDX-License-Identifier: Apache-2.0
"""Stores the transitions of an agent in the file of a run; each is on disk before the next action."""

from __future__ import annotations

import json
import sqlite3
import time
import weakref
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import isfinite
from operator import index
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from mobee.database import damaged, explained, json_of, lock, opened, transaction, unlock
from mobee.errors import InvalidValue, MobeeError


class AgentFile:
    """The data of one agent in the SQLite file of a run; the processes of several agents may share the file.

    The file has a write-ahead log with full synchronisation: written data survive a kill and a power cut. Only one process at a time
    may write the data of an agent.

    Args:
        path: the SQLite file; it is created if missing, but its folder must exist.
        agent: the name of the agent in the file.
        read_only: open the file for reading only, also in a write-protected folder; nothing is created or changed.
        durable: False: a commit does not wait for the disk, so that it survives a kill but not a power cut; for learning offline.

    Raises:
        MobeeError: every method can raise it; the message is one line, which names the file and the remedy. InUse: another process writes
            this agent's data. NoRoom: the disk is full; the same call succeeds when there is room.
    """

    def __init__(self, path: str | Path, agent: str, read_only: bool = False, durable: bool = True) -> None:
        self.path, self.agent = Path(path), agent
        self._db: sqlite3.Connection = opened(self.path, read_only, durable)
        self._release: Callable[[], object] | None = None
        if not read_only:
            try:
                lock(self.path, agent)
            except BaseException:
                self._db.close()
                raise
            self._release = weakref.finalize(self, unlock, self.path, agent)  # a store that nobody closes releases its lock too

    def bind(self, settings: dict[str, Any]) -> None:
        """Record the agent's settings (JSON values, by name); if settings are recorded already, raise MobeeError unless they are equal."""
        given = _texts(settings)
        with explained(self.path), transaction(self._db):
            known = dict(self._db.execute("SELECT key, value FROM meta WHERE agent = ?", (self.agent,)))
            if not known:
                self._record(given)
                return
        if CONTINUED in known:  # a fact of the record, which no agent is given
            given[CONTINUED] = known[CONTINUED]
        self._require_equal(self.path, known, given)

    def _record(self, given: dict[str, str]) -> None:
        self._db.executemany("INSERT INTO meta VALUES (?, ?, ?)", [(self.agent, key, value) for key, value in given.items()])

    def _require_equal(self, path: Path, known: dict[str, str], given: dict[str, str]) -> None:
        """Raise MobeeError unless the settings on record in a file are those given, both as JSON."""
        if missing := sorted(given.keys() - known.keys()):
            raise MobeeError(
                f"{path}: {self.agent} has no {', '.join(missing)} on record: it was written by an earlier version, or on a plant "
                "that does not say what it is. `mobee plan` and `mobee export` read it; to learn on, use another file."
            )
        for key in sorted(known):
            if known[key] != given.get(key):
                then, now = _differing(json_of(path, key, known[key]), json.loads(given.get(key, "null")))
                raise MobeeError(
                    f"{path}: {self.agent} has {key} = {json.dumps(then)} on record, now {json.dumps(now)}. "
                    "A run continues only with the settings it began with: use those, or another file."
                )

    def settings(self, agent: str | None = None) -> dict[str, Any]:
        """Return the recorded settings of the named agent, by name; None: of this agent. Empty if none are recorded."""
        with explained(self.path):
            rows = self._db.execute("SELECT key, value FROM meta WHERE agent = ?", (self._named(agent),)).fetchall()
        return {key: json_of(self.path, f"the setting {key}", value) for key, value in rows}

    def close(self) -> None:
        """Close the file and release the lock on the agent's data."""
        self._db.close()
        if self._release is not None:
            self._release()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.close()

    def _named(self, agent: str | None) -> str:
        return self.agent if agent is None else agent


def _differing(then: Any, now: Any) -> tuple[Any, Any]:
    """Return the parts of two values that differ: for two mappings with the same keys, only the entries that are not equal."""
    if not (isinstance(then, dict) and isinstance(now, dict) and then.keys() == now.keys()):
        return then, now
    pairs = {key: _differing(then[key], now[key]) for key in sorted(then) if then[key] != now[key]}
    return {key: pair[0] for key, pair in pairs.items()}, {key: pair[1] for key, pair in pairs.items()}


def _is_list(value: Any, kinds: tuple[type, ...]) -> bool:
    return isinstance(value, list) and all(type(item) in kinds for item in value)


def _texts(settings: dict[str, Any]) -> dict[str, str]:
    return {key: json.dumps(value, sort_keys=True) for key, value in settings.items()}


STORE = "transitions.sqlite"  # of a run, in its folder


def store_of(run: Path) -> Path:
    """Return the file of transitions of a run: STORE ("transitions.sqlite") in `run` if that is a folder, else `run` itself."""
    return run / STORE if run.is_dir() else run


EXPLORERS = """
CREATE TABLE IF NOT EXISTS explorers (agent TEXT NOT NULL, n INTEGER NOT NULL, explorer TEXT NOT NULL, PRIMARY KEY (agent, n))
"""  # a table of files in which an explorer was changed
CONTINUED = "continued"  # key of the record of an agent that began with the transitions of another file
PLANT = "plant"  # key of the plant's settings


@dataclass(frozen=True, slots=True)
class Transition:
    """One observed transition (s, a, s'), with its reward and the end of its action.

    `n`: its number, 1, 2, ... for each agent.  `s`, `a`, `s_next`: indices of the state, of the action and of the state after it.
    `reward`: intrinsic reward, nats.  `settled`: False if the action timed out.  `duration`: s, by the plant's clock.  `q`: rad, encoder
    values of the part's motors at the end.  `touched`: names of the world objects that touched the part at the end (`Outcome.touched`).
    """

    n: int
    s: int
    a: int
    s_next: int
    reward: float
    settled: bool
    duration: float
    q: tuple[float, ...]
    touched: tuple[str, ...] = ()


class TransitionStore(AgentFile):
    """The transitions of one agent in the file of a run; each survives a kill and a power cut as soon as `append` has returned.

    Args:
        path: the SQLite file; it is created if missing, but its folder must exist.
        agent: the name of the agent in the file.
        read_only: open the file for reading only; nothing is created or changed.
        durable: False: a transition survives a kill but not a power cut; for learning offline.

    Raises:
        MobeeError: from every method; InUse: another process writes this agent's data; NoRoom: the disk is full, and the same call succeeds
            when there is room.
    """

    def __init__(self, path: str | Path, agent: str, read_only: bool = False, durable: bool = True) -> None:
        super().__init__(path, agent, read_only, durable)
        self._last = self._newest()

    def append(self, transition: Transition) -> None:
        """Commit one transition; it is on disk when this method returns, unless `durable` is False.

        Raises MobeeError unless its number `n` is the number of the last stored transition plus 1 (1 for the first transition),
        InvalidValue for a value of another type than `Transition` states.
        """
        if transition.n != self._last + 1:
            raise MobeeError(f"{self.path}: {self.agent} has {self._last} transitions: append number {self._last + 1}, not {transition.n}.")
        row = (self.agent, *self._row(transition), time.time())
        with explained(self.path):
            self._db.execute(f"INSERT INTO transitions VALUES ({', '.join('?' * len(row))})", row)
        self._last = int(transition.n)

    def _row(self, made: Transition) -> tuple[Any, ...]:
        """Return the values of a transition in the types that `load` reads again: SQLite would store a number of NumPy as bytes."""
        try:
            numbers = [index(one) for one in (made.n, made.s, made.a, made.s_next)]
            reals = [float(made.reward), float(made.duration)]
            pose, names = [float(one) for one in made.q], [str(name) for name in made.touched]
        except (TypeError, ValueError):
            numbers = [-1]
        if min(numbers) < 0 or not all(map(isfinite, reals)):
            raise InvalidValue(
                f"{self.path}: transition {made.n!r} cannot be stored: s={made.s!r}, a={made.a!r} and s_next={made.s_next!r} must be whole "
                f"numbers of at least 0, reward={made.reward!r} and duration={made.duration!r} finite, q numbers, "
                f"touched={made.touched!r} names."
            )
        return *numbers, reals[0], bool(made.settled), reals[1], json.dumps(pose), json.dumps(names)

    def after(self, n: int) -> list[Transition]:
        """Read again which transitions are on disk, because a call of `append` was interrupted; return those after the first `n`."""
        self._last = self._newest()
        return self.load()[n:]

    def continue_from(self, source: str | Path, settings: dict[str, Any]) -> None:
        """Copy this agent's transitions from the file `source`; do nothing if this file already has settings or transitions of the agent.

        The settings of the agent in `source` must equal `settings`; only those of the plant may differ, so that an agent can learn first
        offline (on a plant simulated in one process) and then on the live system. `settings` are recorded in this file. The number of
        copied transitions and the settings of the plant on which they were made are recorded too, in the setting "continued". Raises
        MobeeError if `source` has no transitions of the agent, or if its settings differ.
        """
        if self._last or self.settings():
            return
        with TransitionStore(source, self.agent, read_only=True) as other:
            known, agents = other.settings(), other.agents()
            if self.agent not in agents:
                raise MobeeError(f"{source}: holds no transitions of {self.agent}. It holds those of {', '.join(agents) or 'no agent'}.")
            changes = other.explorers()
            origin = {"transitions": other._last, "before": known.pop(CONTINUED, None), "plant": known.pop(PLANT, None)}
            with explained(other.path):
                rows = other._db.execute("SELECT * FROM transitions WHERE agent = ? ORDER BY n", (self.agent,)).fetchall()
        self._require_equal(Path(source), _texts(known), {key: text for key, text in _texts(settings).items() if key != PLANT})
        with explained(self.path), transaction(self._db):
            self._record(_texts(settings | {CONTINUED: origin}))
            self._db.executemany(f"INSERT INTO transitions VALUES ({', '.join('?' * len(rows[0]))})", rows)
            self._write_explorers(changes)
        self._last = len(rows)

    def change_explorer(self, n: int, explorer: str) -> None:
        """Record the name of the explorer (exploration strategy) that chooses the actions after the first `n` transitions.

        The record is on disk when this method returns, unless `durable` is False.
        """
        with explained(self.path), transaction(self._db):
            self._write_explorers({n: explorer})

    def _write_explorers(self, changes: Mapping[int, str]) -> None:
        """Write changes of the explorer, by the number of transitions before each, within a transaction."""
        if changes:
            self._db.execute(EXPLORERS)
            self._db.executemany("INSERT OR REPLACE INTO explorers VALUES (?, ?, ?)", [(self.agent, *one) for one in changes.items()])

    def explorers(self, agent: str | None = None) -> dict[int, str]:
        """Return the recorded changes of the explorer (exploration strategy) of the named agent (None: this agent).

        Keys: the number of transitions before the change. Values: the name of the new explorer.
        """
        with explained(self.path):
            if self._db.execute("SELECT 1 FROM sqlite_master WHERE name = 'explorers'").fetchone() is None:
                return {}
            return dict(self._db.execute("SELECT n, explorer FROM explorers WHERE agent = ? ORDER BY n", (self._named(agent),)).fetchall())

    def load(self, agent: str | None = None) -> list[Transition]:
        """Return all transitions of the named agent (None: this agent), in order; raises MobeeError if one is missing or damaged."""
        name = self._named(agent)
        query = "SELECT n, s, a, s_next, reward, settled, duration, q, touched FROM transitions WHERE agent = ? ORDER BY n"
        with explained(self.path):
            rows = self._db.execute(query, (name,)).fetchall()
        for expected, row in enumerate(rows, start=1):
            if row[0] != expected:
                raise MobeeError(f"{self.path}: transition {expected} of {name} is missing; the file was edited. Restore it from a copy.")
        return [self._transition(name, *row) for row in rows]

    def _transition(self, agent: str, n: int, *row: Any) -> Transition:
        """Return the transition of a row; raises MobeeError if the row has other types than `append` writes."""
        *numbers, q, touched = row
        what = f"transition {n} of {agent}"
        pose, names = (json_of(self.path, what, text) for text in (q, touched))
        if (
            list(map(type, numbers)) != [int, int, int, float, int, float]
            or not _is_list(pose, (int, float))
            or not _is_list(names, (str,))
            or min(numbers[:3]) < 0
        ):
            raise damaged(self.path, f"{what} is not what MoBeE writes")
        s, a, s_next, reward, settled, duration = numbers
        return Transition(n, s, a, s_next, reward, bool(settled), duration, tuple(pose), tuple(names))

    def times(self, agent: str | None = None) -> list[float]:
        """Return the time at which each transition of the named agent (None: this agent) was committed: s since 1970, in order."""
        with explained(self.path):
            rows = self._db.execute("SELECT t FROM transitions WHERE agent = ? ORDER BY n", (self._named(agent),)).fetchall()
        return [t for (t,) in rows]

    def agents(self) -> tuple[str, ...]:
        """Return the names of the agents that have transitions in the SQLite file, sorted."""
        with explained(self.path):
            return tuple(name for (name,) in self._db.execute("SELECT DISTINCT agent FROM transitions ORDER BY agent"))

    def _newest(self) -> int:
        with explained(self.path):
            newest = self._db.execute("SELECT max(n) FROM transitions WHERE agent = ?", (self.agent,)).fetchone()[0]
        return int(newest or 0)
