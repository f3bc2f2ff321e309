"""Algorithm 5 of the thesis: reaching with the Jacobian transpose, as a path computed in advance."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from mobee.errors import InvalidValue
from mobee.reach import ReachTarget
from mobee.real_array import real_array
from mobee.robot.robot import Array

if TYPE_CHECKING:
    from mobee.model import Model

ARM = 0.1  # m: a normal that is wrong by an angle counts as a position that is wrong by this times the angle
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
    model.robot.marker(marker)
    target = ReachTarget(position, normal=normal)
    if not (tolerance > 0 and steps > 0):
        raise InvalidValue(f"tolerance {tolerance} and {steps} steps: both must be above 0")
    low, high = model.robot.limits.T
    path = [real_array("start", start)]
    here = look(model, marker, target, path[0])
    end: Literal["reached", "stuck", "steps used up"] = "steps used up"
    while True:
        if here.distance <= tolerance and here.angle <= tolerance:
            end = "reached"
            break
        if len(path) > steps:
            break
        jacobian = model.jacobian(path[-1], marker)
        rows = jacobian[: len(here.error)] * here.arms[:, None]
        stiffness = float(np.linalg.eigvalsh(rows @ rows.T)[-1]) + bend(jacobian, here.error)
        alpha = 1.0 / max(stiffness, TINY)
        q = np.clip(path[-1] + alpha * rows.T @ here.error, low, high)
        there = look(model, marker, target, q)
        if np.linalg.norm(there.position - here.position) + abs(there.angle - here.angle) < STILL:
            end = "stuck"
            break
        path.append(q)
        here = there
    return ReachPath(np.array(path), end, here.distance, here.angle)


@dataclass(frozen=True, slots=True, eq=False)
class Look:
    """A target as seen from a pose, its radius left out."""

    position: Array  # (3,) m, of the marker
    error: Array  # (3,) m toward the target, or (6,): the normal is to turn about the last three, which count ARM m a rad
    angle: float  # rad, between the normals; 0 where none is asked for

    @property
    def distance(self) -> float:
        """From the marker to the target [m]."""
        return float(np.linalg.norm(self.error[:3]))

    @property
    def arms(self) -> Array:
        """What each row of the marker's Jacobian counts [m]: 1 or ARM."""
        return np.repeat([1.0, ARM], 3)[: len(self.error)]


def look(model: Model, marker: str, target: ReachTarget, q: Array) -> Look:
    """Look from q (n,) rad."""
    pose = model.evaluate(q)
    position = pose.position(marker)
    if target.normal is None:
        return Look(position, target.position - position, 0.0)
    normal = pose.normal(marker)
    turn = np.cross(normal, target.normal)
    angle = float(np.arctan2(np.linalg.norm(turn), normal @ target.normal))
    return Look(position, np.concatenate([target.position - position, ARM * turn]), angle)


def bend(jacobian: Array, error: Array) -> float:
    """A bound on what the bending of the marker's path adds to the stiffness of a pull by the error [m^2].

    For joints i before j the path's second derivative is the axis of i times the motion of j.
    """
    levers, axes = np.linalg.norm(jacobian[:3]), np.linalg.norm(jacobian[3:])
    return float(np.linalg.norm(error[:3]) * levers * axes + ARM * np.linalg.norm(error[3:]) * axes * axes)
