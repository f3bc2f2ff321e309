"""Algorithm 5 of the thesis: reaching with the Jacobian transpose, as a path computed in advance."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from mobee.control.pull import bend, checked_target, pull
from mobee.errors import InvalidValue
from mobee.real_array import real_array
from mobee.robot.robot import Array

if TYPE_CHECKING:
    from mobee.model import Model

STILL = 1e-7  # m (and, times the arm of a normal, rad): a step that moves the marker less is none
TINY = 1e-12  # m^2, stiffness of a marker that nothing moves


@dataclass(frozen=True, slots=True, eq=False)
class ReachPath:
    """A piecewise linear path from the start to where the algorithm ended."""

    q: Array  # (steps + 1, n) rad
    end: Literal["reached", "stuck", "steps used up"]
    distance: float  # m, of the marker from the target at the end
    angle: float  # rad, between the normals at the end


def reach_path(
    model: Model,
    marker: str,
    position: Array,
    start: Array,
    normal: Array | None = None,
    tolerance: float = 1e-3,
    steps: int = 2000,
) -> ReachPath:
    """Draw a marker to a target, steps of alpha J^T dx (thesis algorithm 5); kinematics alone, nothing keeps it from touching.

    `position` (3,) m and `normal` (3,) root frame, `start` (n,) rad, `tolerance` m, and rad for the normal.  The thesis leaves alpha
    open: here it is one over the largest eigenvalue of J J^T and of what the bend of the path adds, so that no step overshoots;
    every step ends within the motors' limits.
    Ends "stuck" where a step moves nothing: the target is out of reach, limits are in the way, or the pose is singular.
    """
    target = checked_target(model, marker, position, normal)
    if not (tolerance > 0 and steps > 0):
        raise InvalidValue(f"tolerance {tolerance} and {steps} steps: both must be above 0")
    low, high = model.robot.limits.T
    path = [real_array("start", start)]
    here = pull(model, target, path[0])
    end: Literal["reached", "stuck", "steps used up"] = "steps used up"
    while True:
        if here.distance <= tolerance and here.angle <= tolerance:
            end = "reached"
            break
        if len(path) > steps:
            break
        stiffness = np.linalg.eigvalsh(here.rows @ here.rows.T)[-1] + bend(here, here.error, np.ones(len(low)))
        alpha = 1.0 / max(float(stiffness), TINY)
        q = np.clip(path[-1] + alpha * here.torque, low, high)
        there = pull(model, target, q)
        moved = np.linalg.norm(there.position - here.position) + abs(there.angle - here.angle)
        if moved < STILL:
            end = "stuck"
            break
        path.append(q)
        here = there
    return ReachPath(np.array(path), end, float(here.distance), float(here.angle))
