# SPDX-License-Identifier: Apache-2.0
"""Stores the steps of a reach learner in the SQLite file of a run (of one or several agents); each is on disk before the next action.

A step is one action of the learner: a transition between states, or a reach, in which a force pulls a marker to a target.
"""

from __future__ import annotations

import json
import sqlite3
import time
from collections.abc import Sequence
from contextlib import closing
from dataclasses import astuple, fields
from pathlib import Path
from typing import Any

import numpy as np

from mobee.database import damaged, explained, json_of, opened, transaction
from mobee.errors import MobeeError
from mobee.learning.reaching.tries import Step
from mobee.reach import ReachTarget
from mobee.store import AgentFile

TABLES = """
CREATE TABLE IF NOT EXISTS reach_problems (
    agent TEXT NOT NULL, problem INTEGER NOT NULL, target TEXT NOT NULL, PRIMARY KEY (agent, problem));
CREATE TABLE IF NOT EXISTS reach_learners (agent TEXT NOT NULL, n INTEGER NOT NULL, settings TEXT NOT NULL, PRIMARY KEY (agent, n));
CREATE TABLE IF NOT EXISTS reach_steps (
    agent TEXT NOT NULL, n INTEGER NOT NULL, number INTEGER NOT NULL, problem INTEGER NOT NULL, s INTEGER NOT NULL, a INTEGER NOT NULL,
    s_next INTEGER NOT NULL, failed INTEGER NOT NULL, reward REAL NOT NULL, expected REAL NOT NULL, missing REAL NOT NULL,
    settled INTEGER NOT NULL, duration REAL NOT NULL, q TEXT NOT NULL, touched TEXT NOT NULL, t REAL NOT NULL, PRIMARY KEY (agent, n));
"""
_SUFFIX = " reaching"  # of the agent's name in the file
COLUMNS = tuple(column.name for column in fields(Step))


