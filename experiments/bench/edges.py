# SPDX-License-Identifier: Apache-2.0
"""Contact checks along the edges of a roadmap: time for the 400 000 poses of thesis 4.3.3, for each edge once, and for edges near a change.

Four methods are compared.  The first checks all poses of every edge, in batches.  The others use `mobee.roadmap.edges`, which ends the
check of an edge at its first contact: every edge in both directions; every edge once; after an object was added, only the edges near it.
The 400 000 poses are 5000 vertices with 8 edges each and 10 poses an edge; their time is computed from the time per pose of the second
method.  The roadmap is the thesis' pre-grasp map: the right palm above the table, one vertex every few millimetres, 8 neighbours (figure
4.8).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

import mobee
from experiments.bench.timing import Calibration, medians, one_core, processor_time
from experiments.bench.verdicts import Requirement, report_text, verdict
from experiments.claims.ch3_roadmaps.trm_tasks import pregrasp
from experiments.kit.command_line import Progress
from experiments.kit.roadmap_task import RIGHT, build
from mobee import Roadmap
from mobee.roadmap.edges import STEP, EdgeWatch, Flags, between, checked
from mobee.roadmap.ik.problem import solid_model

MARKER = RIGHT
NEIGHBOURS = 8
THESIS_POSES = 400_000  # 5000 vertices, 8 edges each, 10 poses an edge; at 1 kHz "roughly 7 minutes"
CUP = mobee.cylinder(0.04, 0.12)
CUP_POSITION = (-0.5, 0.16)  # m, x and y
EDGES_PER_BATCH = 512

REQUIREMENTS = (
    Requirement("the thesis' 400 000 edge poses, s", ("standard_thesis_s",), at_most=3.0),
    Requirement("each undirected edge once, us a pose of it", ("standard_once_us",), at_most=7.5),
)


@dataclass(frozen=True, slots=True)
class Settings:
    """Settings of the benchmark.  `spacing`: distance between vertices of the roadmap [m].  `rounds`: repetitions of the measurements."""

    spacing: float = 0.008  # 5300 vertices
    rounds: int = 5


QUICK = Settings(spacing=0.02, rounds=1)


def palm_map(spacing: float) -> Roadmap:
    """Build the pre-grasp roadmap, whose vertices are poses of the robot with the palm beside possible places of a cup.

    `spacing`: distance between vertices [m].  Each vertex has edges to its 8 nearest vertices.  Motors may be at their limits, because the
    roadmap is built with a margin of 0.
    """
    return build(replace(pregrasp(), spacing=spacing, margin=0.0), "least_squares", neighbours=NEIGHBOURS)


def measure(settings: Settings) -> dict[str, Any]:
    """Run this benchmark and return its result.

    Main keys: "vertices" and "edges", their numbers in the roadmap; processor times [s] of the methods, medians of the rounds: "plain_s"
    (each edge once, all its poses, also after a contact), "both_s" (each edge in both directions), "once_s" (each edge once), "change_s"
    (after an object was added, only the edges near it) and "all_s" (after that, all edges); "plain_poses", "both_poses" and "once_poses",
    numbers of checked poses; "agree", whether all methods find the same edges free of contacts; "requirements", a list with the dict that
    `Requirement.judge` returns for each requirement; "passed", whether all are met and the methods agree.
    """
    with one_core() as core, Progress() as progress:
        progress.show(0.0, "making the map")
        trm = palm_map(settings.spacing)
        rounds, speeds = [], Calibration()
        for number in range(settings.rounds):
            progress.show((number + 1) / (settings.rounds + 1), f"{len(trm.q)} vertices, round {number + 1}")
            rounds.append(_round(trm.model, trm, speeds))
    found = medians(rounds)
    result = {"core": core, "spacing": settings.spacing, "step": STEP, "vertices": len(trm.q), "edges": len(trm.edges), **found}
    result |= {"speed": speeds.median, "thesis_s": found["both_s"] / found["both_poses"] * THESIS_POSES}
    return result | verdict(result, REQUIREMENTS, agree=all(one["differing"] == 0 for one in rounds))


def _round(model: mobee.Model, trm: Roadmap, speeds: Calibration) -> dict[str, float]:
    """Measure each method once and return the times and numbers that `measure` explains, and others.

    The others are "differing", the number of edges on which two methods disagree; "touching" (edges that are not free), "change_edges"
    (edges that are checked again after an object was added), "blocked" (edges that it blocks), and the times on the standard machine,
    "standard_thesis_s" [s] and "standard_once_us" [us], for the requirements.
    """
    order = np.argsort(np.tile(np.arange(len(trm.edges)), 2), kind="stable")
    both_directions = np.concatenate([trm.edges, trm.edges[:, ::-1]])[order]
    plain, plain_s = processor_time(lambda: _check_every_pose(model, trm))
    (both, both_s), both_speed = speeds.around(lambda: processor_time(lambda: checked(model, trm.q, both_directions, marker=MARKER)))
    (once, once_s), once_speed = speeds.around(lambda: processor_time(lambda: checked(model, trm.q, trm.edges, marker=MARKER)))
    watch = EdgeWatch(model, trm.q, trm.edges, marker=MARKER)
    model.world.add("cup", CUP, position=(*CUP_POSITION, -0.1 + 0.5 * CUP.size[1]))
    near, change_s = processor_time(watch.update)
    after, all_s = processor_time(lambda: checked(model, trm.q, trm.edges, marker=MARKER))
    model.world.remove("cup")
    differing = (plain[0] != once.free).sum() + (both.free[::2] != once.free).sum() + (watch.free != after.free).sum()
    return {
        "plain_s": plain_s,
        "plain_poses": plain[1],
        "both_s": both_s,
        "both_poses": both.poses,
        "once_s": once_s,
        "once_poses": once.poses,
        "touching": int((~once.free).sum()),
        "change_s": change_s,
        "change_edges": len(near),
        "blocked": int((once.free & ~after.free).sum()),
        "all_s": all_s,
        "differing": int(differing),
        "standard_thesis_s": both_s * both_speed / both.poses * THESIS_POSES,
        "standard_once_us": 1e6 * once_s * once_speed / once.poses,
    }


def _check_every_pose(model: mobee.Model, trm: Roadmap) -> tuple[Flags, int]:
    """Check every pose along each edge and its ends, in batches of edges; returns which edges are free, and the number of poses."""
    solid = solid_model(model)
    free, evaluated = np.ones(len(trm.edges), dtype=np.bool_), 0
    poses = between(solid, trm.q, trm.edges, marker=MARKER)
    for first in range(0, len(trm.edges), EDGES_PER_BATCH):
        some = trm.edges[first : first + EDGES_PER_BATCH]
        counts = poses[first : first + EDGES_PER_BATCH] + 2
        owner = np.repeat(np.arange(len(some)), counts)
        share = np.concatenate([np.linspace(0.0, 1.0, count) for count in counts])[:, None]
        a, b = trm.q[some[owner, 0]], trm.q[some[owner, 1]]
        touched = np.asarray(solid.evaluate(a + (b - a) * share).count) > 0
        free[first + owner[touched]] = False
        evaluated += len(owner)
    return free, evaluated


def report(result: dict[str, Any]) -> str:
    """Return the result of `measure` as text: a table with one line for each method, then the requirements."""
    lines = [
        f"A palm over the table every {1e3 * result['spacing']:g} mm: {result['vertices']} vertices, {result['edges']} undirected edges,",
        f"poses {1e3 * result['step']:g} mm apart; processor time of one core:",
        f"  {'':<40}{'poses':>9}{'s':>9}{'us a pose':>11}",
    ]
    for name, key in (
        ("each edge in both directions", "both"),
        ("each edge once", "once"),
        ("each edge once, all poses, no list", "plain"),
    ):
        poses, seconds = result[f"{key}_poses"], result[f"{key}_s"]
        lines.append(f"  {name:<40}{poses:>9.0f}{seconds:>9.3f}{1e6 * seconds / poses:>11.2f}")
    agree = "yes" if result["agree"] else "NO"
    lines += [
        f"{result['touching']:.0f} edges touch. The thesis' 400 000 poses take {result['thesis_s']:.2f} s, not its 7 minutes.",
        f"A cup put on the table blocks {result['blocked']:.0f} edges: found among the {result['change_edges']:.0f} near it in",
        f"{1e3 * result['change_s']:.0f} ms, among all in {1e3 * result['all_s']:.0f} ms. All methods agree: {agree}.",
    ]
    return report_text(lines, result)
