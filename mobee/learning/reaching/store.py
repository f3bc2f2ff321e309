# SPDX-License-Identifier: Apache-2.0
"""The steps of a reach learner, the problem-tries that they form, and the SQLite file that stores them (thesis 8.3.1).

A problem is a target, and a problem-try is one attempt to reach it. A step is one action of the learner: a transition between states, or a
reach, in which a force pulls a marker to a target. The file is that of a run, of one or several agents; each step is on disk before the
next action.
"""

from __future__ import annotations

import json
import sqlite3
import time
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass, fields
from operator import index
from pathlib import Path
from typing import Any

import numpy as np

from mobee.database import damaged, explained, json_of, opened, transaction
from mobee.errors import InvalidValue, MobeeError
from mobee.learning.reaching.reaches import REACH
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


@dataclass(frozen=True, slots=True)
class Step:
    """One action of a problem-try (attempt to reach one target): a transition, or the reach.

    `n`: number of the step, 1, 2, ... `number`: number of its problem-try, 1, 2, ... `problem`: number of its target, 0, 1, ... `s`,
    `s_next`: states before and after. `a`: the action of a transition, or REACH (-1). `failed`: whether a transition led to a state whose
    value in the plan was not higher than that of `s`. `reward`: the reward of a reach (thesis eq. 8.4); for a transition 0, or the penalty
    if it failed. `expected`: the reward predicted before a reach; 0 for a transition. `missing`: m, remaining distance after a reach; 0 for
    a transition. `settled`: False after a timeout. `duration`: s, by the plant's clock. `q`: (n_part,) rad, all motors of the part at the
    end (for a reach: when its force ended). `touched`: names of the world objects that the robot touched at the end.
    """

    n: int
    number: int
    problem: int
    s: int
    a: int
    s_next: int
    failed: bool
    reward: float
    expected: float
    missing: float
    settled: bool
    duration: float
    q: tuple[float, ...]
    touched: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Try:
    """A problem-try (attempt to reach one target) that has ended.

    `number`: its number, 1, 2, ... `problem`: number of its target, 0, 1, ... `path`: its transitions, each as (state, action, next state,
    failed). `reach_state`: the state where the reach started; None: the try ended at the limit of actions without a reach. `reward`,
    `expected`: observed and predicted reward of the reach. `intrinsic`: expected minus observed reward (thesis eq. 8.6). `missing`: m,
    remaining distance after the reach. `reward`, `expected`, `intrinsic` and `missing` are 0 without a reach. `timeouts`: number of actions
    that timed out. `duration`: s, by the plant's clock.
    """

    number: int
    problem: int
    path: tuple[tuple[int, int, int, bool], ...]
    reach_state: int | None
    reward: float
    expected: float
    intrinsic: float
    missing: float
    timeouts: int
    duration: float

    @property
    def failures(self) -> int:
        """The number of transitions of this problem-try (attempt to reach one target) that failed."""
        return sum(failed for _, _, _, failed in self.path)


def made_of(steps: Sequence[Step]) -> Try:
    """Return the problem-try (attempt to reach one target) that consists of these steps, in order; at least one is needed."""
    moves, last = [step for step in steps if step.a != REACH], steps[-1]
    reached = last.a == REACH
    return Try(
        number=last.number,
        problem=last.problem,
        path=tuple((step.s, step.a, step.s_next, step.failed) for step in moves),
        reach_state=last.s if reached else None,
        reward=last.reward if reached else 0.0,
        expected=last.expected if reached else 0.0,
        intrinsic=last.expected - last.reward if reached else 0.0,
        missing=last.missing if reached else 0.0,
        timeouts=sum(not step.settled for step in steps),
        duration=sum(step.duration for step in steps),
    )


