# SPDX-License-Identifier: Apache-2.0
"""Safety measures of recorded postures: violated constraints and limits, depths of contacts, oscillation of a marker.

The functions share no code with the control law, which they judge.
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

WINDOW = 1.0  # s of the moving mean; a contact oscillates twice a second or faster
AT_STOP = np.deg2rad(0.01)  # rad; a motor nearer to a limit is at its hard stop


def clause_violations(robot: Robot, q: Array) -> Array:
    """Return the violation of every clause of the robot in postures q (T, n) rad: (T, clauses) rad, above 0 where a clause is violated.

    A clause is a condition on several motors: at least one of its inequalities a.q + b > 0 (its rows) must hold.  The violation of a row is
    -(a.q + b) / |a|; the violation of a clause is the smallest violation among its rows.
    """
    return np.stack([np.min(-(q @ c.a.T + c.b) / np.linalg.norm(c.a, axis=1), axis=1) for c in robot.clauses], axis=1)


def limit_violations(robot: Robot, q: Array) -> Array:
    """Return how far every motor is beyond its nearer limit in postures q (T, n) rad: (T, n) rad, negative within the limits."""
    return np.maximum(robot.limits[:, 0] - q, q - robot.limits[:, 1])


def speeds_at_stops(robot: Robot, run: PlantRun, start: Array) -> Array:
    """Return the speeds (T, n) rad/s of the motors in the ticks in which they are at a hard stop, and 0 in all other ticks.

    `start`: posture before the first tick, (n,) rad.  A motor is at a stop if it is less than AT_STOP (0.01 degrees) from a limit.
    """
    speeds: Array = np.diff(run.q, axis=0, prepend=start[None]) / run.dt * (limit_violations(robot, run.q) > -AT_STOP)
    return speeds


def clause_label(robot: Robot, number: int) -> str:
    """Return a clause of the robot, a condition on several motor positions, as text: inequalities in degrees.

    `number`: index of the clause in `robot.clauses`.  The prefixes `l_` and `r_` of the motors are left out.
    """
    rows = []
    for a, b in zip(robot.clauses[number].a, robot.clauses[number].b, strict=True):
        terms = [f"{a[i]:+.3g} {robot.motors[i].split('_', 1)[1]}" for i in np.flatnonzero(a)]
        rows.append(f"{' '.join(terms)} > {-np.rad2deg(b):.4g}")
    return " or ".join(rows)


@dataclass(frozen=True, slots=True)
class Depths:
    """The depths of the deepest contacts of a run, in m; 0 where there was no contact.

    `solid`: deepest contact between two solids that counts as a collision by `is_listed`.  `field`: deepest contact of fields, which are
    larger volumes that cause repulsive forces.  `pair`: names of the two solids of the contact `solid`, "" if there was no such contact.
    `beside`: deepest contact between two solids that does not count as a collision, such as an upper arm beside the pelvis.
    """

    solid: float
    field: float
    pair: str
    beside: float


def deepest(model: Model, q: Array) -> Depths:
    """Return the depths of the deepest contacts of the model in the postures q (T, n) rad."""
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
    """Return the largest distance [m] of a marker from its moving mean over WINDOW (1 s) in a run.

    Slow motion does not count as oscillation.
    """
    path = model.evaluate(run.q).position(marker)
    window = min(len(path), round(WINDOW / run.dt))
    total = np.concatenate([np.zeros((1, 3)), np.cumsum(path, axis=0)])
    mean = (total[window:] - total[:-window]) / window
    middle = path[window // 2 : window // 2 + len(mean)]
    return float(np.linalg.norm(middle - mean, axis=1).max())


@cache
def is_listed(first: str, second: str) -> bool:
    """Return whether a contact of two solids counts as a collision; `first`, `second`: names of their shapes.

    It counts if an object of the world takes part, or if the pair of links is in the simulator's list of pairs (solid_pairs.json). Pairs
    that overlap in some legal poses, such as upper arm and pelvis, are not in the list; their fields exert no force either.
    """
    one, other = _link(first), _link(second)
    return one is None or other is None or frozenset((one, other)) in _pairs()


@cache
def _pairs() -> set[frozenset[str]]:
    return load_solid_pairs().links()


@cache
def _links() -> tuple[str, ...]:
    """Return all link names of the list, the longest first."""
    names = {name for pair in _pairs() for name in pair}
    return tuple(sorted(names, key=len, reverse=True))


def _link(shape: str) -> str | None:
    """Return the link with which the name of a shape begins, None for an object of the world."""
    return next((link for link in _links() if shape == link or shape.startswith(f"{link}_")), None)
