"""Measures of safety of recorded postures: violated constraints and limits, depths of contacts, oscillation of a marker.

They are written apart from the control law, which they judge.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

from experiments.kit.control.plant_runs import PlantRun
from mobee.arrays import Array
from mobee.model.model import Model
from mobee.robot.robot import Robot
from services.robot_sim.bullet_scene import load_solid_pairs

SECOND = 1.0  # s; a contact that oscillates does so twice a second or faster
AT_STOP = np.deg2rad(0.01)  # a motor nearer to a limit is at its hard stop


def clause_violations(robot: Robot, q: Array) -> Array:
    """-s/|a| of every clause in the postures q (T, n) rad: (T, clauses) rad along the normal, negative inside.

    s = a.q + b; of a clause of several rows the one that is nearest to being satisfied counts.
    """
    return np.stack([np.min(-(q @ c.a.T + c.b) / np.linalg.norm(c.a, axis=1), axis=1) for c in robot.clauses], axis=1)


def limit_violations(robot: Robot, q: Array) -> Array:
    """How far every motor is beyond the nearer of its limits, (T, n) rad, negative inside."""
    return np.maximum(robot.limits[:, 0] - q, q - robot.limits[:, 1])


def speeds_at_stops(robot: Robot, run: PlantRun, start: Array) -> Array:
    """Speeds of the motors in the ticks in which they are at a hard stop, else 0: (T, n) rad/s; the run begins at `start` (n,) rad."""
    speeds: Array = np.diff(run.q, axis=0, prepend=start[None]) / run.dt * (limit_violations(robot, run.q) > -AT_STOP)
    return speeds


def clause_label(robot: Robot, number: int) -> str:
    """A clause as an inequality in degrees, its motors without their side."""
    rows = []
    for a, b in zip(robot.clauses[number].a, robot.clauses[number].b, strict=True):
        terms = [f"{a[i]:+.3g} {robot.motors[i].split('_', 1)[1]}" for i in np.flatnonzero(a)]
        rows.append(f"{' '.join(terms)} > {-np.rad2deg(b):.4g}")
    return " or ".join(rows)


@dataclass(frozen=True, slots=True)
class Depths:
    """The deepest contacts of a run [m], 0 where there was none."""

    solid: float  # of those that count, see `is_listed`
    field: float
    pair: str  # of these solids, "" where there was none
    beside: float  # of solids that do not count: an upper arm beside the pelvis


def deepest(model: Model, q: Array) -> Depths:
    """The deepest contacts in the postures q (T, n) rad."""
    table = model.evaluate(q).table
    depth = {True: 0.0, False: 0.0}
    pair = ""
    for row in np.flatnonzero(table.kind == 0):
        first, second = table.name(table.first[row]), table.name(table.second[row])
        counts, deep = is_listed(first, second), float(table.depth[row])
        if deep > depth[counts]:
            depth[counts] = deep
            pair = f"{first} in {second}" if counts else pair
    fields = table.depth[table.kind == 1]
    return Depths(depth[True], float(fields.max(initial=0.0)), pair, depth[False])


def oscillation(model: Model, run: PlantRun, marker: str) -> float:
    """How far a marker strays at most from its mean over the second around it [m]: creeping is not oscillating."""
    path = model.evaluate(run.q).position(marker)
    window = min(len(path), round(SECOND / run.dt))
    total = np.concatenate([np.zeros((1, 3)), np.cumsum(path, axis=0)])
    mean = (total[window:] - total[:-window]) / window
    middle = path[window // 2 : window // 2 + len(mean)]
    return float(np.linalg.norm(middle - mean, axis=1).max())


@cache
def is_listed(first: str, second: str) -> bool:
    """Whether a solid contact of two shapes of the iCub is in the simulator's list of pairs; with an object of the world it always counts.

    Not counted is what overlaps in some of all legal poses, as upper arms and pelvis: fields are not felt there either.
    """
    one, other = _link(first), _link(second)
    return one is None or other is None or frozenset((one, other)) in _pairs()


@cache
def _pairs() -> set[frozenset[str]]:
    return load_solid_pairs().links()


@cache
def _links() -> tuple[str, ...]:
    """All names in the list, the longest first."""
    names = {name for pair in _pairs() for name in pair}
    return tuple(sorted(names, key=len, reverse=True))


def _link(shape: str) -> str | None:
    """The link that a shape's name begins with, None for an object of the world."""
    return next((link for link in _links() if shape == link or shape.startswith(f"{link}_")), None)
