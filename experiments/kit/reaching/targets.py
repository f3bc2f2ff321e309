# SPDX-License-Identifier: Apache-2.0
"""The targets of the thesis: 27 spheres, 10 cm in diameter, on a grid that roughly covers the right arm's workspace (thesis 8.3, fig. 8.1).

    python -m experiments.kit.reaching.targets

prints which of them inverse kinematics can reach; the table is in README.md of this folder.

The figure gives no coordinates.  In the original program of 2014, targets have x from -0.4 to -0.1, y from 0 to 0.4 and z from 0 to 0.4 m,
in steps of 0.1, in the root frame: x is negative in front of the robot, y positive to its right, z positive upwards.  The grid here has
every second of these values of y and z, and all values of x except the farthest, which only the stretched arm reaches.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import product

import numpy as np

from experiments.kit.learning.arm import RIGHT, robot
from experiments.kit.reaching.arm import MARKER, PART, arm_belief, laws
from experiments.kit.reaching.belief import PeerBelief, goals
from mobee import Model
from mobee.arrays import Array
from mobee.reach import RADIUS, Aim, ReachTarget
from mobee.robot.robot import Clause

GOOD = 0.02  # m from the surface within which a target counts as reached, as in `mobee reach`
COUNT = 27
X, Y, Z = (-0.3, -0.2, -0.1), (0.0, 0.2, 0.4), (0.0, 0.2, 0.4)  # m


def grid() -> Array:
    """Return the 27 positions of the grid, (27, 3) m, root frame; z changes fastest, x slowest."""
    return np.array(list(product(X, Y, Z)))


def between() -> Array:
    """Return the centres of the eight cells between the positions of `grid`, (8, 3) m, root frame: no learner tries targets there."""
    return np.array(list(product(*((np.array(levels[1:]) + levels[:-1]) / 2.0 for levels in (X, Y, Z)))))


def targets_at(places: Array, aim: Aim = "centre") -> list[ReachTarget]:
    """Return spheres as targets, with the default radius (5 cm), at `places` (P, 3) m, root frame.

    `aim`: whether a reach aims at the "centre" or the "surface" of the target.
    """
    return [ReachTarget(place, aim=aim) for place in places]


RESTARTS, STEPS = 16, 200  # of least squares
SLACK = 1e-6  # rad, allowed violation of a clause


@dataclass(frozen=True, slots=True, eq=False)
class Nearest:
    """The pose q (n,) rad that brings a marker (a named point on a link) nearest to a place, and the remaining distance, m."""

    q: Array
    distance: float


def nearest_pose(
    model: Model, marker: str, place: Array, joints: Sequence[str], restarts: int = RESTARTS, seed: int = 0, good: float = 1e-5
) -> Nearest:
    """Return the pose that brings the marker nearest to a place (3,) m, root frame, by least squares (SLSQP) from random poses.

    Contacts are ignored.  The motors `joints`, all of one part, move within their limits; all other motors are at home.  The clauses of
    this part, which are the constraints of the shoulder's cables, must hold, unlike in `mobee.roadmap.ik.solve`.  `restarts`: largest
    number of start poses.  `seed`: seed of the start poses.  `good`: m, distance at which the search ends.  If no start pose gives a pose
    that satisfies the clauses, the result is home with an infinite distance.
    """
    from scipy.optimize import minimize  # 0.3 s, and only this needs it

    robot = model.robot
    columns = np.array([robot.motor_index(name) for name in joints])
    low, high = robot.limits[columns].T
    clauses = [clause for clause in robot.clauses if clause.part == robot.motor_table[columns[0]].part]
    rng = np.random.default_rng(seed)
    best = Nearest(robot.home, np.inf)
    for _ in range(restarts):
        found = minimize(
            _error,
            rng.uniform(low, high),
            (model, marker, place, columns),
            method="SLSQP",
            jac=True,
            bounds=list(zip(low, high, strict=True)),
            constraints={"type": "ineq", "fun": _clearance, "args": (robot.home, columns, clauses)} if clauses else (),
            options={"maxiter": STEPS, "ftol": 1e-12},
        )
        if clauses and _clearance(found.x, robot.home, columns, clauses).min() < -SLACK:
            continue
        distance = float(np.sqrt(2.0 * found.fun))
        if distance < best.distance:
            best = Nearest(_whole(found.x, robot.home, columns), distance)
        if best.distance <= good:
            break
    return best


def _error(q: Array, model: Model, marker: str, place: Array, columns: Array) -> tuple[float, Array]:
    """Return half the squared distance, m^2, of the marker from a place (3,) m, root frame, and its gradient by q, (d,) m^2/rad.

    `q`: (d,) rad, angles of the motors with the indices `columns`; all other motors are at home.
    """
    whole = _whole(q, model.robot.home, columns)
    error = model.evaluate(whole).position(marker) - place
    return 0.5 * float(error @ error), model.jacobian(whole, marker)[:3, columns].T @ error


def _clearance(q: Array, home: Array, columns: Array, clauses: Sequence[Clause]) -> Array:
    """Return one number for each clause, (C,): the largest component of a q + b; the clause holds if it is above 0.

    A clause is a condition on several motor positions, which the shoulder's cables impose; `a` and `b` are its fields.  `q`: (d,) rad,
    angles of the motors with the indices `columns`; all others are at home.
    """
    whole = _whole(q, home, columns)
    return np.array([(clause.a @ whole + clause.b).max() for clause in clauses])


def _whole(q: Array, home: Array, columns: Array) -> Array:
    whole = home.copy()
    whole[columns] = q
    return whole


AT_CENTRE = 2e-3  # m within which the palm counts as at the centre


def joints_of(count: int) -> tuple[str, ...]:
    """Return the names of the first `count` motors of the right arm.

    4: shoulder and elbow, with which the reach learners move (`kit.reaching.arm.reach_space`); 7: these and the wrist, without the hand.
    """
    return robot().parts[PART].motors[:count]


def distances(places: Array, joints: tuple[str, ...]) -> list[float]:
    """Return the least distance [m] of the right palm from each place (P, 3) m, within limits and cable constraints.

    Contacts are ignored.  `joints`: names of the motors that move.
    """
    model = Model(robot())
    return [nearest_pose(model, MARKER, place, joints, good=AT_CENTRE / 10.0).distance for place in places]


def counts(found: list[float]) -> tuple[int, int]:
    """Return the number of targets whose centre the palm can reach, and of those whose surface it can approach to within 2 cm.

    `found`: least distance of the palm from the centre of each target, m.
    """
    return sum(d <= AT_CENTRE for d in found), sum(d <= RADIUS + GOOD for d in found)


@cache
def touchable_targets(law: str = "default", free: bool = True) -> tuple[ReachTarget, ...]:
    """Return 27 targets that the right palm can touch in an empty world; every call returns the same object.

    These are the thesis' targets that the palm can touch, and random targets within the same box in place of the others.  The palm touches
    a target in a pose in which the cable constraints hold, and no solids have contact, except those of the hand with the target.  `law`:
    control law: "default" with today's robot, or "published" with the robot of 2014.  `free`: True: such a pose must exist outside the
    zones near the joint limits in which the control law exerts repulsive forces; False: it may be in these zones.
    """
    belief, rng, places, aim = arm_belief(law=law), np.random.default_rng(27), grid(), laws()[law].aim
    found = [target for target in targets_at(places, aim) if touchable(belief, target, free)]
    while len(found) < COUNT:
        target = targets_at(rng.uniform(places.min(axis=0), places.max(axis=0))[None], aim)[0]
        found += [target] if touchable(belief, target, free) else []
    return tuple(found)


def touchable(belief: PeerBelief, target: ReachTarget, free: bool = True) -> bool:
    """Return whether the marker can touch the surface of a target in the planner's model `belief`, into which the target is put.

    `free`: whether this must be possible in a pose outside the zones near the joint limits in which the control law exerts repulsive
    forces.
    """
    to_surface = replace(target, aim="surface")
    belief.present(to_surface)
    return len(goals(belief, to_surface, np.random.default_rng(0), most=1, free=free)[0]) > 0


def table() -> str:
    """Return two Markdown tables, for 4 and for 7 joints of the right arm.

    The first has the numbers of targets that can be reached, the second the least distance [cm] of the palm from each of the 27 targets.
    """
    lines = ["| joints | targets | palm at the centre | palm within 2 cm of the surface |", "| --- | --- | --- | --- |"]
    each = {}
    for count in (len(RIGHT), 7):
        for name, places in (("the 27 of the grid", grid()), ("the 8 between", between())):
            found = distances(places, joints_of(count))
            each[count, name] = found
            lines.append(f"| {count} | {name} | {counts(found)[0]} | {counts(found)[1]} |")
    lines += ["", "| target | x | y | z | nearest with 4 joints [cm] | with 7 |", "| --- | --- | --- | --- | --- | --- |"]
    name = "the 27 of the grid"
    for number, (place, four, seven) in enumerate(zip(grid(), each[4, name], each[7, name], strict=True)):
        where = " | ".join(f"{value:.1f}" for value in place)
        lines.append(f"| {number} | {where} | {100.0 * four:.1f} | {100.0 * seven:.1f} |")
    return "\n".join(lines)


if __name__ == "__main__":
    sys.stdout.write(table() + "\n")
