"""What the maps say: a row a task and method, and the claims."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from experiments.kit.cells import CellResult
from experiments.kit.claims import Claim
from experiments.kit.statistics import told
from experiments.trm.coverage import coverage
from experiments.trm.examples import EXAMPLES
from mobee.robot.robot import Array

REACH = "reach"
NES, LEAST_SQUARES = "nes", "least_squares"
NAMES = {NES: "evolution", LEAST_SQUARES: "least squares"}
COVERED, LARGEST, SECONDS = 0.95, 120.0, 2.0  # share of the reachable task space; s by evolution; s by least squares, median
PREGRASP, MANY = "pregrasp", (4000, 6000)
COLUMNS = ("vertices", "processor_s", "evaluations_a_vertex", "coverage", "largest_hole", "valid", "kept", "free", "connected")

MAPS = Claim(
    "thesis 3.4, figs. 3.1-3.11", f"maps for all 13 tasks: at least {COVERED:.0%} of the reachable task space covered", "figures only"
)
VALID = Claim("thesis 3.3", "the task's constraints are built into the map: poses that meet all of them, by python-fcl", "all")
GRAPH = Claim("thesis 3.3", "a traversable graph: share of the poses in its largest connected part, least of all tasks", "all")
SIZE = Claim("thesis 4.3.3, fig. 4.8", "the pre-grasp map: so many poses", "approximately 5,000")
SOON = Claim("aim of this reproduction", "every other map by evolution within 2 minutes of processor time", f"at most {LARGEST:.0f} s")
CLAIMS = (MAPS, VALID, GRAPH, SIZE, SOON)

Key = tuple[str, str]  # task and method


def findings(found: Mapping[str, CellResult]) -> dict[str, Any]:
    """The table, and the claims."""
    runs = maps(found)
    table: dict[str, dict[str, dict[str, str]]] = {}
    for (task, method), columns in runs.items():
        table.setdefault(task, {})[NAMES[method]] = {name: told(values, _digits(name)) for name, values in columns.items()}
    return {"maps": table, "claims": [claim.record() for claim in judged(runs)]}


def maps(found: Mapping[str, CellResult]) -> dict[Key, dict[str, Array]]:
    """The numbers of every map, (seeds,) each, in the order of the examples and the seeds; coverage where the reach is known."""
    reach = {one.cell.settings["task"]: one.values["points"] for one in found.values() if one.cell.settings["method"] == REACH}
    built = sorted((one for one in found.values() if one.cell.settings["method"] != REACH), key=lambda one: one.cell.seed)
    runs: dict[Key, dict[str, Array]] = {}
    for task in EXAMPLES:
        mine = [one for one in built if one.cell.settings["task"] == task]
        for method in NAMES:
            rows = [_row(one.values, _points(reach.get(task), mine, one)) for one in mine if one.cell.settings["method"] == method]
            if rows:
                runs[task, method] = {name: np.array([row[name] for row in rows]) for name in COLUMNS}
    return runs


def judged(runs: Mapping[Key, Mapping[str, Array]]) -> list[Claim]:
    """The claims with our numbers; open unless every task was mapped by both methods."""
    if any((task, method) not in runs for task in EXAMPLES for method in NAMES):
        return list(CLAIMS)
    figures = [task for task in EXAMPLES if task != PREGRASP]
    covered = {method: {task: float(runs[task, method]["coverage"].min()) for task in figures} for method in NAMES}
    holds = all(share >= COVERED for share in covered[NES].values())
    vertices = np.concatenate([runs[PREGRASP, method]["vertices"] for method in NAMES])
    slowest = max(figures, key=lambda task: float(runs[task, NES]["processor_s"].max()))
    most = float(runs[slowest, NES]["processor_s"].max())
    sound = sum(float((one["valid"] * one["vertices"]).sum()) for one in runs.values())
    poses = sum(float(one["vertices"].sum()) for one in runs.values())
    return [  # of the map-making the thesis' own method decides
        MAPS.measured("; ".join(f"{NAMES[method]}: {_least(shares)}" for method, shares in covered.items()), holds),
        VALID.measured(f"{sound:.0f} of {poses:.0f} poses", round(sound) == round(poses)),
        GRAPH.measured("; ".join(f"{NAMES[method]}: {_least(_connected(runs, method))}" for method in NAMES), _whole(runs)),
        SIZE.measured(f"{vertices.min():.0f} to {vertices.max():.0f}", bool(MANY[0] <= vertices.min() and vertices.max() <= MANY[1])),
        SOON.measured(f"at most {most:.0f} s ({slowest})", most <= LARGEST),
    ]


def _points(reach: Array | None, maps: Sequence[CellResult], own: CellResult) -> Array | None:
    """What can be reached as far as anybody but this map knows, (R, m)."""
    return None if reach is None else np.concatenate([reach, *(one.values["y"] for one in maps if one is not own)])


def _row(values: Mapping[str, Any], points: Array | None) -> dict[str, float]:
    row = {name: float(values[name]) for name in ("vertices", "processor_s", "valid", "kept", "free", "connected")}
    row["evaluations_a_vertex"] = values["evaluations"] / max(1, values["vertices"])
    known = None if points is None else coverage(points, values["y"], values["spacing"])
    row["coverage"], row["largest_hole"] = (np.nan, np.nan) if known is None else (known.share, known.largest_hole)
    return row


def _connected(runs: Mapping[Key, Mapping[str, Array]], method: str) -> dict[str, float]:
    return {task: float(runs[task, method]["connected"].min()) for task in EXAMPLES}


def _whole(runs: Mapping[Key, Mapping[str, Array]]) -> bool:
    return all(share == 1.0 for method in NAMES for share in _connected(runs, method).values())


def _least(shares: Mapping[str, float]) -> str:
    worst = min(shares, key=lambda task: shares[task])
    return f"at least {100.0 * shares[worst]:.1f} % ({worst})"


def _digits(column: str) -> int:
    return 0 if column in ("vertices", "evaluations_a_vertex") else 1 if column == "processor_s" else 3
