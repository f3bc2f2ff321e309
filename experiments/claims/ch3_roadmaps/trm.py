# SPDX-License-Identifier: Apache-2.0
"""TRM: coverage and validity of the task-relevant roadmaps of thesis figures 3.1 to 3.11 and 4.8, built by evolution and by least squares.

Claim: the framework produces maps for all these tasks: poses that meet the task's constraints, spread over its task space, in one graph.
Source: thesis 3.3, 3.4 and 4.3.  Published: figures only, about 5000 poses for figure 4.8.  Run time: about 5 minutes a seed on 2 cores.

"By evolution": with natural evolution strategies, as in the thesis.  The tasks are in trm_tasks.py; the box of a task is the range of its
coordinates, and the spacing is the distance between neighbouring vertices of a roadmap in the task space.  The part of the box that the
robot can reach is found independently of the roadmap: by least squares on a lattice of half the spacing with many starts per point, and by
random starts at random points.  A reachable point counts as covered if a vertex of the map is within a spacing of it.  python-fcl checks
the contacts of every pose.  `python -m experiments.claims.ch3_roadmaps.trm_pictures NAME` builds one map and draws it.
"""

from __future__ import annotations

import argparse
import importlib
import json
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

import mobee
from experiments.claims.ch3_roadmaps.trm_pictures import cloud_panel
from experiments.claims.ch3_roadmaps.trm_tasks import EXAMPLES
from experiments.kit.cells import Cell, CellResult, load_cells
from experiments.kit.experiment import OUR_AIM, Experiment, Measured, Steps, claim, judged
from experiments.kit.roadmap_task import Example, Method, build
from experiments.kit.run_folder import encoded
from experiments.kit.statistics import estimate
from experiments.kit.sweep import Cells, run_cells, sweep_arguments
from mobee.arrays import Array
from mobee.errors import InvalidValue
from mobee.rendering.sheet import write_sheet
from mobee.roadmap.building.lattice_builder import Patience, lattice_poses
from mobee.roadmap.building.task_ik import TaskIK
from mobee.roadmap.building.tasks import Task
from mobee.roadmap.edges import check_edges
from mobee.roadmap.graph import nearest_before
from mobee.roadmap.ik.problem import Cost, Problem, solid_robot
from mobee.roadmap.roadmap import Roadmap

FINER = 2  # points of the dense lattice per spacing
GENEROUS = Patience(starts=16, tries=24, hopeless=8, scouts=2048)
RANDOM_POINTS, STARTS = 2000, 20  # random task points, and random starts for each
MAX_OFFSET = 0.05  # of a pose from such a point, in spacings


@dataclass(frozen=True, slots=True, eq=False)
class Coverage:
    """How well the vertices of a roadmap cover the task space.

    `reachable`: task points (R, m) that the robot can reach, in the units of the m task coordinates.  `far`: (R,) distance of each point
    from its nearest vertex, in spacings (distances between neighbouring vertices of the roadmap).
    """

    reachable: Array
    far: Array

    @property
    def share(self) -> float:
        """The share of the reachable task points that are within a spacing of a vertex."""
        return float((self.far <= 1.0).mean())

    @property
    def largest_hole(self) -> float:
        """The largest distance of a reachable task point from its nearest vertex, as a multiple of the roadmap's spacing."""
        return float(self.far.max())


def reachable(
    model: mobee.Model,
    costs: Sequence[Cost],
    task: Task,
    spacing: Array,
    motors: Sequence[str] | None = None,
    start: Array | None = None,
    margin: float = 0.0,
    seed: int = 1,
) -> Array:
    """Return a dense set of task points that the robot can reach, (R, m).

    Most points are found by least squares on a lattice of half the spacing, with many more starts per point than a roadmap uses.  Others
    are found from random starts at random points, so that they do not depend on poses of neighbouring points.  `costs`: what each pose must
    satisfy.  `spacing`: distance between neighbouring vertices of the roadmap along each task coordinate, (m,).  `motors`: those that may
    move, None: all.  `start`: pose (n,) rad of all motors, at which the other motors stay; None: home.  `margin`: distance [rad] of the
    poses from the motors' limits.  `seed`: of the random numbers.
    """
    rng = np.random.default_rng(seed)
    problem = Problem(model, costs, start, motors, margin)
    _, dense = lattice_poses(problem, task, spacing / FINER, rng, patience=GENEROUS)
    return np.concatenate([dense, _random_reachable(problem, task, spacing, rng)])


