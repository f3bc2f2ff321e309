"""What a run has on disk of each robot, as counts."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from experiments.kit.cells import load_cells
from experiments.transfer.comparing import Counts, Distance, counts_of, distance, mean
from experiments.transfer.live import ROBOTS
from experiments.transfer.settings import ROBOT, TASKS, space
from mobee import load_robot
from mobee.errors import InvalidValue
from mobee.store import STORE, TransitionStore


@dataclass(frozen=True, slots=True, eq=False)
class Compared:
    """A task's live robots and offline seeds, each against all offline seeds but one; of a live robot the mean of that."""

    live: dict[str, Distance]
    offline: tuple[Distance, ...]
    counts: dict[str, Counts]
    """Of each live robot, and of all offline seeds together under "offline"."""


def compared(folder: Path, task: str, least: int) -> Compared:
    """Read the folder of a run; raises InvalidValue if the offline seeds are not there."""
    results = [r for r in load_cells(folder).values() if r.cell.settings["task"] == task]
    if len(results) < 2:
        raise InvalidValue(f"{folder}: the task {task!r} has {len(results)} finished seeds offline, two are needed: go on with --resume.")
    robot, parts = load_robot(ROBOT), TASKS[task].parts
    spaces = {part: space(robot, TASKS[task], part) for part in parts}
    seeds = [{part: counts_of(result.values[f"seen_{part}"], spaces[part]) for part in parts} for result in results]
    together = {part: np.sum([seed[part] for seed in seeds], axis=0) for part in parts}
    without = [{part: together[part] - seed[part] for part in parts} for seed in seeds]
    offline = tuple(distance(seed, others, least) for seed, others in zip(seeds, without, strict=True))
    counts: dict[str, Counts] = {"offline": together}
    for name in ROBOTS:
        path = folder / task / name / STORE
        if path.exists():
            with TransitionStore(path, "") as store:
                rows = {part: np.array([(t.s, t.a, t.s_next) for t in store.load(part)]).reshape(-1, 3) for part in parts}
            counts[name] = {part: counts_of(rows[part][: results[0].cell.settings["transitions"]], spaces[part]) for part in parts}
    live = {name: mean([distance(counts[name], others, least) for others in without]) for name in counts if name in ROBOTS}
    return Compared(live, offline, counts)
