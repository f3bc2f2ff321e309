"""Transitions on disk: one SQLite file a run, each transition committed before its agent acts again (DESIGN section 8)."""

from __future__ import annotations

import json
import sqlite3
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any

from mobee.errors import MobeeError

STORE = "transitions.sqlite"  # of a run, in its folder
SCHEMA = 1
APPLICATION_ID = 0x4D6F4265  # "MoBe": marks the file as ours
BUSY_TIMEOUT = 10.0  # s; another agent's commit takes milliseconds
TABLES = """
CREATE TABLE meta (agent TEXT NOT NULL, key TEXT NOT NULL, value TEXT NOT NULL, PRIMARY KEY (agent, key));
CREATE TABLE transitions (
    agent TEXT NOT NULL, n INTEGER NOT NULL, s INTEGER NOT NULL, a INTEGER NOT NULL, s_next INTEGER NOT NULL, reward REAL NOT NULL,
    settled INTEGER NOT NULL, duration REAL NOT NULL, q TEXT NOT NULL, touched TEXT NOT NULL, t REAL NOT NULL, PRIMARY KEY (agent, n));
"""
REMEDIES = {
    "SQLITE_FULL": "the disk is full; make room and start again, all that was committed is safe",
    "SQLITE_IOERR": "the disk refused the write (full, over quota or failing); all that was committed is safe",
    "SQLITE_BUSY": f"another process kept it locked for {BUSY_TIMEOUT:g} s; find and end it",
    "SQLITE_READONLY": "it may not be written; check its permissions and those of its folder",
    "SQLITE_CANTOPEN": "it cannot be opened; check that its folder exists and may be written",
    "SQLITE_NOTADB": "it is not a database; give another path",
    "SQLITE_CORRUPT": "it is damaged; restore it from a copy",
    "SQLITE_CONSTRAINT": "another process writes transitions of the same agent; run one process an agent",
}


