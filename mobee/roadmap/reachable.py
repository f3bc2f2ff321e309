# SPDX-License-Identifier: Apache-2.0
"""Finds reachable positions and poses of a marker by inverse kinematics."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from mobee.arrays import Array, Ints
from mobee.errors import InvalidValue
from mobee.model.contact import links_moved
from mobee.model.model import Model
from mobee.model.world import World
from mobee.model.world_object import sphere
from mobee.roadmap.ik import costs
from mobee.roadmap.ik.least_squares import Descent
from mobee.roadmap.ik.problem import Problem

POINT = 1e-3  # m, radius of the sphere that represents a point
SHELL, FAR = 0.02, 0.5  # m
MET = 1e-4  # m: a smaller distance counts as 0
STARTS = 23  # random start postures


@dataclass(frozen=True, slots=True, eq=False)
class Nearest:
    """The posture that brings a marker nearest to a target.

    `q`: (n,) rad. `position`: (3,) m, root frame, of the marker in this posture. `distance`: of the marker from the target [m].
    """

    q: Array
    position: Array
    distance: float


def nearest_posture(model: Model, part: str, marker: str, position: Array, q: Array, seed: int = 0) -> Nearest:
    """Return the posture that brings the marker nearest to `position` (3,) m, root frame, with the motors of one part.

    The other motors stay as in q (n,) rad. The posture is found by least squares within the motors' limits, from q and from random
    postures; so it is the nearest posture with high probability, not with certainty. `seed`: of the random postures. Contacts are ignored.
    Raises InvalidValue if the part does not move the marker, or if `position` or q is not valid.
    """
    motors = [model.robot.motors[motor] for motor in _movers(model, part, marker)]
    problem = Problem(model, [costs.position(marker, position, tolerance=MET)], q, motors)
    low, high = problem.limits.T
    drawn = np.random.default_rng(seed).uniform(low, high, (STARTS, len(low)))
    ends, errors = Descent(problem).ends(np.concatenate([problem.start[None], problem.whole(drawn)]))
    best = int(errors[:, 0].argmin())
    return Nearest(ends[best], model.evaluate(ends[best]).position(marker), float(errors[best, 0]))


def body_at(model: Model, part: str, position: Array, q: Array) -> str | None:
    """Return the name of a link whose solid shapes contain `position` (3,) m, root frame, in the posture q (n,) rad; None if there is none.

    Links that the part moves are ignored.
    """
    robot, world = replace(model.robot, base_shapes=frozenset()), World()  # those shapes are tested too
    world.add("place", sphere(POINT), position=position)
    table = Model(robot, world).evaluate(q).table
    moved = links_moved(robot)[part]
    inside = [int(link) for link in table.first_link[(table.second_link < 0) & (table.kind == 0)] if int(link) not in moved]
    return robot.links[inside[0]] if inside else None


def nearest_outside(model: Model, part: str, marker: str, position: Array, q: Array) -> Array | None:
    """Return approximately the point (3,) m nearest to `position` that the marker can reach and that is outside the robot's body.

    The body is all solid shapes that `body_at` tests. The motors other than those of the part stay as in q (n,) rad. Points at distances up
    to 0.5 m from `position`, in steps of 2 cm, are tried; None if none of them is suitable. All points are in the root frame.
    """
    where = np.asarray(position, dtype=np.float64)
    directions = np.array([one for one in product((-1.0, 0.0, 1.0), repeat=3) if any(one)])
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    nearest = nearest_posture(model, part, marker, where, q).distance
    for distance in np.arange(max(nearest, SHELL), FAR, SHELL):
        for place in where + distance * directions:
            if body_at(model, part, place, q) is None and nearest_posture(model, part, marker, place, q).distance < SHELL:
                return np.asarray(place)
    return None


def _movers(model: Model, part: str, marker: str) -> Ints:
    """Return the part's motors that move the marker."""
    robot = model.robot
    where = robot.part(part)
    rows = np.abs(model.jacobian(np.stack([robot.home, robot.limits.mean(axis=1)]), marker)).max(axis=(0, 1))
    motors = where.start + np.flatnonzero(rows[where.slice] > 0.0)
    if not len(motors):
        able = [name for name in robot.markers if robot.markers[name].link in links_moved(robot)[part]]
        raise InvalidValue(f"{part} does not move the marker {marker!r}. Valid: {', '.join(able) or 'none'}.")
    return motors
