# SPDX-License-Identifier: Apache-2.0
"""Replan around a cup that was put on the table after the roadmap was built, in roadmaps of growing density.

Claim: infeasible edges are found "when the back of the hand bumps into the object"; the map is adapted and the path replanned, which "works
well in practice".  But in a dense map "finding a path around a novel obstacle takes a very long time, because any obstacle invalidates
many, many edges".  Source: thesis 4.3.3, 4.4, figs. 4.8, 4.9.  Published: 5000 vertices, k = 8; no numbers of bumps.
Run time: 5 minutes on 2 cores.

The roadmap is that of figure 4.8.  Its vertices are poses of torso and right arm with the palm down, 6 cm over the table, found by least
squares.  Each has edges to its 8 nearest neighbours, which are not checked for contacts.  Spacings from 4 cm to 8 mm give 170 to 4400
vertices.  A query goes from one vertex to another.  The robot sees nothing.  A cup, 10 cm high and 6 cm wide, stands beside the shortest
path, where another path remains.  The robot follows the edges of its path.  A bump occurs on the first edge on which solids would touch,
checked every millimetre; then the robot moves back to the beginning of that edge and plans again.  There are two modes.  "edge": the edge
is removed (thesis 4.2).  "around" (ours): all edges with an end within 3 cm of the far end of that edge are removed as well, as long as a
path remains.  In the first query of each run, the offline plant under the default law follows a path around the cup.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import pairwise
from typing import Any

import numpy as np

from experiments.claims.ch3_roadmaps.trm_tasks import pregrasp as example
from experiments.kit.experiment import OUR_AIM, Experiment, Measured, claim, judged
from experiments.kit.plots import draw_band, finish, new_figure, ticks_at
from experiments.kit.roadmap_task import RIGHT, build
from experiments.kit.rules import is_above, rises, texts, within
from experiments.kit.statistics import estimate
from experiments.kit.sweep import Cells, Condition, Sweep, grouped
from mobee import MobeeError, Model, Roadmap, World, cylinder
from mobee.arrays import Array, Ints
from mobee.roadmap.edges import check_edges
from mobee.roadmap.playback import play

SPACINGS = (0.04, 0.025, 0.016, 0.011, 0.008)  # m, between the poses of a roadmap
QUERIES = 10
NEIGHBOURS = 8  # thesis 4.3.3
CUP, RADIUS, HEIGHT, TOP = "cup", 0.03, 0.10, -0.10  # m, of the cup and of the table
MIN_DISTANCE = 0.2  # m, between start and goal
CUP_OFFSET = 0.01  # m, largest distance of the cup from a vertex of the shortest path, in x and y
AROUND = 0.03  # m, the radius within which "around" removes edges
DRAWS = 300  # attempts to draw one query
SPEED = 0.35  # rad/s, of the fastest motor on an edge
MODES = ("edge", "around")
MIN_SUCCESS = 0.9  # share of queries that reach the goal, from which replanning "works well"

COLORS = {"edge": "tab:red", "around": "tab:blue"}
NAMES = {"edge": "removes one edge per bump", "around": "removes all edges around a bump"}
LABELS = {"bumps": "bumps until success", "seconds": "robot time until success [s]"}
ROW = {"arrived": "share of queries that succeed", "bumps": "bumps", "edges": "edges begun", "seconds": "robot time [s]"}


Edge = tuple[int, int]
Groups = dict[float, list[dict[str, Any]]]  # spacing -> values by seed, the widest first


def conditions(arguments: argparse.Namespace) -> list[Condition]:
    """Return the settings of the runs: one for each spacing of the roadmap.

    With --quick there are two spacings, and two queries instead of ten.
    """
    spacings, queries = (SPACINGS[:2], 2) if arguments.quick else (SPACINGS, QUERIES)
    return [
        Condition(f"d{1e3 * spacing:g}-q{queries}", {"spacing": spacing, "queries": queries}, (0.01 / spacing) ** 2 + 0.3)
        for spacing in spacings
    ]


def trial(settings: dict[str, Any], seed: int) -> dict[str, Any]:
    """Put a cup beside the path of each query, and plan around it after bumps, once with each mode of removing edges.

    Returns the numbers of `vertices` and `edges` of the roadmap; `invalid` (queries,), the number of edges on which solids would touch in
    the world with the cup; and arrays (queries,) with keys "mode|measure".  The modes are "edge" and "around", as in `walked`; the measures
    "arrived", "bumps", "edges" and "seconds", as in `Walk`.  The plant executes the path around the cup in the first query: `off` is the
    distance of the palm from its planned position at the end, `solid` the depth of the deepest contact of solids, both in m; NaN if there
    is no such path.  `settings`: "spacing", distance of the roadmap's vertices [m]; "queries", their number.  `seed`: of the queries.
    """
    roadmap = built(settings["spacing"])
    found: dict[str, Any] = {"vertices": len(roadmap.q), "edges": len(roadmap.edges)}
    drawn = [draw_query(np.random.default_rng([seed, number]), roadmap) for number in range(settings["queries"])]
    found["invalid"] = np.array([len(query.blocked) for query in drawn])
    for mode in MODES:
        walks = [walked(roadmap, query, mode) for query in drawn]
        for name in ("arrived", "bumps", "edges", "seconds"):
            found[f"{mode}|{name}"] = np.array([getattr(walk, name) for walk in walks])
        if mode == MODES[0]:
            found |= _executed(roadmap, drawn, walks)
    return found


@dataclass(frozen=True, slots=True, eq=False)
class Query:
    """A query from one vertex of the roadmap to another.

    `model`: robot and world with the cup.  `blocked`: edges, as pairs of vertices, on which solids would touch.
    """

    start: int
    goal: int
    model: Model
    blocked: frozenset[Edge]


@dataclass(frozen=True, slots=True)
class Walk:
    """The result of a query.

    `path`: vertices that were passed, from start to end.  `arrived`: False if no path to the goal remained.  `bumps`: number of bumps.
    `edges`: number of edges begun.  `seconds`: duration of the motion.
    """

    path: tuple[int, ...]
    arrived: bool
    bumps: int
    edges: int
    seconds: float


@lru_cache(maxsize=2)
def built(spacing: float) -> Roadmap:
    """Build the pre-grasp roadmap; each pose is joined to its 8 nearest, and no edge is checked for contacts.

    `spacing`: distance of the palm between neighbouring poses [m].
    """
    return build(replace(example(), spacing=spacing), "least_squares", neighbours=NEIGHBOURS)


def draw_query(rng: np.random.Generator, roadmap: Roadmap) -> Query:
    """Draw two vertices, and a cup that blocks the shortest path between them, but leaves another path.

    Raises MobeeError if none is found in 300 draws.
    """
    places = roadmap.model.evaluate(roadmap.q).position(RIGHT)[:, :2]
    for _ in range(DRAWS):
        start, goal = (int(vertex) for vertex in rng.integers(len(places), size=2))
        path = roadmap.graph.shortest(start, goal)
        if path is None or np.linalg.norm(places[start] - places[goal]) < MIN_DISTANCE:
            continue
        cup = places[path[int(rng.integers(len(path)))]] + rng.uniform(-CUP_OFFSET, CUP_OFFSET, 2)
        model = Model(roadmap.model.robot, _with_cup(cup))
        if np.asarray(model.evaluate(roadmap.q[[start, goal]]).count).any():
            continue
        # Some edges touch something even without the cup; they count as blocked too.
        touching = roadmap.edges[~check_edges(model, roadmap.q, roadmap.edges)]
        blocked = frozenset((a, b) for a, b in touching.tolist())
        if not _is_free(path, blocked) and roadmap.graph.shortest(start, goal, blocked) is not None:
            return Query(start, goal, model, blocked)
    raise MobeeError(f"no query with a cup beside its path was found in {DRAWS} draws: use another seed.")


def walked(roadmap: Roadmap, query: Query, mode: str) -> Walk:
    """Follow the shortest path of the remaining edges; after a bump move back to the beginning of the edge, and plan again.

    `mode` "edge": a bump removes its edge (thesis 4.2).  "around": it also removes all edges with an end within 3 cm (distance of the palm)
    of the far end of that edge, but not those that the robot has already followed without a bump.  If this leaves no path, the path may use
    all edges on which no bump occurred.
    """
    removed: set[Edge] = set()
    bumped: set[Edge] = set()
    passed: set[Edge] = set()
    here, trail, edges, seconds = query.start, [query.start], 0, 0.0
    path: list[int] | None = None
    while here != query.goal:
        if path is None:
            path = roadmap.graph.shortest(here, query.goal, removed) or roadmap.graph.shortest(here, query.goal, bumped)
            if path is None:
                return Walk(tuple(trail), False, len(bumped), edges, seconds)
        following = path[path.index(here) + 1]
        edge = (min(here, following), max(here, following))
        duration = float(np.abs(roadmap.q[here] - roadmap.q[following]).max()) / SPEED
        edges, seconds = edges + 1, seconds + duration  # a bump, on average in the middle of the edge, takes as long: half of it back
        if edge in query.blocked:
            bumped.add(edge)
            removed |= {edge} if mode == "edge" else _around(roadmap, following) - passed
            removed |= bumped
            path = None
        else:
            passed.add(edge)
            here = following
            trail.append(here)
    return Walk(tuple(trail), True, len(bumped), edges, seconds)


def _around(roadmap: Roadmap, vertex: int) -> set[Edge]:
    """Return the edges with at least one end near a vertex: the palm is at most AROUND [m] from its position at this vertex."""
    near = np.linalg.norm(roadmap.y - roadmap.y[vertex], axis=1) <= AROUND
    touched: Ints = roadmap.edges[near[roadmap.edges].any(axis=1)]
    return {(a, b) for a, b in touched.tolist()}


def _executed(roadmap: Roadmap, queries: list[Query], walks: list[Walk]) -> dict[str, Any]:
    """Execute the path of the first query around its cup, and return two results of `trial`, "off" and "solid", both in m.

    "off" is the distance of the palm from its planned position at the end, "solid" the depth of the deepest contact of solids; NaN if there
    is no path to the goal.
    """
    query, walk = queries[0], walks[0]
    path = roadmap.graph.shortest(query.start, query.goal, query.blocked) if walk.arrived else None
    if path is None:
        return {"off": np.nan, "solid": np.nan}
    found = play(query.model, roadmap.q[path])
    ends = roadmap.model.evaluate(np.stack([found.q[-1], roadmap.q[query.goal]])).position(RIGHT)
    return {"off": float(np.linalg.norm(ends[0] - ends[1])), "solid": float(found.solid.max())}


def _with_cup(where: Array) -> World:
    world = example().model.world
    world.add(CUP, cylinder(RADIUS, HEIGHT), position=(*where, TOP + 0.5 * HEIGHT))
    return world


def _is_free(path: list[int], blocked: frozenset[Edge]) -> bool:
    return not any((min(a, b), max(a, b)) in blocked for a, b in pairwise(path))


def findings(found: Cells) -> dict[str, Any]:
    """Return the results as a dict with three keys, "roadmaps", "executed" and "claims".

    "roadmaps" is a list with a row for each spacing and mode of removing edges: numbers of vertices, blocked edges and runs, and the
    measures (share of successful queries, bumps, edges begun, robot time).  "executed" is a dict with the number of executed "paths", their
    solid contacts, and the error of the palm at the end [cm].  "claims" is a list with the claims, their measured values and their
    verdicts, as dicts (`Claim.record`).  With runs of one spacing only, all claims stay unmeasured and are not judged.
    """
    groups = grouped(found, "spacing", SPACINGS)
    rows = [
        {"vertices": runs[0]["vertices"], "spacing [mm]": 1e3 * spacing, "after a bump": NAMES[mode], "seeds": len(runs)}
        | {"edges that the cup blocks": estimate([float(np.mean(values["invalid"])) for values in runs], 0)}
        | {label: estimate(numbers(runs, mode, name)) for name, label in ROW.items()}
        for spacing, runs in groups.items()
        for mode in MODES
    ]
    return {"roadmaps": rows, "executed": _of_executed(groups), "claims": judged(CLAIMS, groups, len(groups) > 1)}


def numbers(runs: list[dict[str, Any]], mode: str, name: str) -> Array:
    """Return the mean of a measure over the queries of each run, (runs,).

    `mode`: "edge" (after a bump, a contact on an edge, this edge is removed) or "around" (the edges near it are removed too).  `name`:
    "arrived", whether the goal was reached; "bumps", number of bumps; "edges", number of edges begun; or "seconds", duration of the motion.
    """
    return np.array([float(np.mean(values[f"{mode}|{name}"])) for values in runs])


def _of_executed(groups: Groups) -> dict[str, Any]:
    """Summarise the paths that were executed: their number, the deepest solid contact, and the error of the palm at the end."""
    every = [values for runs in groups.values() for values in runs if np.isfinite(values["solid"])]
    if not every:
        return {"paths": 0}
    solid, off = (np.array([values[name] for values in every]) for name in ("solid", "off"))
    return {
        "paths": len(every),
        "paths without a solid contact": int((solid == 0.0).sum()),
        "deepest solid contact [mm]": 1e3 * float(solid.max()),
        "error of the palm at the end [cm]": estimate(100.0 * off, 1),
    }


@claim(
    "thesis 4.3.3",
    "replanning after bumps works well in practice: in at least 0.9 of the queries the hand gets around a cup that the roadmap does not "
    "contain",
    "works well",
)
def comes_past(groups: Groups) -> Measured:
    seeds = min(map(len, groups.values()))
    everything = np.mean([numbers(runs, "edge", "arrived")[:seeds] for runs in groups.values()], axis=0)
    return within(everything, least=MIN_SUCCESS, text="{} of all queries reach their goal")


@claim(
    "thesis 4.4",
    "an obstacle invalidates many edges of a dense roadmap: the number of bumps until success grows with density",
    "a very long time",
)
def grows(groups: Groups) -> Measured:
    """Return the numbers of bumps as text, and whether the densest roadmap needs more bumps than the sparsest one."""
    bumps = {runs[0]["vertices"]: numbers(runs, "edge", "bumps") for runs in groups.values()}
    sparsest, *_, densest = bumps.values()
    return f"bumps per query, by number of vertices: {texts(bumps, 1, '{}: {}')}", is_above(densest, sparsest)


@claim(OUR_AIM, "removing all edges around a bump, not only one, needs fewer bumps in the densest roadmap", "fewer")
def fewer(groups: Groups) -> Measured:
    *_, last = groups.values()
    many, around = (numbers(last, mode, "bumps") for mode in MODES)
    text = f"{estimate(around, 1)} instead of {estimate(many, 1)} bumps with {last[0]['vertices']} vertices"
    return text, rises(many - around)


CLAIMS = (comes_past, grows, fewer)


def plot(found: Cells) -> Any:
    """Draw blocked edges, bumps and robot time until success over the number of vertices of the roadmap (thesis 4.4).

    Returns a matplotlib figure.
    """
    groups = grouped(found, "spacing", SPACINGS)
    vertices = [runs[0]["vertices"] for runs in groups.values()]
    drawing = new_figure(12.0, 3.6)
    first, *others = drawing.subplots(1, 3)
    first.plot(vertices, [np.mean([values["invalid"].mean() for values in runs]) for runs in groups.values()], ".-", color="0.3")
    first.set(ylabel="edges that the cup blocks", yscale="log")
    for axes, (name, label) in zip(others, LABELS.items(), strict=True):
        for mode in MODES:
            draw_band(axes, vertices, [numbers(runs, mode, name) for runs in groups.values()], ".-", COLORS[mode], label=NAMES[mode])
        axes.set(ylabel=label, ylim=(0.0, None))
        axes.legend(fontsize=8)
    for axes in (first, *others):
        finish(axes, xlabel="vertices of the roadmap", xscale="log")
        ticks_at(axes, vertices)
    return drawing


EXPERIMENT = Experiment(
    claim="bumps adapt a roadmap to objects that were put on the table later; the denser the roadmap, the more bumps are needed",
    source="thesis 4.3.3, 4.4",
    method=Sweep(conditions, trial, findings, plot),
    claims=CLAIMS,
)
