# SPDX-License-Identifier: Apache-2.0
"""Builds task-relevant roadmaps: poses within the tolerances of given costs, spread over a task space, and edges (thesis 3.3).

`RoadmapSettings` has the method, the choice of edges and the settings of the searches.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from mobee.arrays import Array, checked_seed
from mobee.errors import InvalidValue, UnknownName
from mobee.model.model import Model
from mobee.roadmap.building.checkpoint import Checkpoint, Progress, request
from mobee.roadmap.building.frontier_builder import FrontierBuilder, PoseEvaluator
from mobee.roadmap.building.lattice_builder import LatticeBuilder
from mobee.roadmap.building.search_scheduler import SearchSettings, check_setting
from mobee.roadmap.building.tasks import Task
from mobee.roadmap.ik.costs import collision
from mobee.roadmap.ik.problem import Cost, Problem, require_list
from mobee.roadmap.ik.solve import METHODS
from mobee.roadmap.ik.terms import Term
from mobee.roadmap.roadmap import Roadmap

MAX_THREADS = 4
LATTICE, FRONTIER = "flood", "front"  # names of the two stages in files
MAX_TURN = 0.4  # rad: default of `RoadmapSettings.longest`


@dataclass(frozen=True, slots=True)
class RoadmapSettings:
    """Settings of `build_roadmap`: the search for poses, and the edges between them.

    Raises InvalidValue or UnknownName for a value that is not valid.

    Attributes:
        method: "nes": evolution strategy, thesis Algorithms 2-4, for any costs and task coordinates.  "least_squares": on a lattice of
            points in the task space, only for task coordinates with derivatives.  "hybrid": least squares if all task coordinates have
            derivatives, then the evolution strategy for the regions in which least squares found no poses.
        neighbours: number of nearest vertices to which each vertex is joined.  None: each vertex is joined to the m nearest of the vertices
            that were found before it; m: dimension of the task space (Algorithm 4).
        longest: edges along which a motor turns by more than this [rad], or slides by more than this [m], are left out.  None: no edge is
            left out.
        margin: distance that every motor keeps from its limits [rad], at most a quarter of its range; the whole range of a motor that
            slides counts as 200 degrees.  MoBeE's control law pushes motors out of the last 10 degrees, so a robot under this law comes to
            rest only in poses that keep this margin.
        search: settings of the searches by evolution strategy.
    """

    method: Literal["hybrid", "nes", "least_squares"] = "hybrid"
    neighbours: int | None = None
    longest: float | None = MAX_TURN
    margin: float = 0.0
    search: SearchSettings = field(default_factory=SearchSettings)

    def __post_init__(self) -> None:
        if self.method not in METHODS:
            raise UnknownName("method", self.method, METHODS)
        if self.neighbours is not None:
            valid = "a whole number of at least 1, or None for the dimension of the task space"
            check_setting(self, "neighbours", lambda x: x >= 1, valid, whole=True)
        if self.longest is not None:
            check_setting(self, "longest", lambda x: x > 0.0, "a finite number above 0 [rad], or None for no limit")
        check_setting(self, "margin", lambda x: x >= 0.0, "a finite number of at least 0 [rad]")


_DEFAULT = RoadmapSettings()


def build_roadmap(
    model: Model,
    costs: Sequence[Cost],
    task: Task,
    spacing: ArrayLike,
    start: ArrayLike | None = None,
    motors: Sequence[str] | None = None,
    seed: int = 0,
    settings: RoadmapSettings = _DEFAULT,
    file: str | Path | None = None,
    progress: Callable[[Progress], None] | None = None,
) -> Roadmap:
    """Build a roadmap: poses within the tolerances of all costs, without contacts, spread evenly over a box of task coordinates.

    The same seed gives the same roadmap, also if the building was interrupted and resumed.

    Args:
        model: robot and world; the world must not change while the roadmap is built.
        costs: terms of mobee.costs, and plain functions of pose and contacts.  The term `collision` is added if it is absent.  Costs may be
            called from several threads.
        task: a task space of mobee.tasks; its box is the range of each task coordinate.
        spacing: distance between vertices in the units of the task's coordinates: one number, or one per coordinate.
        start: (n,) rad, where the search for the first pose begins, and the posture of the motors that may not move; None: home.
        motors: names of the parts and motors that may move; None: all.
        seed: of the random numbers.
        settings: method, edges, margin from the joint limits, and details of the search.
        file: a .npz file in which the unfinished roadmap is saved at least every 10 s.  If it exists and has the same settings, building
            resumes from it; if it holds the finished roadmap, this is returned.
        progress: called several times per second with the vertices and evaluations so far.

    Raises:
        InvalidValue, UnknownName: an argument is not valid; the message states the valid values.
        MobeeError: no first pose was found, the file has other settings or cannot be written, or the world has changed.
    """
    seed = checked_seed(seed)
    problem = Problem(model, _with_contacts(costs), start, motors, settings.margin)
    distances = _checked_spacing(task, spacing)
    # The names in a file: "front" is what SearchSettings was called in the first version of the format.
    kept = {"seed": seed, **{name: getattr(settings, name) for name in ("method", "neighbours", "longest", "margin")}}
    requested = request(model, problem, task, distances, kept | {"front": asdict(settings.search)})
    checkpoint = Checkpoint(model, requested, distances, file, progress)
    if (finished := checkpoint.finished()) is not None:
        return finished
    rng = np.random.default_rng(seed)
    solved = None
    if checkpoint.stage != FRONTIER and (
        settings.method == "least_squares" or (settings.method == "hybrid" and _has_derivatives(model, task))
    ):
        lattice = LatticeBuilder(problem, task, distances, rng)
        checkpoint.run(LATTICE, lattice)
        solved = lattice.result()
    if solved is not None and settings.method == "least_squares":
        return checkpoint.finish(*solved, problem.evaluations)
    threads = min(MAX_THREADS, len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1)
    with ThreadPoolExecutor(threads) as pool:
        builder = FrontierBuilder(PoseEvaluator(problem, task, distances, pool), settings.search, rng)
        if solved is not None:
            builder.begin_from(*solved)
        checkpoint.run(FRONTIER, builder)
    return checkpoint.finish(*builder.result(), problem.evaluations)


def _has_derivatives(model: Model, task: Task) -> bool:
    return task.aims(model.robot, task.box.mean(axis=1)) is not None


def _with_contacts(costs: Sequence[Cost]) -> list[Cost]:
    require_list(costs)
    has_collision = any(isinstance(one, Term) and one.name == "collision" for one in costs)
    return list(costs) if has_collision else [*costs, collision()]


def _checked_spacing(task: Task, spacing: ArrayLike) -> Array:
    m = len(task.coordinates)
    try:
        distances = np.broadcast_to(np.asarray(spacing, dtype=np.float64), (m,)).copy()
    except ValueError:
        raise InvalidValue(f"spacing has shape {np.shape(spacing)}; it must be one number, or {m}: {', '.join(task.names)}.") from None
    if not (np.isfinite(distances).all() and (distances > 0.0).all()):
        raise InvalidValue(f"spacing is {spacing!r}; it must be finite and above 0, in the units of the task's coordinates.")
    return distances
