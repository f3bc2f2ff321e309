"""The learned reaches of a run: used without learning, and written as a table."""

from __future__ import annotations

import csv
import json
from dataclasses import astuple
from pathlib import Path

import numpy as np

from mobee.errors import MobeeError
from mobee.learning.reaching.evaluation import move
from mobee.learning.reaching.failures import has_failed
from mobee.learning.reaching.reach_agent import ReachAgent
from mobee.learning.reaching.store import COLUMNS, ReachStore, reaching_parts
from mobee.reach import ReachTarget
from mobee_cli.transition_tables import written_whole

HEAD = ("source", "part", "x", "y", "z", *COLUMNS, "time")


def write_reaches(file: Path, folder: Path) -> int:
    """Write one line a step of every problem-try in a run's folder; returns how many.  Raises MobeeError if there are none."""
    rows = 0
    with written_whole(file) as unfinished, unfinished.open("w", newline="") as sink:
        lines = csv.writer(sink)
        lines.writerow(HEAD)
        for source in sorted(folder.rglob("*.sqlite")):
            for part in reaching_parts(source):
                with ReachStore(source, part, read_only=True) as store:
                    targets = [target.position.tolist() for target in store.problems()]
                    for step, time in zip(store.load(), store.times(), strict=True):
                        values = (json.dumps(value) if isinstance(value, bool | tuple) else value for value in astuple(step))
                        lines.writerow((source.relative_to(folder), part, *targets[step.problem], *values, time))
                        rows += 1
        if not rows:
            raise MobeeError(f"{folder}: nobody has learned to reach in this run.")
    return rows


def go_to_pre_reach(agent: ReachAgent, target: ReachTarget) -> tuple[tuple[int, ...], tuple[tuple[int, int], ...], float]:
    """Go where reaching for a target is worth most; the states gone through, what was avoided, and the reward expected there.

    Transitions that fail are remembered by the agent until its end, and planned around.
    """
    state = agent.state
    path, avoided = [state], dict[tuple[int, int], None]()
    for _ in range(agent.limit - 1):
        plan = agent.plan(target, state)
        avoided.update(dict.fromkeys(plan.avoided))
        if not plan.actions:
            break
        expected = np.maximum(agent.predictor.mean(target.position), 0.0)
        values, _ = agent.planning.values(expected, agent.failures.rewards(target.position))
        action = plan.actions[0]
        _, following = move(agent.plant, agent.space, state, action)
        if has_failed(values, state, following):
            agent.failures.add(state, action, target.position, agent.penalty)
        state = following
        path.append(state)
    return tuple(path), tuple(avoided), float(agent.predictor.mean(target.position)[state])
