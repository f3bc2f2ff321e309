"""The share of the reachable task space that a map covers, by other means than those that built it, and the validity of its poses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

import mobee
from mobee.arrays import Array
from mobee.roadmap.building.lattice_builder import Patience, lattice_poses
from mobee.roadmap.building.task_ik import TaskIK
from mobee.roadmap.building.tasks import Task
from mobee.roadmap.ik.problem import Cost, Problem, solid_robot

FINER = 2  # points of the dense lattice along a spacing
GENEROUS = Patience(starts=16, tries=24, hopeless=8, scouts=2048)
BLIND, STARTS = 2000, 20  # random task points, and random starts of each
OFF = 0.05  # spacings that a pose may be off such a point


@dataclass(frozen=True, slots=True, eq=False)
class Coverage:
    """The distance of the reachable task space from the vertices.

    `reachable`: task points (R, m) that were reached.  `far`: (R,), how far the nearest vertex is from each, in spacings.
    """

    reachable: Array
    far: Array

    @property
    def share(self) -> float:
        """Of the reachable task points, that within a spacing of a vertex."""
        return float((self.far <= 1.0).mean())

    @property
    def largest_hole(self) -> float:
        """How far the reachable task point is that is furthest from all vertices, in spacings."""
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
    """Task points (R, m) that can be reached, densely.

    They are the points that least squares reaches on a lattice of half the spacing (m,), with far more starts per point than a map gets,
    and those that random starts reach at random points, independently of neighbours.
    """
    rng = np.random.default_rng(seed)
    problem = Problem(model, costs, start, motors, margin)
    _, dense = lattice_poses(problem, task, spacing / FINER, rng, patience=GENEROUS)
    return np.concatenate([dense, _blind(problem, task, spacing, rng)])


def coverage(points: Array, y: Array, spacing: Array) -> Coverage:
    """How much of reachable task points (R, m) vertices y (V, m) cover, at a spacing (m,); the vertices are reachable, too."""
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
    """Whether poses q (V, n) are, by the reference engine, within all tolerances, their limits and the box, and at y (V, m): (V,)."""
    reference = mobee.Model(solid_robot(model.robot), model.world, engine="fcl")
    pose = reference.evaluate(q)
    low, high = model.robot.limits.T
    good: NDArray[np.bool_] = ((q >= low) & (q <= high)).all(axis=1)
    there = task.of(pose)
    good &= (np.abs(there - y) <= 1e-9).all(axis=1) & ((there >= task.box[:, 0]) & (there <= task.box[:, 1])).all(axis=1)
    problem = Problem(model, costs, start, motors)
    good &= (np.delete(q - problem.start, problem.free, axis=1) == 0.0).all(axis=1)  # no motor moved that may not
    for one in problem.terms:
        if one.tolerance is not None:
            good &= one.residual(pose) <= one.tolerance
    return good


def _blind(problem: Problem, task: Task, spacing: Array, rng: np.random.Generator) -> Array:
    """Those of some random points of the box that random starts reach, (B, m)."""
    low, high = task.box.T
    points = np.repeat(rng.uniform(low, high, (BLIND, len(low))), STARTS, axis=0)
    ik = TaskIK(problem, task, OFF * spacing)
    _, there, wrong, _ = ik.solve(points, ik.random_starts(len(points), rng))
    met = np.flatnonzero(wrong == 0.0)
    _, once = np.unique(met // STARTS, return_index=True)
    found: Array = there[met[once]]
    return found
