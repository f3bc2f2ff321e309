"""The MoBeE controller: a dynamical system between an attractor and the forces that constrain it (thesis 5.2)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mobee.control.collision import Propagate
from mobee.control.dynamics import acceleration, largest_step, require_stable
from mobee.control.forces import Forces, constraint_forces
from mobee.control.gains import Gains
from mobee.control.modality import Command, Modality, torque
from mobee.control.squash import squash, squash_norm
from mobee.errors import InvalidValue
from mobee.robot.robot import Array

if TYPE_CHECKING:
    from mobee.model import Model, Pose

INSIDE = 0.999  # of the velocity and acceleration limits, so that no rounding on the way makes the gate refuse
LEASH = 0.3  # s at full speed: how far the position reference may run ahead of a motor that something blocks


class Controller:
    """Eq. 5.7 over all motors of a robot, every tick a command.

    The velocity in the law is the controller's own state; only q comes from the encoders.  Velocity commands are the
    original modality; position commands integrate the controller's own reference; torque commands do not
    compensate gravity yet.  The motors' limits on velocity (times `speed_scale`, 0 to 1) and
    acceleration are kept here, so that the robot's safety gate has nothing to refuse.
    """

    def __init__(
        self,
        model: Model,
        gains: Gains | None = None,
        modality: Modality = "velocity",
        propagate: Propagate = "tree",
        speed_scale: float = 1.0,
        contact_forces: bool = True,
    ) -> None:
        if not callable(getattr(model, "track", None)):  # who brings a model of their own is welcome
            raise InvalidValue(f"model is {model!r}; it must be a Model, as Model(robot, world).")
        if not isinstance(gains, Gains | None):
            raise InvalidValue(f"gains is {gains!r}; it must be Gains, as Gains.default() or Gains.named(name), or None.")
        if not 0 < speed_scale <= 1:
            raise InvalidValue(f"speed_scale {speed_scale}: must be above 0 and at most 1")
        self.model = model
        self._track = model.track()
        self.robot = model.robot
        self.gains = gains if gains is not None else Gains.default()
        self.modality: Modality = modality
        self.propagate: Propagate = propagate
        self.contact_forces = contact_forces
        self.max_dt = largest_step(self.gains)
        motors = self.robot.motor_table
        self.weight = self.gains.weight(self.robot.motors)
        self._max_velocity = INSIDE * speed_scale * np.array([m.max_velocity for m in motors])
        self._max_acceleration = INSIDE * np.array([m.max_acceleration for m in motors])
        self._max_torque = np.array([m.max_torque for m in motors])
        self._client = np.zeros(len(motors))
        self._pushes: dict[str, Array] = {}
        self.reset(self.robot.home)

    @property
    def attractor(self) -> Array:
        """q*, shape (n,), in [rad]: a copy."""
        return self._attractor.copy()

    @attractor.setter
    def attractor(self, q: Array) -> None:
        self._attractor = self._checked("attractor", q, len(self.robot.motor_table))

    def set_attractor(self, part: str, q: Array) -> None:
        """Set the slice of q* that belongs to a part: (n_part,) rad."""
        where = self.robot.part(part)
        self._attractor[where.slice] = self._checked(f"attractor of {part}", q, len(where))

    def force(self, f: Array) -> None:
        """Apply a force in configuration space, (n,) rad/s^2, until the next or `clear` (thesis 5.2.2); it is squashed."""
        self._client = self._checked("force", f, len(self.robot.motor_table))

    def push(self, marker: str, f: Array) -> None:
        """Apply a force (3,), root frame, to a marker until the next or `clear` (thesis 5.2.3).

        Per unit mass: J^T f is in rad/s^2 before it is squashed.
        """
        self.robot.marker(marker)
        self._pushes[marker] = self._checked(f"push on {marker}", f, 3)

    def clear(self) -> None:
        """End all forces of the client."""
        self._client = np.zeros(len(self.robot.motor_table))
        self._pushes.clear()

    def reset(self, q: Array) -> None:
        """Start from rest at the measured q (n,) rad: own velocity 0, attractor and position reference at q."""
        q = self._checked("q", q, len(self.robot.motor_table))
        self._attractor = q.copy()
        self._reference = q.copy()
        self.velocity = np.zeros(len(q))
        self.acceleration = np.zeros(len(q))
        self.last_forces = Forces(np.zeros(len(q)), np.zeros(len(q)), np.zeros(len(q)))
        self._sent = np.zeros(len(q))

    def hold(self, part: str, q: Array) -> None:
        """Stay where the part is: own velocity 0 and attractor at its measured q (n_part,) rad.

        The commanded velocity follows as fast as the acceleration limit lets it.
        """
        self.set_attractor(part, q)
        still = np.zeros(len(self.velocity), dtype=bool)
        still[self.robot.part(part).slice] = True
        self.velocity = np.where(still, 0.0, self.velocity)
        self.acceleration = np.where(still, 0.0, self.acceleration)

    def rest(self, part: str, q: Array) -> None:
        """Have a part that something else keeps still begin anew, as `reset` does for all; q (n_part,) rad measured.

        Unlike `hold` the commanded velocity starts from 0 and the position reference from q.
        """
        self.hold(part, q)
        where = self.robot.part(part).slice
        self._sent, self._reference = self._sent.copy(), self._reference.copy()
        self._sent[where], self._reference[where] = 0.0, self._attractor[where]

    def forces(self, pose: Pose) -> Forces:
        """The constraint forces at a pose, as `step` computes them when it is given none."""
        return constraint_forces(pose, self.gains, self.propagate, self.contact_forces)

    def step(self, q: Array, dt: float, forces: Forces | None = None) -> Command:
        """Advance the law by dt [s] from the measured q (n,) rad; `forces` None: computed with the model.

        Raises InvalidValue for a dt at which the gains are unstable (`max_dt` and above) and for a q that is
        not finite.
        """
        if not dt < self.max_dt or dt <= 0:
            require_stable(self.gains, dt)
        q = self._checked("q", q, len(self.robot.motor_table))
        if forces is None:
            forces = self.forces(self._track.evaluate(q))
        a = acceleration(q, self.velocity, self._attractor, forces.total + self._client_forces(q), self.gains)
        wanted = (self.weight * (self.velocity + a * dt)).clip(-self._max_velocity, self._max_velocity)
        change = self._max_acceleration * dt
        velocity = self._sent + (wanted - self._sent).clip(-change, change)
        self.acceleration = (velocity - self.velocity) / dt
        self.velocity = velocity
        self._sent = velocity
        self.last_forces = forces
        return self._command(q, dt)

    def _command(self, q: Array, dt: float) -> Command:
        lead = self._reference - q
        blocked = (np.abs(lead) > LEASH * self._max_velocity) & (lead * self.velocity > 0)
        reference = self._reference + np.where(blocked, 0.0, self.velocity * dt)
        self._reference = reference.clip(self.robot.limits[:, 0], self.robot.limits[:, 1])
        limited = torque(self.velocity, self.acceleration).clip(-self._max_torque, self._max_torque)
        return Command(self._reference, self.velocity, limited)

    def _client_forces(self, q: Array) -> Array:
        """f_config and f_work (thesis eqs. 5.9-5.10)."""
        total = self._bounded(self._client) if self._client.any() else np.zeros(len(q))
        if self._pushes:
            projected = sum((self.model.jacobian(q, m)[:3].T @ f for m, f in self._pushes.items()), np.zeros(len(q)))
            total = total + self._bounded(projected)
        return total

    def _bounded(self, f: Array) -> Array:
        g = self.gains
        if g.law == "default":
            return squash(f, g.max_client, g.client_slope)
        return np.concatenate([squash_norm(f[p.slice], g.max_client, g.client_slope) for p in self.robot.parts.values()])

    @staticmethod
    def _checked(what: str, value: Array, length: int) -> Array:
        array = np.array(value, dtype=float)
        if array.shape != (length,) or not np.isfinite(array).all():
            raise InvalidValue(f"{what} of shape {array.shape}: must be {length} finite numbers")
        return array
