"""Builds task-relevant roadmaps: poses that satisfy some costs, spread over a task space, and motions between them (thesis 3.3)."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from mobee.arrays import Array
from mobee.errors import InvalidValue, UnknownName
from mobee.model.model import Model
from mobee.roadmap.building.draft import Draft, Progress, request
from mobee.roadmap.building.flood import Flood
from mobee.roadmap.building.front import Front
from mobee.roadmap.building.growth import Growth
from mobee.roadmap.building.judge import Judge
from mobee.roadmap.building.task import Task
from mobee.roadmap.ik.costs import collision
from mobee.roadmap.ik.ngik import METHODS
from mobee.roadmap.ik.problem import Cost, Problem
from mobee.roadmap.ik.term import Term
from mobee.roadmap.roadmap import Roadmap

LONGEST = 0.4  # rad
WORKERS = 4  # threads at most
FLOOD, FRONT = "flood", "front"  # stages
_DEFAULT = Front()


def build_roadmap(
    model: Model,
    costs: Sequence[Cost],
    task: Task,
    spacing: ArrayLike,
    start: ArrayLike | None = None,
    motors: Sequence[str] | None = None,
    method: Literal["hybrid", "nes", "least_squares"] = "hybrid",
    seed: int = 0,
    neighbours: int | None = None,
    longest: float | None = LONGEST,
    margin: float = 0.0,
    file: str | Path | None = None,
    progress: Callable[[Progress], None] | None = None,
    front: Front = _DEFAULT,
) -> Roadmap:
    """A map of poses that are within the tolerances of all costs, touch nothing, and are spread evenly over the box of a task.

    The same seed gives the same map, also when the building was interrupted.

    Args:
        model: whose solids are felt, in its world, which must stay as it is meanwhile.
        costs: terms of mobee.costs, and plain functions of pose and contacts; that nothing touches is added where it is missing.  They
            may be called by several threads.
        task: of mobee.tasks.
        spacing: between vertices, in the units of the task's coordinates: one number, or one a coordinate.
        start: (n,) rad, where the first pose is sought, and what the motors that may not move keep; None: home.
        motors: names of parts and motors that may move; None: all.
        method: "nes": thesis Algorithms 2-4, whatever the costs and the coordinates are; "least_squares": over a lattice of task
            points, for coordinates with derivatives; "hybrid": so, and what that misses by evolution.
        seed: of all that is drawn.
        neighbours: None: each vertex is joined to as many before it as there are coordinates (Algorithm 4); else to so many nearest.
        longest: edges along which a motor turns by more [rad] are left out; None: none are.
        margin: what every motor keeps from its limits [rad], at most a quarter of its range.  MoBeE's law pushes motors out of the
            last 10 degrees, so a robot under it rests only in poses that keep these.
        file: .npz in which what there is is kept at least every 10 s.  If it is there already, with the same settings, the building is gone
            on with.
        progress: called now and then.
        front: how the front advances.

    Raises:
        InvalidValue, UnknownName: with what is valid.
        MobeeError: no first pose was found, the file is of other settings or cannot be written, or the world has changed.
    """
    if method not in METHODS:
        raise UnknownName("method", method, METHODS)
    problem = Problem(model, _with_contacts(costs), start, motors, margin)
    apart = _checked_spacing(task, spacing)
    _check_edges(neighbours, longest)
    how = {"seed": seed, "method": method, "neighbours": neighbours, "longest": longest, "margin": margin, "front": asdict(front)}
    asked = request(model, problem, task, apart, how)
    draft = Draft(model, asked, apart, file, progress)
    if (finished := draft.finished()) is not None:
        return finished
    rng = np.random.default_rng(seed)
    given = None
    if draft.stage != FRONT and (method == "least_squares" or (method == "hybrid" and _has_derivatives(model, task))):
        flood = Flood(problem, task, apart, rng)
        draft.run(FLOOD, flood)
        given = flood.result()
    if given is not None and method == "least_squares":
        return draft.finish(*given, problem.evaluations)
    workers = min(WORKERS, len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1)
    with ThreadPoolExecutor(workers) as pool:
        growth = Growth(Judge(problem, task, apart, pool), front, rng)
        if given is not None:
            growth.begin_from(*given)
        draft.run(FRONT, growth)
    return draft.finish(*growth.result(), problem.evaluations)


def _has_derivatives(model: Model, task: Task) -> bool:
    return task.aims(model.robot, task.box.mean(axis=1)) is not None


def _with_contacts(costs: Sequence[Cost]) -> list[Cost]:
    if isinstance(costs, Term) or not isinstance(costs, Sequence):
        raise InvalidValue(f"costs is {costs!r}; it must be a list of terms.")
    felt = any(isinstance(one, Term) and one.name == "collision" for one in costs)
    return list(costs) if felt else [*costs, collision()]


def _checked_spacing(task: Task, spacing: ArrayLike) -> Array:
    m = len(task.coordinates)
    try:
        apart = np.broadcast_to(np.asarray(spacing, dtype=np.float64), (m,)).copy()
    except ValueError:
        raise InvalidValue(f"spacing has shape {np.shape(spacing)}; it must be one number, or {m}: {', '.join(task.names)}.") from None
    if not (np.isfinite(apart).all() and (apart > 0.0).all()):
        raise InvalidValue(f"spacing is {spacing!r}; it must be finite and above 0, in the units of the task's coordinates.")
    return apart


def _check_edges(neighbours: int | None, longest: float | None) -> None:
    if neighbours is not None and neighbours < 1:
        raise InvalidValue(f"neighbours {neighbours!r}: must be at least 1, or None for as many as there are task coordinates.")
    if longest is not None and not longest > 0.0:
        raise InvalidValue(f"longest {longest!r} rad: must be above 0, or None for no limit.")