@dataclass(frozen=True, slots=True)
class Transition:
    """One observed (s, a, s'), with what it was worth and how the action ended.

    `n`: 1, 2, ... of this agent.  `reward`: nats.  `duration`: s of plant time.  `q`: rad, all motors of the part.
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


class TransitionStore:
    """The transitions of one agent in the file of a run, which the processes of several agents may share.

    Write-ahead log with full synchronisation: what `append` has returned from survives a kill and a power cut.

    Args:
        path: the SQLite file; made if missing, its folder must exist.
        agent: the name under which this agent's transitions are kept.

    Raises:
        MobeeError: from every method, in one line with the file and what to do.
    """

    def __init__(self, path: str | Path, agent: str) -> None:
        self.path, self.agent = Path(path), agent
        with self._explained():
            self._db = sqlite3.connect(self.path, timeout=BUSY_TIMEOUT, isolation_level=None, check_same_thread=False)
        try:
            self._prepare()
        except BaseException:
            self._db.close()
            raise
        self._last = self._newest()

    def bind(self, settings: dict[str, Any]) -> None:
        """Record the agent's settings (plain JSON values), or refuse if it has others on record."""
        given = {key: json.dumps(value, sort_keys=True) for key, value in settings.items()}
        with self._explained(), self._transaction():
            known = dict(self._db.execute("SELECT key, value FROM meta WHERE agent = ?", (self.agent,)))
            if not known:
                self._db.executemany("INSERT INTO meta VALUES (?, ?, ?)", [(self.agent, key, value) for key, value in given.items()])
                return
        if missing := sorted(given.keys() - known.keys()):
            raise MobeeError(
                f"{self.path}: {self.agent} has no {', '.join(missing)} on record: it was written by an earlier version, whose agents "
                "chose otherwise. `mobee plan` and `mobee export` read it; to learn on, use another file."
            )
        for key in sorted(known):
            if known.get(key) != given.get(key):
                raise MobeeError(
                    f"{self.path}: {self.agent} has {key} = {known.get(key)} on record, now {given.get(key)}. "
                    "A run goes on only with the settings it began with: use those, or another file."
                )

    def settings(self, agent: str | None = None) -> dict[str, Any]:
        """The settings on record of this agent, or of another one in the file; empty if there are none."""
        with self._explained():
            rows = self._db.execute("SELECT key, value FROM meta WHERE agent = ?", (agent or self.agent,)).fetchall()
        return {key: json.loads(value) for key, value in rows}

    def append(self, transition: Transition) -> None:
        """Commit one transition; it is on disk when this returns."""
        if transition.n != self._last + 1:
            raise MobeeError(f"{self.path}: {self.agent} has {self._last} transitions: append number {self._last + 1}, not {transition.n}.")
        row = (
            self.agent,
            transition.n,
            transition.s,
            transition.a,
            transition.s_next,
            transition.reward,
            transition.settled,
            transition.duration,
            json.dumps(transition.q),
            json.dumps(transition.touched),
            time.time(),
        )
        with self._explained():
            self._db.execute(f"INSERT INTO transitions VALUES ({', '.join('?' * len(row))})", row)
        self._last = transition.n

    def load(self, agent: str | None = None) -> list[Transition]:
        """All transitions of this agent, or of another one in the file, in order."""
        name = self.agent if agent is None else agent
        query = "SELECT n, s, a, s_next, reward, settled, duration, q, touched FROM transitions WHERE agent = ? ORDER BY n"
        with self._explained():
            rows = self._db.execute(query, (name,)).fetchall()
        for expected, row in enumerate(rows, start=1):
            if row[0] != expected:
                raise MobeeError(f"{self.path}: transition {expected} of {name} is missing; the file was edited. Restore it from a copy.")
        return [
            Transition(n, s, a, s_next, reward, bool(settled), duration, tuple(json.loads(q)), tuple(json.loads(touched)))
            for n, s, a, s_next, reward, settled, duration, q, touched in rows
        ]

    def times(self, agent: str | None = None) -> list[float]:
        """When each transition of this agent, or of another one in the file, was committed: s since 1970, in order."""
        with self._explained():
            rows = self._db.execute("SELECT t FROM transitions WHERE agent = ? ORDER BY n", (agent or self.agent,)).fetchall()
        return [t for (t,) in rows]

    def agents(self) -> tuple[str, ...]:
        """Names of the agents that have transitions in the file."""
        with self._explained():
            return tuple(name for (name,) in self._db.execute("SELECT DISTINCT agent FROM transitions ORDER BY agent"))

    def close(self) -> None:
        """Let go of the file."""
        self._db.close()

    def __enter__(self) -> TransitionStore:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.close()

    def _prepare(self) -> None:
        """Make the tables in a new file; refuse a file of another program or schema and leave it as it is."""
        with self._explained():
            self._db.execute("PRAGMA synchronous = FULL")
            with self._transaction():  # agents that start together must not make the tables twice
                application, version = (self._db.execute(f"PRAGMA {name}").fetchone()[0] for name in ("application_id", "user_version"))
                tables = self._db.execute("SELECT count(*) FROM sqlite_master").fetchone()[0]
                if not tables and not application and not version:
                    for statement in TABLES.split(";")[:-1]:
                        self._db.execute(statement)
                    self._db.execute(f"PRAGMA application_id = {APPLICATION_ID}")
                    self._db.execute(f"PRAGMA user_version = {SCHEMA}")
                elif application != APPLICATION_ID:
                    raise MobeeError(f"{self.path}: a database of another program. Give another path.")
                elif version != SCHEMA:
                    raise MobeeError(
                        f"{self.path}: written with schema {version}, this mobee reads {SCHEMA}. Use the version that wrote it."
                    )
            self._write_ahead()

    def _write_ahead(self) -> None:
        """Switch to the write-ahead log; SQLite does not wait by itself when two processes do this at once."""
        deadline = time.monotonic() + BUSY_TIMEOUT
        while True:
            try:
                self._db.execute("PRAGMA journal_mode = WAL")
                return
            except sqlite3.OperationalError as error:
                if not error.sqlite_errorname.startswith("SQLITE_BUSY") or time.monotonic() > deadline:
                    raise
                time.sleep(0.01)

    def _newest(self) -> int:
        with self._explained():
            newest = self._db.execute("SELECT max(n) FROM transitions WHERE agent = ?", (self.agent,)).fetchone()[0]
        return int(newest or 0)

    @contextmanager
    def _transaction(self) -> Iterator[None]:
        self._db.execute("BEGIN IMMEDIATE")
        try:
            yield
            self._db.execute("COMMIT")
        finally:
            if self._db.in_transaction:  # a full disk has already rolled back
                self._db.execute("ROLLBACK")

    @contextmanager
    def _explained(self) -> Iterator[None]:
        """Turn SQLite's errors into one line that names the file and the remedy."""
        try:
            yield
        except sqlite3.Error as error:
            name = getattr(error, "sqlite_errorname", "")
            remedy = next((text for key, text in REMEDIES.items() if name.startswith(key)), "")
            raise MobeeError(f"{self.path}: {remedy or 'SQLite failed'} ({error}).") from error
