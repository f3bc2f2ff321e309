"""What was observed of a map and how it was changed, on disk, in the file of a run (DESIGN section 8)."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mobee.database import explained, transaction
from mobee.store import TransitionStore

TABLE = """
CREATE TABLE IF NOT EXISTS map_changes (
    agent TEXT NOT NULL, number INTEGER NOT NULL, n INTEGER NOT NULL, change TEXT NOT NULL, PRIMARY KEY (agent, number))
"""


@dataclass(frozen=True, slots=True)
class Change:
    """`what`: the method of an AdaptiveRoadmap; `given`: its arguments, as plain JSON values; after `n` transitions."""

    n: int
    what: str
    given: dict[str, Any]


class MapStore(TransitionStore):
    """A TransitionStore that keeps the changes of a map between its transitions, too.

    Args:
        path, agent, read_only: of the AgentFile, which says too what is raised.
    """

    def __init__(self, path: str | Path, agent: str, read_only: bool = False) -> None:
        super().__init__(path, agent, read_only)
        if not read_only:
            with explained(self.path), transaction(self._db):
                self._db.execute(TABLE)

    def changed(self, what: str, **given: Any) -> None:
        """Commit a change that is made now; it is on disk when this returns."""
        with explained(self.path), transaction(self._db):
            (number,) = self._db.execute("SELECT count(*) FROM map_changes WHERE agent = ?", (self.agent,)).fetchone()
            self._db.execute("INSERT INTO map_changes VALUES (?, ?, ?, ?)", (self.agent, number, self._last, json.dumps([what, given])))

    def changes(self) -> list[Change]:
        """All changes of this agent's map, in order."""
        with explained(self.path):
            if self._db.execute("SELECT 1 FROM sqlite_master WHERE name = 'map_changes'").fetchone() is None:
                return []
            rows = self._db.execute("SELECT n, change FROM map_changes WHERE agent = ? ORDER BY number", (self.agent,)).fetchall()
        return [Change(n, *json.loads(change)) for n, change in rows]
