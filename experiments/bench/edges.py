"""How long it takes to check a map's edges: the thesis' 400 000 poses, each edge once, and only those near a change (thesis 4.3.3)."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np

import mobee
from experiments.bench import calibration
from experiments.bench import verdicts as requirement
from experiments.bench.calibration import Calibration
from experiments.bench.edges_workload import MARKER, palm_map
from experiments.bench.verdicts import judged, one_core
from experiments.kit.command_line import Progress
from mobee.roadmap.edges import STEP, EdgeWatch, Flags, between, checked
from mobee.roadmap.ik.problem import solid_model
from mobee.roadmap.roadmap import Roadmap

T = TypeVar("T")

THESIS = 400_000  # poses: 5000 vertices, 8 edges each, 10 poses an edge; at 1 kHz "roughly 7 minutes"
CUP = mobee.cylinder(0.04, 0.12)
CUP_AT = (-0.5, 0.16)  # m, x and y
EDGES_AT_ONCE = 512

# Name, key in the standard machine's time, at most.
REQUIREMENTS = (
    ("the thesis' 400 000 edge poses, s", "standard_thesis_s", 3.0),
    ("each undirected edge once, us a pose of it", "standard_once_us", 7.5),
)


@dataclass(frozen=True, slots=True)
class Settings:
    """How dense the map is [m], and how often all is measured."""

    spacing: float = 0.008  # 5300 vertices
    rounds: int = 5


QUICK = Settings(spacing=0.02, rounds=1)


def measure(settings: Settings) -> dict[str, Any]:
    """All numbers, for people and scripts; times are processor time, medians of the rounds."""
    with one_core() as core, Progress() as progress:
        progress.show(0.0, "making the map")
        trm = palm_map(settings.spacing)
        rounds, speeds = [], Calibration()
        for number in range(settings.rounds):
            progress.show((number + 1) / (settings.rounds + 1), f"{len(trm.q)} vertices, round {number + 1}")
            rounds.append(_round(trm.model, trm, speeds))
    found = {key: float(np.median([one[key] for one in rounds])) for key in rounds[0]}
    result = {"core": core, "spacing": settings.spacing, "step": STEP, "vertices": len(trm.q), "edges": len(trm.edges), **found}
    result |= {"speed": speeds.median, "thesis_s": found["both_s"] / found["both_poses"] * THESIS}
    return result | verdict(result, agree=all(one["differing"] == 0 for one in rounds))


def verdict(result: Mapping[str, Any], agree: bool) -> dict[str, Any]:
    """Whether all ways of checking agree, and are as fast as required."""
    required = [judged(name, result[key], at_most=bound) for name, key, bound in REQUIREMENTS]
    return {"agree": agree, "requirements": required, "passed": agree and requirement.all_passed(required)}


def _round(model: mobee.Model, trm: Roadmap, speeds: Calibration) -> dict[str, float]:
    """One measurement of each; `differing`: edges of which two ways of checking say different things."""
    both_ways = np.concatenate([trm.edges, trm.edges[:, ::-1]])[np.argsort(np.tile(np.arange(len(trm.edges)), 2), kind="stable")]
    plain, plain_s = _timed(lambda: _plain(model, trm))
    (both, both_s), both_speed = speeds.around(lambda: _timed(lambda: checked(model, trm.q, both_ways, marker=MARKER)))
    (once, once_s), once_speed = speeds.around(lambda: _timed(lambda: checked(model, trm.q, trm.edges, marker=MARKER)))
    watch = EdgeWatch(model, trm.q, trm.edges, marker=MARKER)
    model.world.add("cup", CUP, position=(*CUP_AT, -0.1 + 0.5 * CUP.size[1]))
    near, change_s = _timed(watch.update)
    after, all_s = _timed(lambda: checked(model, trm.q, trm.edges, marker=MARKER))
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
        "standard_thesis_s": both_s * both_speed / both.poses * THESIS,
        "standard_once_us": 1e6 * once_s * once_speed / once.poses,
    }


def _plain(model: mobee.Model, trm: Roadmap) -> tuple[Flags, int]:
    """Which edges are free, by every pose along each of them and its ends, in batches as they come; and how many poses that were."""
    solid = solid_model(model)
    free, looked = np.ones(len(trm.edges), dtype=np.bool_), 0
    poses = between(solid, trm.q, trm.edges, marker=MARKER)
    for first in range(0, len(trm.edges), EDGES_AT_ONCE):
        some = trm.edges[first : first + EDGES_AT_ONCE]
        counts = poses[first : first + EDGES_AT_ONCE] + 2
        owner = np.repeat(np.arange(len(some)), counts)
        share = np.concatenate([np.linspace(0.0, 1.0, count) for count in counts])[:, None]
        a, b = trm.q[some[owner, 0]], trm.q[some[owner, 1]]
        touched = np.asarray(solid.evaluate(a + (b - a) * share).count) > 0
        free[first + owner[touched]] = False
        looked += len(owner)
    return free, looked


def _timed(what: Callable[[], T]) -> tuple[T, float]:
    start = time.process_time()
    result = what()
    return result, time.process_time() - start


def report(result: dict[str, Any]) -> str:
    """The measurements as text."""
    lines = [
        f"A palm over the table every {1e3 * result['spacing']:g} mm: {result['vertices']} vertices, {result['edges']} undirected edges,",
        f"poses {1e3 * result['step']:g} mm apart; processor time of one core:",
        f"  {'':<40}{'poses':>9}{'s':>9}{'us a pose':>11}",
    ]
    for name, key in (("each edge both ways", "both"), ("each edge once", "once"), ("each edge once, all poses, no list", "plain")):
        poses, seconds = result[f"{key}_poses"], result[f"{key}_s"]
        lines.append(f"  {name:<40}{poses:>9.0f}{seconds:>9.3f}{1e6 * seconds / poses:>11.2f}")
    agree = "yes" if result["agree"] else "NO"
    lines += [
        f"{result['touching']:.0f} edges touch. The thesis' 400 000 poses take {result['thesis_s']:.2f} s, not its 7 minutes.",
        f"A cup put on the table blocks {result['blocked']:.0f} edges: found among the {result['change_edges']:.0f} near it in",
        f"{1e3 * result['change_s']:.0f} ms, among all in {1e3 * result['all_s']:.0f} ms. All ways agree: {agree}.",
    ]
    return "\n".join([*lines, calibration.told(result["speed"]), *requirement.lines(result["requirements"])])
