"""Pre-grasp: the hand over a table on which a cup was put after the map was made, with maps of growing density.

Claim: infeasible edges are found "when the back of the hand bumps into the object", the map is adapted and the path planned anew,
which "works well in practice"; but in a dense map "finding a path around a novel obstacle takes a very long time, because any
obstacle invalidates many, many edges".  Source: thesis 4.3.3, 4.4, figs. 4.8, 4.9.  Published: 5000 vertices, k = 8; no numbers of
bumps.  Run time: 5 minutes on 2 cores.

The map of figure 4.8 (torso and right arm, palm down 6 cm over the table, 8 nearest neighbours, no edge checked, by least squares) with
spacings from 4 cm to 8 mm: 170 to 4400 vertices.  Nothing is seen: of a query is known where it ends.  A cup, 10 cm high and 6 cm wide, is
put by the optimistic path, where another path is left.  The robot goes along the edges; a bump is the first edge on which
solids would touch, checked every millimetre; it is back where the edge began then, and the path is planned anew.  "edge": that edge is
taken out (thesis 4.2).  "around": ours, so are all that end within 3 cm of where it led, until nothing else is left.  The path found
after the bumps in the first query of each run is played by the offline plant under the default law.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import pairwise
from typing import Any

import numpy as np

from experiments.claims.ch3_roadmaps.trm_tasks import pregrasp as example
from experiments.kit.experiment import Claim, Experiment
from experiments.kit.plots import new_figure
from experiments.kit.roadmap_task import RIGHT, build
from experiments.kit.statistics import estimate, interquartile_mean, interval, rises
from experiments.kit.sweep import Cells, Condition, Sweep, grouped
from mobee import MobeeError, Model, Roadmap, World, cylinder
from mobee.arrays import Array, Ints
from mobee.roadmap.edges import check_edges
from mobee.roadmap.playback import play

SPACINGS = (0.04, 0.025, 0.016, 0.011, 0.008)  # m
QUERIES = 10
NEIGHBOURS = 8  # thesis 4.3.3
CUP, RADIUS, HEIGHT, TOP = "cup", 0.03, 0.10, -0.10  # m, of the cup and of the table
APART = 0.2  # m, at least, between start and goal
BESIDE = 0.01  # m: the cup stands that near to the optimistic path
AROUND = 0.03  # m, the radius within which "around" takes out edges
DRAWS = 300  # of one query
SPEED = 0.35  # rad/s, of the fastest motor on an edge
MODES = ("edge", "around")
WELL = 0.9  # of the queries that arrive

COMES_PAST = Claim("thesis 4.3.3", "re-planning on bumps works well in practice: the hand comes past a cup that no map has", "works well")
GROWS = Claim(
    "thesis 4.4", "an obstacle invalidates many edges of a dense map: bumps until success grow with its density", "a very long time"
)
FEWER = Claim(
    "aim of this reproduction", "taking out what lies around a bump, not the edge alone, needs fewer bumps in the densest map", "fewer"
)
CLAIMS = (COMES_PAST, GROWS, FEWER)

COLORS = {"edge": "tab:red", "around": "tab:blue"}
NAMES = {"edge": "the edge is taken out", "around": "so are those around it"}
LABELS = {"bumps": "bumps until success", "seconds": "robot time until success [s]"}


Edge = tuple[int, int]
Groups = dict[float, list[dict[str, Any]]]  # spacing -> values by seed, the widest first


def conditions(arguments: argparse.Namespace) -> list[Condition]:
    """Each density; the short version has two densities and two queries."""
    spacings, queries = (SPACINGS[:2], 2) if arguments.quick else (SPACINGS, QUERIES)
    return [
        Condition(f"d{1e3 * spacing:g}-q{queries}", {"spacing": spacing, "queries": queries}, (0.01 / spacing) ** 2 + 0.3)
        for spacing in spacings
    ]


def trial(settings: dict[str, Any], seed: int) -> dict[str, Any]:
    """Put cups on the table, and go past them; arrays (queries,) by "mode|number", and the size of the map."""
    roadmap = built(settings["spacing"])
    found: dict[str, Any] = {"vertices": len(roadmap.q), "edges": len(roadmap.edges)}
    drawn = [draw_query(np.random.default_rng([seed, number]), roadmap) for number in range(settings["queries"])]
    found["invalid"] = np.array([len(query.blocked) for query in drawn])
    for mode in MODES:
        walks = [walked(roadmap, query, mode) for query in drawn]
        for name in ("arrived", "bumps", "edges", "seconds"):
            found[f"{mode}|{name}"] = np.array([getattr(walk, name) for walk in walks])
        if mode == MODES[0]:
            found |= _played(roadmap, drawn, walks)
    return found


@dataclass(frozen=True, slots=True, eq=False)
class Query:
    """From a vertex to another, in the world with the cup; `blocked`: the edges on which solids would touch it."""

    start: int
    goal: int
    model: Model
    blocked: frozenset[Edge]


@dataclass(frozen=True, slots=True)
class Walk:
    """The result of a query: the vertices passed, bumps, edges begun, and s of motion; `arrived`: False if no path was left."""

    path: tuple[int, ...]
    arrived: bool
    bumps: int
    edges: int
    seconds: float


@lru_cache(maxsize=2)
def built(spacing: float) -> Roadmap:
    """The pre-grasp map with that spacing [m], each pose joined to its 8 nearest, no edge checked."""
    made = replace(example(), spacing=spacing)
    return build(made, "least_squares", neighbours=NEIGHBOURS)


def draw_query(rng: np.random.Generator, roadmap: Roadmap) -> Query:
    """Draw two vertices, and a cup by the optimistic path between them that leaves another path; raises MobeeError if none is found."""
    places = roadmap.model.evaluate(roadmap.q).position(RIGHT)[:, :2]
    for _ in range(DRAWS):
        start, goal = (int(vertex) for vertex in rng.integers(len(places), size=2))
        path = roadmap.graph.shortest(start, goal)
        if path is None or np.linalg.norm(places[start] - places[goal]) < APART:
            continue
        cup = places[path[int(rng.integers(len(path)))]] + rng.uniform(-BESIDE, BESIDE, 2)
        model = Model(roadmap.model.robot, _with_cup(cup))
        if np.asarray(model.evaluate(roadmap.q[[start, goal]]).count).any():
            continue
        # Without the cup some edges touch something, too: what counts is which do in this world.
        touching = roadmap.edges[~check_edges(model, roadmap.q, roadmap.edges)]
        blocked = frozenset((a, b) for a, b in touching.tolist())
        if not _is_free(path, blocked) and roadmap.graph.shortest(start, goal, blocked) is not None:
            return Query(start, goal, model, blocked)
    raise MobeeError(f"no query past a cup in {DRAWS} draws: take another seed.")


def walked(roadmap: Roadmap, query: Query, mode: str) -> Walk:
    """Follow the shortest path of edges that were not taken out; at a bump go back to where the edge began, and plan anew.

    `mode` "edge": the edge is taken out (thesis 4.2); "around": all edges that end within AROUND of where it led, but for those that
    were passed; if no path is left, those that did not bump themselves are tried.
    """
    out: set[Edge] = set()
    bumped: set[Edge] = set()
    passed: set[Edge] = set()
    here, trail, edges, seconds = query.start, [query.start], 0, 0.0
    path: list[int] | None = None
    while here != query.goal:
        if path is None:
            path = roadmap.graph.shortest(here, query.goal, out) or roadmap.graph.shortest(here, query.goal, bumped)
            if path is None:
                return Walk(tuple(trail), False, len(bumped), edges, seconds)
        following = path[path.index(here) + 1]
        edge = (min(here, following), max(here, following))
        takes = float(np.abs(roadmap.q[here] - roadmap.q[following]).max()) / SPEED
        edges, seconds = edges + 1, seconds + takes  # a bump: half of it there, half of it back
        if edge in query.blocked:
            bumped.add(edge)
            out |= {edge} if mode == "edge" else _around(roadmap, following) - passed
            out |= bumped
            path = None
        else:
            passed.add(edge)
            here = following
            trail.append(here)
    return Walk(tuple(trail), True, len(bumped), edges, seconds)


def _around(roadmap: Roadmap, vertex: int) -> set[Edge]:
    """The edges that end near the palm's place at a vertex."""
    near = np.linalg.norm(roadmap.y - roadmap.y[vertex], axis=1) <= AROUND
    touched: Ints = roadmap.edges[near[roadmap.edges].any(axis=1)]
    return {(a, b) for a, b in touched.tolist()}