def coverage(points: Array, y: Array, spacing: Array) -> Coverage:
    """Return how well the vertices `y` (V, m) of a roadmap cover reachable task points.

    `points`: (P, m) reachable task points; the vertices are added to them, because they are reachable too.  `spacing`: distance between
    neighbouring vertices of the roadmap along each task coordinate, (m,).
    """
    points = np.concatenate([points, y])
    far, _ = cKDTree(y / spacing).query(points / spacing)
    return Coverage(points, np.asarray(far))


def valid(
    model: mobee.Model,
    costs: Sequence[Cost],
    task: Task,
    q: Array,
    y: Array,
    motors: Sequence[str] | None = None,
    start: Array | None = None,
) -> NDArray[np.bool_]:
    """Return for each pose `q` (V, n) rad whether it is valid, (V,).

    A valid pose meets the tolerances of all `costs`, and is within the motors' limits.  Its task coordinates are within the box of the task
    (the range of its coordinates), and are equal (to 1e-9) to its row of `y` (V, m).  Motors that are not in `motors` (None: all may move)
    are as in the pose `start` (None: home).  Contacts are computed by python-fcl, not by the compiled core.
    """
    reference = mobee.Model(solid_robot(model.robot), model.world, engine="fcl")
    pose = reference.evaluate(q)
    low, high = model.robot.limits.T
    good: NDArray[np.bool_] = ((q >= low) & (q <= high)).all(axis=1)
    there = task.of(pose)
    good &= (np.abs(there - y) <= 1e-9).all(axis=1) & ((there >= task.box[:, 0]) & (there <= task.box[:, 1])).all(axis=1)
    problem = Problem(model, costs, start, motors)
    good &= (np.delete(q - problem.start, problem.free, axis=1) == 0.0).all(axis=1)  # only the free motors moved
    for one in problem.terms:
        if one.tolerance is not None:
            good &= one.residual(pose) <= one.tolerance
    return good


