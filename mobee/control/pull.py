"""The pull of a marker toward a target through the Jacobian transpose (thesis eq. 5.5), and what bounds its stiffness."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mobee.errors import InvalidValue
from mobee.real_array import real_array
from mobee.robot.robot import Array

if TYPE_CHECKING:
    from mobee.model import Model

ARM = 0.1  # m: a normal that is wrong by an angle counts as a position that is wrong by this times the angle


@dataclass(frozen=True, slots=True, eq=False)
class Target:
    """Where a marker is to go, (3,) m, and where its normal is to point, (3,) unit vector or None; root frame."""

    marker: str
    position: Array
    normal: Array | None


@dataclass(frozen=True, slots=True, eq=False)
class Pull:
    """A target as seen from poses q (..., n): what is missing, and how the marker moves.

    Three rows, or six where a normal is asked for: these are in rad times ARM, so that all rows are in m.
    """

    position: Array  # (..., 3) m, of the marker
    distance: Array  # (...,) m, to the target
    angle: Array  # (...,) rad, between the normals; 0 where none is asked for
    error: Array  # (..., rows) m, toward the target
    rows: Array  # (..., rows, n) m/rad, the marker's Jacobian
    turning: Array  # (..., 3, n), its angular rows as they are

    @property
    def torque(self) -> Array:
        """J^T dx (thesis eq. 5.5), (..., n) in [m^2/rad]: the way in which the error falls fastest."""
        found: Array = (np.swapaxes(self.rows, -1, -2) @ self.error[..., None])[..., 0]
        return found


def checked_target(model: Model, marker: str, position: Array, normal: Array | None) -> Target:
    """A target, or InvalidValue or UnknownName for what is none."""
    model.robot.marker(marker)
    where = real_array("position of the target", position)
    if where.shape != (3,) or not np.isfinite(where).all():
        raise InvalidValue(f"position {position!r} of the target: must be three finite numbers, m in the root frame")
    if normal is None:
        return Target(marker, where, None)
    direction = real_array("normal of the target", normal)
    length = float(np.linalg.norm(direction)) if direction.shape == (3,) else 0.0
    if not 0.0 < length < np.inf:
        raise InvalidValue(f"normal {normal!r} of the target: must be three finite numbers, not all 0")
    return Target(marker, where, direction / length)


def pull(model: Model, target: Target, q: Array) -> Pull:
    """The target as seen from the poses q (..., n) rad."""
    pose = model.evaluate(q)
    position = pose.position(target.marker)
    way = target.position - position
    distance = np.sqrt((way * way).sum(axis=-1))
    jacobian = model.jacobian(q, target.marker)
    turning = jacobian[..., 3:, :]
    if target.normal is None:
        return Pull(position, distance, np.zeros(q.shape[:-1]), way, jacobian[..., :3, :], turning)
    normal = pose.normal(target.marker)
    turn = np.cross(normal, target.normal)
    angle = np.arctan2(np.sqrt((turn * turn).sum(axis=-1)), normal @ target.normal)
    rows = jacobian * np.array([[1.0], [1.0], [1.0], [ARM], [ARM], [ARM]])
    return Pull(position, distance, angle, np.concatenate([way, ARM * turn], axis=-1), rows, turning)


def bend(found: Pull, force: Array, ease: Array) -> float:
    """A bound on what the bending of the marker's path adds to the stiffness of a force (rows,), at one pose.

    For joints i before j the path's second derivative is the axis of i times the Jacobian's column j; `ease` (n,) says how much
    each motor gives way.
    """
    levers = float(np.sqrt((found.rows[:3] ** 2).sum(axis=0) @ ease))
    axes = float(np.sqrt((found.turning**2).sum(axis=0) @ ease))
    push, twist = np.linalg.norm(force[:3]), np.linalg.norm(force[3:])
    return float(push * levers * axes + ARM * twist * axes * axes)