class ReachStore(AgentFile):
    """The problems (targets to reach) and steps (actions with their outcomes) of the reach learner of one part, in the file of a run.

    Args:
        path: the SQLite file; made if missing.
        part: the learner's part; its reaches are stored under the name "<part> reaching", beside the part's transitions.
        read_only: open the file for reading only; raises MobeeError if no reach learner has used the file.
    """

    def __init__(self, path: str | Path, part: str, read_only: bool = False) -> None:
        super().__init__(path, part + _SUFFIX, read_only)
        with explained(self.path):
            if read_only:
                if not _has_reaches(self._db):
                    raise MobeeError(
                        f"{self.path}: no agent has learned to reach in this run yet; run a ReachAgent with a ReachStore on this file."
                    )
            else:
                with transaction(self._db):
                    for statement in TABLES.split(";")[:-1]:
                        self._db.execute(statement)
            self._last, self._problems = (
                int(self._db.execute(f"SELECT count(*) FROM {table} WHERE agent = ?", (self.agent,)).fetchone()[0])
                for table in ("reach_steps", "reach_problems")
            )

    def learner(self, settings: dict[str, Any]) -> None:
        """Record the settings of the learner that makes the following steps, as JSON values; if they have not changed, write nothing."""
        given = json.dumps(settings, sort_keys=True)
        with explained(self.path), transaction(self._db):
            newest = self._db.execute(
                "SELECT settings FROM reach_learners WHERE agent = ? ORDER BY n DESC LIMIT 1", (self.agent,)
            ).fetchone()
            if newest is None or newest[0] != given:
                self._db.execute("INSERT OR REPLACE INTO reach_learners VALUES (?, ?, ?)", (self.agent, self._last, given))

    def learners(self) -> list[tuple[int, dict[str, Any]]]:
        """Return the settings of the learner that were recorded, oldest first, each as (number of steps recorded before them, settings)."""
        with explained(self.path):
            rows = self._db.execute("SELECT n, settings FROM reach_learners WHERE agent = ? ORDER BY n", (self.agent,)).fetchall()
        return [(n, json_of(self.path, f"the settings of {self.agent}", settings)) for n, settings in rows]

    def append(self, step: Step, problems: Sequence[ReachTarget]) -> None:
        """Write one step (action of the learner), and the targets of problems that are new; all is on disk when this returns.

        `problems`: the targets of all problems so far, by number. Raises MobeeError if the number of the step is not the next one.
        """
        if step.n != self._last + 1:
            raise MobeeError(f"{self.path}: {self.agent} has {self._last} steps: append number {self._last + 1}, not {step.n}.")
        values = (self.agent, *_row(step), time.time())
        new = [(self.agent, number, _written(problems[number])) for number in range(self._problems, step.problem + 1)]
        with explained(self.path), transaction(self._db):
            self._db.executemany("INSERT INTO reach_problems VALUES (?, ?, ?)", new)
            self._db.execute(f"INSERT INTO reach_steps VALUES ({', '.join('?' * len(values))})", values)
        self._last, self._problems = step.n, self._problems + len(new)

    def times(self) -> list[float]:
        """Return the time at which each step (action of the learner) was written, in order, in s since 1970."""
        with explained(self.path):
            rows = self._db.execute("SELECT t FROM reach_steps WHERE agent = ? ORDER BY n", (self.agent,)).fetchall()
        return [t for (t,) in rows]

    def problems(self) -> list[ReachTarget]:
        """Return the target of each problem (task to reach a target), in the order of the problems' numbers."""
        with explained(self.path):
            rows = self._db.execute("SELECT target FROM reach_problems WHERE agent = ? ORDER BY problem", (self.agent,)).fetchall()
        return [self._problem(target) for (target,) in rows]

    def load(self) -> list[Step]:
        """Return all steps (actions of the learner), in order; raises MobeeError if a step is missing or damaged."""
        with explained(self.path):
            rows = self._db.execute(f"SELECT {', '.join(COLUMNS)} FROM reach_steps WHERE agent = ? ORDER BY n", (self.agent,)).fetchall()
        for expected, row in enumerate(rows, start=1):
            if row[0] != expected:
                raise MobeeError(f"{self.path}: step {expected} of {self.agent} is missing; the file was edited. Restore it from a copy.")
        return [self._step(*row) for row in rows]

    def _problem(self, text: object) -> ReachTarget:
        what = f"a target of {self.agent}"
        made = json_of(self.path, what, text)
        try:
            normal = None if made["normal"] is None else np.array(made["normal"], dtype=float)
            return ReachTarget(np.array(made["position"], dtype=float), made["radius"], made["aim"], normal, made.get("faces", False))
        except (LookupError, TypeError, ValueError):  # InvalidValue is a ValueError
            raise damaged(self.path, f"{what} is not what MoBeE writes") from None

    def _step(self, *row: Any) -> Step:
        values = dict(zip(COLUMNS, row, strict=True))
        what = f"step {values['n']} of {self.agent}"
        lists = {name: json_of(self.path, what, values[name]) for name in ("q", "touched")}
        flags, reals = ("failed", "settled"), ("reward", "expected", "missing", "duration")
        kinds = {name: float if name in reals else int for name in values if name not in lists}
        if any(type(values[name]) is not kind for name, kind in kinds.items()) or not all(isinstance(one, list) for one in lists.values()):
            raise damaged(self.path, f"{what} is not what MoBeE writes")
        return Step(**values | {name: tuple(one) for name, one in lists.items()} | {name: bool(values[name]) for name in flags})


def reaching_parts(file: str | Path) -> tuple[str, ...]:
    """Return the names of the parts for which a reach learner has stored steps in `file`, the SQLite file of a run."""
    path = Path(file)
    with explained(path), closing(opened(path, read_only=True)) as database:
        if not _has_reaches(database):
            return ()
        rows = database.execute("SELECT DISTINCT agent FROM reach_steps ORDER BY agent").fetchall()
    return tuple(agent.removesuffix(_SUFFIX) for (agent,) in rows)


def _has_reaches(database: sqlite3.Connection) -> bool:
    return database.execute("SELECT 1 FROM sqlite_master WHERE name = 'reach_steps'").fetchone() is not None


def _row(step: Step) -> tuple[Any, ...]:
    return tuple(json.dumps(value) if isinstance(value, tuple) else value for value in astuple(step))


def _written(target: ReachTarget) -> str:
    normal = None if target.normal is None else target.normal.tolist()
    made = {"position": target.position.tolist(), "radius": target.radius, "aim": target.aim, "normal": normal}
    return json.dumps({**made, "faces": True} if target.faces else made)
