"""Transitions on disk: one SQLite file a run, each transition committed before its agent acts again (DESIGN section 8)."""

from __future__ import annotations

import json
import time
from dataclasses import dataclass
from pathlib import Path

from mobee.agent_file import AgentFile
from mobee.database import explained
from mobee.errors import MobeeError

STORE = "transitions.sqlite"  # of a run, in its folder


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


class TransitionStore(AgentFile):
    """The transitions of one agent in the file of a run; what `append` has returned from survives a kill and a power cut.

    Args:
        path, agent, read_only: of the AgentFile, which says too what is raised.
    """

    def __init__(self, path: str | Path, agent: str, read_only: bool = False) -> None:
        super().__init__(path, agent, read_only)
        self._last = self._newest()

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
        with explained(self.path):
            self._db.execute(f"INSERT INTO transitions VALUES ({', '.join('?' * len(row))})", row)
        self._last = transition.n

    def load(self, agent: str | None = None) -> list[Transition]:
        """All transitions of this agent, or of another one in the file, in order."""
        name = self._named(agent)
        query = "SELECT n, s, a, s_next, reward, settled, duration, q, touched FROM transitions WHERE agent = ? ORDER BY n"
        with explained(self.path):
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
        with explained(self.path):
            rows = self._db.execute("SELECT t FROM transitions WHERE agent = ? ORDER BY n", (self._named(agent),)).fetchall()
        return [t for (t,) in rows]

    def agents(self) -> tuple[str, ...]:
        """Names of the agents that have transitions in the file."""
        with explained(self.path):
            return tuple(name for (name,) in self._db.execute("SELECT DISTINCT agent FROM transitions ORDER BY agent"))

    def _newest(self) -> int:
        with explained(self.path):
            newest = self._db.execute("SELECT max(n) FROM transitions WHERE agent = ?", (self.agent,)).fetchone()[0]
        return int(newest or 0)