def _played(roadmap: Roadmap, queries: list[Query], walks: list[Walk]) -> dict[str, Any]:
    """The path around the cup of the first query under the control law: the palm's error at its end, and the deepest solid contact [m]."""
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
    """A row a density and mode, and the claims."""
    groups = grouped(found, "spacing", SPACINGS)
    rows = [
        {"vertices": runs[0]["vertices"], "spacing_mm": 1e3 * spacing, "taken out": mode, "seeds": len(runs)}
        | {"invalid edges": estimate([float(np.mean(values["invalid"])) for values in runs], 0)}
        | {name: estimate(numbers(runs, mode, name)) for name in ("arrived", "bumps", "edges", "seconds")}
        for spacing, runs in groups.items()
        for mode in MODES
    ]
    return {"maps": rows, "played": _of_played(groups), "claims": [claim.record() for claim in measured(groups)]}


def numbers(runs: list[dict[str, Any]], mode: str, name: str) -> Array:
    """The mean over the queries of each run, (n,)."""
    return np.array([float(np.mean(values[f"{mode}|{name}"])) for values in runs])


def _of_played(groups: Groups) -> dict[str, Any]:
    """The paths followed under the control law: how many, the deepest solid contact, the distance of the palm at the end."""
    every = [values for runs in groups.values() for values in runs if np.isfinite(values["solid"])]
    if not every:
        return {"ways": 0}
    solid, off = (np.array([values[name] for values in every]) for name in ("solid", "off"))
    return {
        "ways": len(every),
        "without a solid contact": int((solid == 0.0).sum()),
        "deepest_mm": 1e3 * float(solid.max()),
        "palm_off_cm": estimate(100.0 * off, 1),
    }


