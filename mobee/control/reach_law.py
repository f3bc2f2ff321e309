"""The reach law: a marker of a part is drawn to a target through the Jacobian transpose, against the part's attractor (thesis 8.2)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mobee.robot.robot import Array, Ints

if TYPE_CHECKING:
    from mobee.model import Model
    from mobee.reach import ReachTarget

FORCE_GAIN = np.deg2rad(5000.0)  # rad/s^2 for a lever and a distance of 1 m; the 2014 program's 5000 are deg/s^2
TORQUE_GAIN = np.deg2rad(5000.0)  # the same, of a distance of 1 m to a normal that points the other way


@dataclass(frozen=True, slots=True, eq=False)
class Reaching:
    """A marker on its way to a target; `motors`: those that are pulled."""

    marker: str
    target: ReachTarget
    motors: Ints


def reach_torque(model: Model, reaching: Reaching, q: Array) -> Array:
    """J^T f at q (n,) rad before it is bounded, shape (n,) in [rad/s^2]."""
    target = reaching.target
    pose, jacobian = model.evaluate(q), model.jacobian(q, reaching.marker)[:, reaching.motors]
    way = target.position - pose.position(reaching.marker)
    distance = float(np.linalg.norm(way))
    if target.aim == "surface":
        way = way * max(0.0, 1.0 - target.radius / distance) if distance > 0.0 else way
    torque = np.zeros(len(q))
    torque[reaching.motors] = FORCE_GAIN * jacobian[:3].T @ way
    if target.normal is not None:
        normal = pose.normal(reaching.marker)
        turn = TORQUE_GAIN * np.linalg.norm(way) * 0.5 * (1.0 - normal @ target.normal) * np.cross(normal, target.normal)
        torque[reaching.motors] += jacobian[3:].T @ turn
    return torque