class Problems:
    """The targets that were tried, numbered in the order of their first problem-tries, and how often each was tried.

    A problem-try is one attempt to reach one target.
    """

    def __init__(self) -> None:
        self.targets: list[ReachTarget] = []
        """The first target given for each problem."""
        self.tries: list[int] = []
        """Number of ended problem-tries of each problem."""
        self._known: dict[bytes, int] = {}

    def __len__(self) -> int:
        return len(self.targets)

    def index(self, target: ReachTarget) -> int:
        """Return the number of the problem (the target with this position); a new position gets the next number, from 0."""
        number = self._known.setdefault(place(target), len(self.targets))
        if number == len(self.targets):
            self.targets.append(target)
            self.tries.append(0)
        return number

    def least_tried(self, targets: Sequence[ReachTarget], rng: np.random.Generator) -> ReachTarget:
        """Return the target with the fewest problem-tries; if several have equally few, a random one of them (thesis 8.3.2).

        Raises InvalidValue if `targets` is empty. A problem-try is one attempt to reach one target.
        """
        if not targets:
            raise InvalidValue("there are no problems to choose from: give at least one target.")
        tries = [self.tries[n] if (n := self._known.get(place(target))) is not None else 0 for target in targets]
        least = min(tries)
        equal = [target for target, count in zip(targets, tries, strict=True) if count == least]
        return equal[int(rng.integers(len(equal)))]


def place(target: ReachTarget) -> bytes:
    """Return the key under which dicts store a target: the bytes of its position."""
    return (target.position + 0.0).tobytes()  # -0 and 0 are one position


COLUMNS = tuple(column.name for column in fields(Step))
FLAGS, REALS = ("failed", "settled"), ("reward", "expected", "missing", "duration")


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
        self._count()

    def _count(self) -> None:
        """Read how many steps and problems are on disk."""
        with explained(self.path):
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

        `problems`: the targets of all problems so far, by number. Raises MobeeError if the number of the step is not the next one,
        InvalidValue for a value of another type than `Step` states.
        """
        if step.n != self._last + 1:
            raise MobeeError(f"{self.path}: {self.agent} has {self._last} steps: append number {self._last + 1}, not {step.n}.")
        values = (self.agent, *self._row(step), time.time())
        new = [(self.agent, number, _written(problems[number])) for number in range(self._problems, step.problem + 1)]
        with explained(self.path), transaction(self._db):
            self._db.executemany("INSERT INTO reach_problems VALUES (?, ?, ?)", new)
            self._db.execute(f"INSERT INTO reach_steps VALUES ({', '.join('?' * len(values))})", values)
        self._last, self._problems = int(step.n), self._problems + len(new)

    def after(self, n: int) -> list[Step]:
        """Read again which steps are on disk, because a call of `append` was interrupted; return those after the first `n`."""
        self._count()
        return self.load()[n:]

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

    def _row(self, step: Step) -> list[Any]:
        """Return the values of a step in the types that `load` reads again: SQLite would store a number of NumPy as bytes."""
        kinds: dict[str, Callable[[Any], Any]] = dict.fromkeys(COLUMNS, index) | dict.fromkeys(FLAGS, bool) | dict.fromkeys(REALS, float)
        kinds |= {"q": lambda q: json.dumps([float(one) for one in q]), "touched": lambda names: json.dumps([str(one) for one in names])}
        try:
            row = {name: kind(getattr(step, name)) for name, kind in kinds.items()}
        except (TypeError, ValueError):
            row = dict.fromkeys(REALS, np.nan)
        if not np.isfinite([row[name] for name in REALS]).all():
            made = {name: getattr(step, name) for name in COLUMNS if name != "q"}
            raise InvalidValue(f"{self.path}: {made} cannot be stored: each value must have the type that `Step` states, and be finite.")
        return [row[name] for name in COLUMNS]

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
        kinds = {name: float if name in REALS else int for name in values if name not in lists}
        if any(type(values[name]) is not kind for name, kind in kinds.items()) or not all(isinstance(one, list) for one in lists.values()):
            raise damaged(self.path, f"{what} is not what MoBeE writes")
        return Step(**values | {name: tuple(one) for name, one in lists.items()} | {name: bool(values[name]) for name in FLAGS})


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


def _written(target: ReachTarget) -> str:
    normal = None if target.normal is None else target.normal.tolist()
    made = {"position": target.position.tolist(), "radius": target.radius, "aim": target.aim, "normal": normal}
    return json.dumps({**made, "faces": True} if target.faces else made)