def measured(groups: Groups) -> list[Claim]:
    """The claims with our numbers; open with one density alone."""
    if len(groups) < 2:
        return list(CLAIMS)
    first, *_, last = groups.values()
    seeds = range(min(map(len, groups.values())))
    everything = [float(np.mean([numbers(runs, "edge", "arrived")[seed] for runs in groups.values()])) for seed in seeds]
    bumps = ", ".join(f"{runs[0]['vertices']}: {estimate(numbers(runs, 'edge', 'bumps'), 1)}" for runs in groups.values())
    few, many, around = (numbers(runs, mode, "bumps") for runs, mode in ((first, "edge"), (last, "edge"), (last, "around")))
    return [
        COMES_PAST.measured(f"{estimate(everything)} of all queries arrive", float(np.mean(everything)) >= WELL),
        GROWS.measured(f"bumps a query by vertices {bumps}", _above(interval(many), interval(few))),
        FEWER.measured(
            f"{estimate(around, 1)} instead of {estimate(many, 1)} bumps with {last[0]['vertices']} vertices",
            rises(many - around),
        ),
    ]


def _above(one: tuple[float, float], other: tuple[float, float]) -> bool | None:
    """Whether an interval lies above another one; None where they overlap."""
    if one[0] > other[1]:
        return True
    return False if one[1] < other[0] else None


def plot(found: Cells) -> Any:
    """Edges that the cup invalidates, bumps, and time until success against the density of the map (thesis 4.4)."""
    groups = grouped(found, "spacing", SPACINGS)
    vertices = [runs[0]["vertices"] for runs in groups.values()]
    drawing = new_figure(12.0, 3.6)
    first, *others = drawing.subplots(1, 3)
    first.plot(vertices, [np.mean([values["invalid"].mean() for values in runs]) for runs in groups.values()], ".-", color="0.3")
    first.set(ylabel="edges that the cup invalidates", yscale="log")
    for axes, (name, label) in zip(others, LABELS.items(), strict=True):
        for mode in MODES:
            rows = [numbers(runs, mode, name) for runs in groups.values()]
            axes.plot(vertices, [interquartile_mean(row) for row in rows], ".-", color=COLORS[mode], label=NAMES[mode])
            low, high = np.array([interval(row) for row in rows]).T
            axes.fill_between(vertices, low, high, color=COLORS[mode], alpha=0.15, linewidth=0.0)
        axes.set(ylabel=label, ylim=(0.0, None))
        axes.legend(fontsize=8)
    for axes in (first, *others):
        axes.set(xlabel="vertices of the map", xscale="log")
        axes.set_xticks(vertices, labels=[str(count) for count in vertices])
        axes.minorticks_off()
        axes.grid(alpha=0.2)
    return drawing


EXPERIMENT = Experiment(
    name="roadmap-density",
    claim="bumps adapt a map to things that were put on the table; the denser the map, the more of them it takes",
    source="thesis 4.3.3, 4.4",
    notes=__doc__,
    method=Sweep(conditions, trial, findings, plot),
    claims=CLAIMS,
)