def _random_reachable(problem: Problem, task: Task, spacing: Array, rng: np.random.Generator) -> Array:
    """Return those of 2000 random task points that the robot can reach, as reached task coordinates, (B, m).

    The points are uniform in the task's box (the range of its coordinates).  Least squares searches a pose for each point from 20 random
    starts; a point counts as reached if a start ends in a valid pose at most 0.05 spacings from it in each coordinate.
    """
    low, high = task.box.T
    points = np.repeat(rng.uniform(low, high, (RANDOM_POINTS, len(low))), STARTS, axis=0)
    ik = TaskIK(problem, task, MAX_OFFSET * spacing)
    _, there, wrong, _ = ik.solve(points, ik.random_starts(len(points), rng))
    met = np.flatnonzero(wrong == 0.0)
    _, once = np.unique(met // STARTS, return_index=True)
    found: Array = there[met[once]]
    return found


METHODS: tuple[Method, ...] = ("nes", "least_squares")
COSTS = {"nes": 15.0, "least_squares": 2.0}  # relative durations of cells
QUICK = ("inspect", "push-over", "unscrew")
SHEET_COLUMNS, HEIGHT = 4, 240  # panels; pixels of one

REACH = "reach"
NES, LEAST_SQUARES = "nes", "least_squares"
NAMES = {NES: "evolution", LEAST_SQUARES: "least squares"}
COVERED, LARGEST, SECONDS = 0.95, 120.0, 2.0  # share of the reachable task space; s by evolution; s by least squares, median
PREGRASP, MANY = "pregrasp", (4000, 6000)
COLUMNS = ("vertices", "processor_s", "evaluations_a_vertex", "coverage", "largest_hole", "valid", "kept", "free", "connected")

MEASURES = "measures.json"  # of all maps; to compute them takes the maps, which are large

Runs = Mapping[tuple[str, str], Mapping[str, Array]]  # the COLUMNS of the maps of a task and a method, (seeds,) each


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command-line options of this experiment to the parser."""
    sweep_arguments(parser, seeds=5)
    parser.add_argument("--tasks", nargs="+", choices=tuple(EXAMPLES), metavar="TASK", help=f"of {', '.join(EXAMPLES)}")


def cells(arguments: argparse.Namespace) -> list[Cell]:
    """Return the cells (pieces of work) of the experiment.

    For each task, one cell finds the task points that the robot can reach.  For each task, method and seed, one cell builds a roadmap.
    With --quick: three small tasks.
    """
    tasks = arguments.tasks or (QUICK if arguments.quick else tuple(EXAMPLES))
    seeds = range(arguments.seed, arguments.seed + arguments.seeds)
    reach = [Cell(f"{task}-{REACH}", arguments.seed, {"task": task, "method": REACH}, 20.0) for task in tasks]
    maps = [
        Cell(f"{task}-{method}-s{seed}", seed, {"task": task, "method": method}, COSTS[method])
        for task in tasks
        for method in METHODS
        for seed in seeds
    ]
    return [*reach, *maps]


def work(cell: Cell) -> dict[str, Any]:
    """Do the work of one cell: build and measure a roadmap, or find the task points that the robot can reach.

    Returns the map and its measures with the keys of `built`, or the reachable task points (R, m) under "points".
    """
    example, method = EXAMPLES[cell.settings["task"]](), cell.settings["method"]
    if method == REACH:
        spacing = np.broadcast_to(example.spacing, len(example.task.names)).astype(np.float64)
        return {"points": reachable(example.model, example.costs, example.task, spacing, example.motors, example.start, example.margin)}
    return built(example, method, cell.seed)


def run(arguments: argparse.Namespace, folder: Path) -> dict[str, Any]:
    """Build the roadmaps that are not in `folder` yet, write the measures of all maps there, and return the results.

    Raises NotInstalled without python-fcl.
    """
    importlib.import_module("mobee.model.fcl_engine")  # raises NotInstalled before anything is computed
    run_cells(work, cells(arguments), folder, arguments)
    measures: dict[str, dict[str, dict[str, list[float]]]] = {}
    for (task, method), columns in maps(load_cells(folder)).items():
        measures.setdefault(task, {})[method] = {name: values.tolist() for name, values in columns.items()}
    (folder / MEASURES).write_text(encoded(measures))
    return results(folder)


def results(folder: Path) -> dict[str, Any]:
    """Compute the results of all maps from the file of measures in `folder`, as `findings` returns them.

    Keys: "maps", the measures of the roadmaps, as text; "claims", a list with the judged claims, as dicts (`Claim.record`).
    """
    measures = json.loads((folder / MEASURES).read_text())
    return findings(
        {
            (task, method): {name: np.array(values, dtype=float) for name, values in measures[task][method].items()}
            for task in EXAMPLES
            for method in measures.get(task, {})
        }
    )


def built(example: Example, method: Method, seed: int) -> dict[str, Any]:
    """Build the roadmap of an example with this method ("nes" or "least_squares"), and return its measures and the map itself.

    Measures: "vertices" and "evaluations", numbers; "processor_s" and "wall_s"; "valid", share of valid poses; "kept", number of edges of
    the map, divided by the number of edges that join all vertices to their nearest neighbours; "free", share of edges without contact;
    "connected", share of vertices in the largest component.  The map: "q" (V, n) rad, "y" (V, m), "edges" (E, 2) and "spacing" (m,).
    `seed`: of the search.
    """
    start, wall = time.process_time(), time.perf_counter()
    roadmap = build(example, method, seed)
    wall, processor = time.perf_counter() - wall, time.process_time() - start
    good = valid(example.model, example.costs, example.task, roadmap.q, roadmap.y, example.motors, example.start)
    joined = nearest_before(roadmap.y, roadmap.spacing, len(roadmap.spacing))
    free = check_edges(example.model, roadmap.q, roadmap.edges)
    return {
        "vertices": len(roadmap.q),
        "evaluations": int(roadmap.settings["evaluations"]),
        "processor_s": processor,
        "wall_s": wall,
        "valid": float(good.mean()),
        "kept": len(roadmap.edges) / max(1, len(joined)),
        "free": float(np.mean(free)) if len(free) else 1.0,
        "connected": float((roadmap.graph.components == 0).mean()),
        "q": roadmap.q,
        "y": roadmap.y,
        "edges": roadmap.edges,
        "spacing": roadmap.spacing,
    }


def rebuilt(example: Example, values: Mapping[str, Any]) -> Roadmap:
    """Return the roadmap that `values`, a result of `built`, contains."""
    q, y, edges, spacing = (values[name] for name in ("q", "y", "edges", "spacing"))
    return Roadmap(example.model, q, y, edges, spacing, {"names": list(example.task.names)})


def findings(runs: Runs) -> dict[str, Any]:
    """Return the results of all maps.

    Keys: "maps", a dict from the task to a dict from the method to a dict from the measure to its estimate, as text; "claims", a list with
    the judged claims, as dicts (`Claim.record`).
    """
    table: dict[str, dict[str, dict[str, str]]] = {}
    for (task, method), columns in runs.items():
        table.setdefault(task, {})[NAMES[method]] = {name: estimate(values, _digits(name)) for name, values in columns.items()}
    return {"maps": table, "claims": judged(CLAIMS, runs, are_complete(runs))}


def maps(found: Cells) -> Runs:
    """Return a dict from (task, method) to the measures of these roadmaps: a dict from the name of a measure to its values, (seeds,).

    The names (COLUMNS) are "vertices"; "processor_s"; "evaluations_a_vertex"; "coverage", the share of the reachable task points that have
    a vertex within one spacing (the distance between neighbouring vertices); "largest_hole", the largest distance of such a point from its
    nearest vertex, as a multiple of the spacing; "valid", "kept", "free" and "connected" as in `built`.  "coverage" and "largest_hole" are
    NaN if the reachable points of the task are not known yet.
    """
    reach = {one.cell.settings["task"]: one.values["points"] for one in found.values() if one.cell.settings["method"] == REACH}
    built = sorted((one for one in found.values() if one.cell.settings["method"] != REACH), key=lambda one: one.cell.seed)
    runs: dict[tuple[str, str], dict[str, Array]] = {}
    for task in EXAMPLES:
        mine = [one for one in built if one.cell.settings["task"] == task]
        for method in NAMES:
            rows = [_row(one.values, _points(reach.get(task), mine, one)) for one in mine if one.cell.settings["method"] == method]
            if rows:
                runs[task, method] = {name: np.array([row[name] for row in rows]) for name in COLUMNS}
    return runs


def are_complete(runs: Runs) -> bool:
    """Whether there are maps of every task by both methods."""
    return set(product(EXAMPLES, NAMES)) <= set(runs)


@claim("thesis 3.4, figs. 3.1-3.11", f"maps for all 13 tasks: at least {COVERED:.0%} of the reachable task space covered", "figures only")
def maps_of_all(runs: Runs) -> Measured:
    """Judge whether the roadmaps of the tasks cover at least 95 % (COVERED) of the task points that the robot can reach.

    The task of figure 4.8 is left out.  Returns a text with the smallest coverage of each method, and the verdict.  The verdict depends
    only on the maps that were built by evolution ("nes"), the method of the thesis.
    """
    covered = {method: {task: float(runs[task, method]["coverage"].min()) for task in _figures()} for method in NAMES}
    return _least(covered), all(share >= COVERED for share in covered[NES].values())


@claim("thesis 3.3", "the task's constraints are built into the map: poses that meet all of them, by python-fcl", "all")
def meet_constraints(runs: Runs) -> Measured:
    sound = sum(float((one["valid"] * one["vertices"]).sum()) for one in runs.values())
    poses = sum(float(one["vertices"].sum()) for one in runs.values())
    return f"{sound:.0f} of {poses:.0f} poses", round(sound) == round(poses)


@claim("thesis 3.3", "a traversable graph: share of the poses in its largest connected part, smallest over all tasks", "all")
def traversable(runs: Runs) -> Measured:
    connected = {method: {task: float(runs[task, method]["connected"].min()) for task in EXAMPLES} for method in NAMES}
    return _least(connected), all(share == 1.0 for shares in connected.values() for share in shares.values())


@claim("thesis 4.3.3, fig. 4.8", "number of poses of the pre-grasp map", "approximately 5,000")
def size(runs: Runs) -> Measured:
    vertices = np.concatenate([runs[PREGRASP, method]["vertices"] for method in NAMES])
    return f"{vertices.min():.0f} to {vertices.max():.0f}", bool(MANY[0] <= vertices.min() and vertices.max() <= MANY[1])


@claim(OUR_AIM, "every other map by evolution within 2 minutes of processor time", f"at most {LARGEST:.0f} s")
def soon(runs: Runs) -> Measured:
    seconds = {task: float(runs[task, NES]["processor_s"].max()) for task in _figures()}
    slowest = max(seconds, key=lambda task: seconds[task])
    return f"at most {seconds[slowest]:.0f} s ({slowest})", seconds[slowest] <= LARGEST


CLAIMS = (maps_of_all, meet_constraints, traversable, size, soon)


def _figures() -> list[str]:
    return [task for task in EXAMPLES if task != PREGRASP]


def _least(shares: Mapping[str, Mapping[str, float]]) -> str:
    """Return a text with the smallest share of each method, in percent, and the task that has it.

    `shares`: a dict from the method to a dict from the task to a share, 0 to 1.
    """
    worst = {method: min(each.items(), key=lambda item: item[1]) for method, each in shares.items()}
    return "; ".join(f"{NAMES[method]}: at least {100.0 * share:.1f} % ({task})" for method, (task, share) in worst.items())


def _points(reach: Array | None, maps: Sequence[CellResult], own: CellResult) -> Array | None:
    """Return the task points (R, m) that the robot can reach: those that the search found, and the vertices of all maps except `own`.

    `reach`: the points of the search for reachable points; None: it has not ended, and None is returned.  `maps`: all maps of the task.
    """
    return None if reach is None else np.concatenate([reach, *(one.values["y"] for one in maps if one is not own)])


def _row(values: Mapping[str, Any], points: Array | None) -> dict[str, float]:
    row = {name: float(values[name]) for name in ("vertices", "processor_s", "valid", "kept", "free", "connected")}
    row["evaluations_a_vertex"] = values["evaluations"] / max(1, values["vertices"])
    known = None if points is None else coverage(points, values["y"], values["spacing"])
    row["coverage"], row["largest_hole"] = (np.nan, np.nan) if known is None else (known.share, known.largest_hole)
    return row


def _digits(column: str) -> int:
    return 0 if column in ("vertices", "evaluations_a_vertex") else 1 if column == "processor_s" else 3


def figure(folder: Path) -> Path:
    """Draw the marker positions of one map of every task as clouds of points, on one sheet in `folder`; returns the path of the sheet.

    Of each task, the map by evolution with the lowest seed is drawn; without such a map, the one by least squares.  Raises InvalidValue
    without maps.
    """
    found = load_cells(folder)
    finished = [one for one in found.values() if one.cell.settings["method"] != REACH]
    finished.sort(key=lambda one: (list(NAMES).index(one.cell.settings["method"]), one.cell.seed), reverse=True)
    chosen = {one.cell.settings["task"]: one for one in finished}
    tasks = [task for task in EXAMPLES if task in chosen]
    if not tasks:
        raise InvalidValue(f"{folder} has no maps: a record holds only their measures, or the run was stopped before the first.")
    panels = []
    for task in tasks:
        example = EXAMPLES[task]()
        panels.append(cloud_panel(example, rebuilt(example, chosen[task].values), HEIGHT))
    rows = [("", panels[first : first + SHEET_COLUMNS]) for first in range(0, len(panels), SHEET_COLUMNS)]
    return write_sheet(rows, folder / "figure.png")


EXPERIMENT = Experiment(
    claim="maps for all tasks of thesis figures 3.1 to 3.11 and 4.8: their poses valid, their task spaces covered",
    source="thesis 3.3, 3.4, 4.3",
    method=Steps(add_arguments, run, figure, results, (MEASURES,)),
    claims=CLAIMS,
)
