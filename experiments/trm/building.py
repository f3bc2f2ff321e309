"""Builds the map of an example, and says how long that took, what it covers and whether it is sound."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Literal

import numpy as np

import mobee
from experiments.trm.coverage import valid
from experiments.trm.example import Example
from mobee.roadmap.building.build import LONGEST
from mobee.roadmap.edges import check_edges
from mobee.roadmap.neighbours import nearest_before
from mobee.roadmap.roadmap import Roadmap

Method = Literal["nes", "least_squares", "hybrid"]
METHODS: tuple[Method, ...] = ("nes", "least_squares")


def build(
    example: Example,
    method: Method,
    seed: int = 0,
    file: Path | None = None,
    progress: Callable[[Any], None] | None = None,
    neighbours: int | None = None,
    longest: float | None = LONGEST,
) -> Roadmap:
    """The map of an example."""
    return mobee.build_roadmap(
        example.model,
        costs=list(example.costs),
        task=example.task,
        spacing=example.spacing,
        start=example.start,
        motors=list(example.motors),
        margin=example.margin,
        method=method,
        seed=seed,
        neighbours=neighbours,
        longest=longest,
        file=file,
        progress=progress,
    )


def built(example: Example, method: Method, seed: int) -> dict[str, Any]:
    """A map, all its numbers, and the map itself as arrays."""
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
    """The map of what `built` returned."""
    arrays = (values[name] for name in ("q", "y", "edges", "spacing"))
    return Roadmap(example.model, *arrays, {"names": list(example.task.names)})
