"""Queries past a cup that the map knows nothing of."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np

from experiments.claims.ch3_roadmaps.trm_tasks import pregrasp as example
from experiments.kit.roadmap_task import RIGHT, build
from mobee import MobeeError, Model, Roadmap, World, cylinder
from mobee.roadmap.edges import check_edges
from mobee.roadmap.playback import play
from mobee.robot.robot import Array, Ints

NEIGHBOURS = 8  # thesis 4.3.3
CUP, RADIUS, HEIGHT, TOP = "cup", 0.03, 0.10, -0.10  # m, of the cup and of the table
APART = 0.2  # m, at least, between start and goal
BESIDE = 0.01  # m: the cup stands that near to the optimistic way
AROUND = 0.03  # m: what "around" takes out about a bump
DRAWS = 300  # of one query
SPEED = 0.35  # rad/s, of the fastest motor on an edge
MODES = ("edge", "around")
Edge = tuple[int, int]


@dataclass(frozen=True, slots=True, eq=False)
class Query:
    """From a vertex to another, in the world with the cup; `blocked`: the edges on which solids would touch it."""

    start: int
    goal: int
    model: Model
    blocked: frozenset[Edge]


@dataclass(frozen=True, slots=True)
class Walk:
    """How a query went: the vertices passed, bumps, edges begun, and s of motion; `arrived`: False: no way was left."""

    way: tuple[int, ...]
    arrived: bool
    bumps: int
    edges: int
    seconds: float


@lru_cache(maxsize=2)
def built(spacing: float) -> Roadmap:
    """The pre-grasp map with that spacing [m], each pose joined to its 8 nearest, no edge checked."""
    made = replace(example(), spacing=spacing)
    return build(made, "least_squares", neighbours=NEIGHBOURS)


def queried(seed: int, spacing: float, queries: int) -> dict[str, Any]:
    """What became of every query, (queries,) by "mode|number"; how many vertices and edges there are."""
    roadmap = built(spacing)
    found: dict[str, Any] = {"vertices": len(roadmap.q), "edges": len(roadmap.edges)}
    drawn = [draw_query(np.random.default_rng([seed, number]), roadmap) for number in range(queries)]
    found["invalid"] = np.array([len(query.blocked) for query in drawn])
    for mode in MODES:
        walks = [walked(roadmap, query, mode) for query in drawn]
        for name in ("arrived", "bumps", "edges", "seconds"):
            found[f"{mode}|{name}"] = np.array([getattr(walk, name) for walk in walks])
        if mode == MODES[0]:
            found |= _played(roadmap, drawn, walks)
    return found


def draw_query(rng: np.random.Generator, roadmap: Roadmap) -> Query:
    """Two vertices, and a cup by the optimistic way between them that leaves another way; raises MobeeError if none is found."""
    places = roadmap.model.evaluate(roadmap.q).position(RIGHT)[:, :2]
    for _ in range(DRAWS):
        start, goal = (int(vertex) for vertex in rng.integers(len(places), size=2))
        way = roadmap.graph.shortest(start, goal)
        if way is None or np.linalg.norm(places[start] - places[goal]) < APART:
            continue
        cup = places[way[int(rng.integers(len(way)))]] + rng.uniform(-BESIDE, BESIDE, 2)
        model = Model(roadmap.model.robot, _with_cup(cup))
        if np.asarray(model.evaluate(roadmap.q[[start, goal]]).count).any():
            continue
        # Without the cup some edges touch something, too: what counts is which do in this world.
        touching = roadmap.edges[~check_edges(model, roadmap.q, roadmap.edges)]
        blocked = frozenset((a, b) for a, b in touching.tolist())
        if not _is_free(way, blocked) and roadmap.graph.shortest(start, goal, blocked) is not None:
            return Query(start, goal, model, blocked)
    raise MobeeError(f"no query past a cup in {DRAWS} draws: take another seed.")


def walked(roadmap: Roadmap, query: Query, mode: str) -> Walk:
    """Go along the shortest way of all that was not taken out; at a bump go back to where the edge began, and plan anew.

    `mode` "edge": the edge is taken out (thesis 4.2); "around": all edges that end within AROUND of where it led, but for those that
    were passed; what of these is needed after all is tried when nothing else is left.
    """
    out: set[Edge] = set()
    bumped: set[Edge] = set()
    passed: set[Edge] = set()
    here, trail, edges, seconds = query.start, [query.start], 0, 0.0
    way: list[int] | None = None
    while here != query.goal:
        if way is None:
            way = roadmap.graph.shortest(here, query.goal, out) or roadmap.graph.shortest(here, query.goal, bumped)
            if way is None:
                return Walk(tuple(trail), False, len(bumped), edges, seconds)
        following = way[way.index(here) + 1]
        edge = (min(here, following), max(here, following))
        takes = float(np.abs(roadmap.q[here] - roadmap.q[following]).max()) / SPEED
        edges, seconds = edges + 1, seconds + takes  # a bump: half of it there, half of it back
        if edge in query.blocked:
            bumped.add(edge)
            out |= {edge} if mode == "edge" else _around(roadmap, following) - passed
            out |= bumped
            way = None
        else:
            passed.add(edge)
            here = following
            trail.append(here)
    return Walk(tuple(trail), True, len(bumped), edges, seconds)


def _around(roadmap: Roadmap, vertex: int) -> set[Edge]:
    """The edges that end near where a vertex has the palm."""
    near = np.linalg.norm(roadmap.y - roadmap.y[vertex], axis=1) <= AROUND
    touched: Ints = roadmap.edges[near[roadmap.edges].any(axis=1)]
    return {(a, b) for a, b in touched.tolist()}


def _played(roadmap: Roadmap, queries: list[Query], walks: list[Walk]) -> dict[str, Any]:
    """The way round the cup of the first query under the control law: how far off the palm ends, and the deepest solid contact [m]."""
    query, walk = queries[0], walks[0]
    way = roadmap.graph.shortest(query.start, query.goal, query.blocked) if walk.arrived else None
    if way is None:
        return {"off": np.nan, "solid": np.nan}
    found = play(query.model, roadmap.q[way])
    ends = roadmap.model.evaluate(np.stack([found.q[-1], roadmap.q[query.goal]])).position(RIGHT)
    return {"off": float(np.linalg.norm(ends[0] - ends[1])), "solid": float(found.solid.max())}


def _with_cup(where: Array) -> World:
    world = example().model.world
    world.add(CUP, cylinder(RADIUS, HEIGHT), position=(*where, TOP + 0.5 * HEIGHT))
    return world


def _is_free(way: list[int], blocked: frozenset[Edge]) -> bool:
    return not any((min(a, b), max(a, b)) in blocked for a, b in zip(way, way[1:], strict=False))
