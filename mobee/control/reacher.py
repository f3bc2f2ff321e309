"""Reaching as a force of the dynamical system: a marker is pulled toward a target, whatever else acts on the robot.

The thesis warns (5.1) that J^T control stops in singular poses and swings about targets that it cannot reach.  Both have a reason.

- It swings because commands are late and the pull's stiffness, as the motors feel it, differs with the pose: J J^T in some direction,
  and for a far target also the bend of the marker's path.  Here the force on the marker is what draws it at one RATE in every
  direction, (J E J^T + damping)^-1 dx with E how much the motors give way, and so weak that its bend is no faster than RATE.
- In a singular pose J^T f is zero, which is an equilibrium but need not be a rest: where the error falls on both sides along
  some motion (negative curvature) the attractor is put a little way along it.  Where there is none, or where it leads
  nowhere, the marker is as near as the robot can bring it, and rests.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

import numpy as np

from mobee.control.pull import ARM, Pull, checked_target, pull
from mobee.errors import InvalidValue
from mobee.real_array import real_array
from mobee.robot.motor_units import limit_zones, motor_units
from mobee.robot.robot import Array

if TYPE_CHECKING:
    from mobee.control.controller import Controller

RATE = 5.0  # 1/s: far below what swings with commands three ticks old at 100 Hz (docs/law.md)
LONGEST = 0.2  # m: beyond it the pull grows no more
DAMPING = 0.1  # of the largest eigenvalue of J E J^T
WEAK = 0.05  # of the error's force that arrives at the motors: below it the pose is singular, or as near as possible
NUDGE = 0.1  # rad, out of a singular pose
BEND = 1e-3  # of the largest eigenvalue: curvature that counts
SMOOTH = 0.25  # s, over which the error is averaged before it is judged
PATIENCE = 3.0  # s without coming nearer by the tolerance
_PROBE = 1e-4  # rad
_NOTHING = 1e-12  # m^2/s, what a marker gives that nothing moves

ReachStatus = Literal["reaching", "reached", "stuck"]


class Reacher:
    """Draws a marker of a controlled robot to a target; call `update` once a tick, before `Controller.step`.

    The motors that move the marker follow the pull: their attractor goes with them.  The others stay at theirs.  Nothing is
    done about obstacles but what the controller does.  `stop` when it is over.
    """

    __slots__ = ("_best", "_controller", "_seen", "_since", "_tolerance", "_way", "angle", "distance", "target")

    def __init__(self, controller: Controller, marker: str, position: Array, normal: Array | None = None, tolerance: float = 2e-3) -> None:
        """`position` (3,) m and `normal` (3,), root frame; `tolerance` m, in which an angle of the normal counts times 0.1 m."""
        if not 0 < tolerance < np.inf:
            raise InvalidValue(f"tolerance {tolerance} m: must be a finite distance above 0")
        self._controller = controller
        self.target = checked_target(controller.model, marker, position, normal)
        self._tolerance = tolerance
        self._way = np.zeros(len(controller.robot.motors))
        self._best, self._since = np.inf, 0.0  # m, and how long ago it was that much better, s
        self._seen = np.zeros(3 if normal is None else 6)  # m, the error without the encoders' noise
        self.distance = np.inf  # m, to the target, noise smoothed
        self.angle = 0.0  # rad, between the normals, at the last update

    def update(self, q: Array, dt: float) -> ReachStatus:
        """Pull from the measured q (n,) rad, dt [s] after the last update.

        "stuck" while the marker comes no nearer: the target is out of reach, or limits, clauses or contacts are in its way.  It
        is pulled all the same.
        """
        q = real_array("q", q)
        controller = self._controller
        found = pull(controller.model, self.target, q)
        self._seen += (found.error - self._seen) * (1.0 if np.isinf(self.distance) else min(1.0, dt / SMOOTH))
        self.distance, self.angle = float(np.linalg.norm(self._seen[:3])), float(found.angle)
        ease = self._ease(q, found.torque)
        give = (found.rows * ease) @ found.rows.T
        most = max(float(np.linalg.eigvalsh(give)[-1]), _NOTHING)
        missing = float(np.linalg.norm(self._seen))
        fading = missing / (missing + 0.5 * self._tolerance)  # so that at the target the encoders' noise is not followed
        error = fading * found.error / (1.0 + np.linalg.norm(found.error) / LONGEST)
        force = self._force(q, found, ease, give / most, RATE * error / most)
        controller.push(self.target.marker, np.concatenate([force[:3], ARM * force[3:]]))
        arrived = missing <= self._tolerance
        weak = float(error @ give @ error) < WEAK**2 * most * float(error @ error)
        if missing < self._best - self._tolerance:
            self._best, self._since = missing, 0.0
        self._since += dt
        stuck = self._since > PATIENCE
        nudge = self._way_out(q, ease, most) if weak and not (arrived or stuck) else 0.0
        moved = (np.abs(found.rows).max(axis=0) > 0) & (controller.weight > 0)
        controller.attractor = np.where(moved, q + nudge, controller.attractor)
        return "reached" if arrived else "stuck" if stuck else "reaching"

    def stop(self, q: Array) -> None:
        """End the pull; the motors stay at q (n,) rad."""
        controller = self._controller
        controller.push(self.target.marker, np.zeros(3))
        moved = np.abs(controller.model.jacobian(q, self.target.marker)).max(axis=0) > 0
        controller.attractor = np.where(moved, q, controller.attractor)

    def _ease(self, q: Array, torque: Array) -> Array:
        """How fast each motor goes for a torque of 1, (n,): slope of the squash over damping; 0 for one that a limit keeps."""
        c = self._controller
        of = {name: c.gains.of_robot(name, c.robot) for name in ("client_slope", "damping", "limit_width")}
        low, high = c.robot.limits.T + 0.5 * np.array([[1.0], [-1.0]]) * limit_zones(c.robot, of["limit_width"]).T
        kept = (q < low) & (torque < 0) | (q > high) & (torque > 0)
        ease: Array = np.where(kept | (c.weight == 0), 0.0, of["client_slope"] / of["damping"] * motor_units(c.robot) ** 2)
        return ease

    def _force(self, q: Array, found: Pull, ease: Array, give: Array, wanted: Array) -> Array:
        """The force on the marker: as much in every direction as gives RATE, less where the path's bend would make it swing."""
        free = np.flatnonzero(ease > 0)
        steps = np.zeros((len(free), len(q)))
        steps[np.arange(len(free)), free] = _PROBE
        ahead = pull(self._controller.model, self.target, q + steps).rows
        bend = (ahead - found.rows)[..., free] / _PROBE * np.sqrt(ease[free, None, None] * ease[free])  # (free, rows, free)
        damping = DAMPING
        while True:
            force: Array = np.asarray(np.linalg.solve(give + damping * np.eye(len(give)), wanted), dtype=np.float64)
            stiffness = -np.einsum("irj,r->ij", bend, force)
            if not len(free) or np.linalg.eigvalsh(stiffness + stiffness.T)[-1] < 2.0 * RATE:
                return force
            damping *= 2.0

    def _way_out(self, q: Array, ease: Array, most: float) -> Array:
        """From a pose that the pull does not move: the way along which the error falls on both sides, (n,) rad; 0 where there is none."""
        free = np.flatnonzero(ease > 0)
        steps = np.zeros((2, len(free), len(q)))
        steps[0, np.arange(len(free)), free], steps[1, np.arange(len(free)), free] = _PROBE, -_PROBE
        torques = pull(self._controller.model, self.target, q + steps).torque[..., free]
        curvature = (torques[1] - torques[0]) / (2.0 * _PROBE)
        values, ways = np.linalg.eigh(0.5 * (curvature + curvature.T) * np.sqrt(ease[free, None] * ease[free]))
        if not len(free) or values[0] > -BEND * most:
            return np.zeros(len(q))
        way = np.zeros(len(q))
        way[free] = ways[:, 0] * motor_units(self._controller.robot)[free]
        before = float(way @ self._way)
        middle = self._controller.robot.limits.mean(axis=1) - q
        self._way = way * np.sign(before if before else float(way @ middle) or 1.0)
        return NUDGE * self._way
