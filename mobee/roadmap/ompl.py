"""Planners that exist: RRT-Connect, PRM and PRM* of OMPL, over a model (extra `planning`).

What they find has no contact of solids by the model; that the robot comes through is another matter (thesis 4.2).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import ArrayLike

from mobee.errors import InvalidValue
from mobee.model import Model
from mobee.real_array import real_array
from mobee.roadmap.ik.problem import chosen
from mobee.roadmap.ik.solids import solid_model
from mobee.roadmap.ompl_base import EXTENSIONS, Free, Grown, OmplMissing, connected, grown, require_ompl
from mobee.robot.robot import Array

__all__ = ["OmplMissing", "prm", "prm_star", "query", "require_ompl", "rrt_connect"]

STEP = 0.02  # of a motor's range, between two poses of a motion that are looked at
MILESTONES, NEIGHBOURS = 300, 10


def rrt_connect(
    model: Model,
    start: ArrayLike,
    goals: ArrayLike,
    motors: Sequence[str] | None = None,
    seed: int = 0,
    extensions: int = EXTENSIONS,
    step: float = STEP,
) -> Array | None:
    """A way without contacts of solids from a pose to one of several (Kuffner and LaValle 2000).

    Args:
        model: robot and world.
        start: (n,) rad, all motors.
        goals: (n,) or (G, n) rad; of motors that may not move, the start counts.
        motors: names of motors or parts that may move; None: all.
        seed: decides everything.
        extensions: of the trees, after which the search is given up.
        step: of each motor's range, between poses of a motion that are looked at.

    Returns:
        Poses (K, n) rad from the start to a goal, or None: no way was found.

    Raises:
        OmplMissing, InvalidValue, UnknownName: with what is valid, and what to do.
    """
    free, first = _free(model, motors, start, step)
    ends = np.atleast_2d(_poses(model, goals))[:, free.columns]
    way = connected(free, first[free.columns], ends, seed, extensions)
    return None if way is None else free.whole(way)


def prm(
    model: Model,
    motors: Sequence[str] | None = None,
    milestones: int = MILESTONES,
    neighbours: int = NEIGHBOURS,
    rest: ArrayLike | None = None,
    seed: int = 0,
    step: float = STEP,
) -> Grown:
    """A probabilistic roadmap of poses and motions without contacts of solids (Kavraki et al. 1996).

    Args:
        model: robot and world.
        motors: names of motors or parts that move; None: all.
        milestones: how many poses, at least.
        neighbours: with how many nearest ones each is tried to be joined.
        rest: (n,) rad, where the other motors are; None: at home.
        seed: of the samples.
        step: as in `rrt_connect`.

    Raises:
        OmplMissing, InvalidValue, UnknownName: with what is valid, and what to do.
    """
    return _grown("PRM", model, motors, milestones, neighbours, rest, seed, step)


def prm_star(
    model: Model,
    motors: Sequence[str] | None = None,
    milestones: int = MILESTONES,
    rest: ArrayLike | None = None,
    seed: int = 0,
    step: float = STEP,
) -> Grown:
    """As `prm`, with as many neighbours as make its ways shortest in the limit (Karaman and Frazzoli 2011)."""
    return _grown("PRMstar", model, motors, milestones, None, rest, seed, step)


def query(
    model: Model, joints: Sequence[str], rest: ArrayLike, seed: int = 0, extensions: int = EXTENSIONS
) -> Callable[[Array, Array], Array | None]:
    """`rrt_connect` over some joints as a `MapExplorer` asks for it, the other motors at `rest` (n,) rad."""
    whole = _poses(model, rest)
    columns = np.array([model.robot.motor_index(joint) for joint in joints])

    def ask(start: Array, goals: Array) -> Array | None:
        ends = np.repeat(whole[None], len(goals) + 1, axis=0)
        ends[:, columns] = np.concatenate([start[None], goals])
        way = rrt_connect(model, ends[0], ends[1:], joints, seed, extensions)
        return None if way is None else way[:, columns]

    return ask


def _grown(
    kind: str,
    model: Model,
    motors: Sequence[str] | None,
    milestones: int,
    neighbours: int | None,
    rest: ArrayLike | None,
    seed: int,
    step: float,
) -> Grown:
    if milestones < 1 or (neighbours is not None and neighbours < 1):
        raise InvalidValue(f"milestones={milestones!r}, neighbours={neighbours!r}: give whole numbers, at least 1.")
    free, _ = _free(model, motors, model.robot.home if rest is None else rest, step)
    found = grown(kind, free, milestones, neighbours, seed)
    return Grown(free.whole(found.q), found.edges)


def _free(model: Model, motors: Sequence[str] | None, rest: ArrayLike, step: float) -> tuple[Free, Array]:
    if not 0.0 < step <= 1.0:
        raise InvalidValue(f"step={step!r}: give a fraction of the motors' ranges above 0.")
    pose, columns = _poses(model, rest), chosen(model.robot, motors)
    limits = model.robot.limits
    columns = columns[limits[columns, 0] < limits[columns, 1]]
    solid = solid_model(model)
    return Free(lambda q: solid.evaluate(q).count == 0, pose, columns, limits[columns], step), pose


def _poses(model: Model, given: ArrayLike) -> Array:
    poses, n = real_array("the pose", given), len(model.robot.motors)
    if poses.ndim not in (1, 2) or poses.shape[-1] != n or not np.isfinite(poses).all():
        raise InvalidValue(f"a pose of shape {poses.shape}: give all {n} motors of {model.robot.name}, finite, in rad.")
    return poses
