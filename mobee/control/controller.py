# SPDX-License-Identifier: Apache-2.0
"""The MoBeE controller: a dynamical system that an attractor pulls and forces constrain (thesis 5.2)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from mobee._core.law import state_term_names, term_names
from mobee._core.tables import Table
from mobee.arrays import Array
from mobee.control.forces import Forces, Propagate, checked, checked_force, forces_of
from mobee.control.gains import Gains
from mobee.control.law import Command, Law, Modality
from mobee.control.reaches import Reaches
from mobee.control.stability import largest_step, require_stable
from mobee.control.terms import State, Term, valid_terms
from mobee.errors import InvalidValue, UnknownName
from mobee.model.masses import gravity_torque
from mobee.robot.motor_units import motor_units

if TYPE_CHECKING:
    from mobee.model.model import Model, Reaching
    from mobee.model.pose import Pose
    from mobee.reach import ReachTarget

FOLLOW_TIME = 0.1  # s of the law's time for which the velocity of a moving goal is valid


class Controller:
    """Integrates thesis eq. 5.7 over all motors of a robot and returns a command in every tick.

    The velocity in the law is the controller's own state; only q comes from the encoders. Velocity commands are the original modality;
    position commands integrate the controller's own reference; torque commands also compensate gravity if the robot's file has
    masses. Commands keep the motors' limits of velocity (times `speed_scale`, 0 to 1) and acceleration, so that the safety gate
    refuses none.

    An attractor may be outside the motors' limits: it pulls with at most `max_spring`, and the limits push back. The plants refuse
    such a goal.
    """

    __slots__ = (
        "_attractor", "_client", "_last_forces", "_pushes", "_reaches", "_state", "_track", "contact_forces", "force_names", "forced",
        "gains", "law", "max_dt", "modality", "model", "propagate", "robot", "terms", "weight",
    )  # fmt: skip

    def __init__(
        self,
        model: Model,
        gains: Gains | None = None,
        modality: Modality = "velocity",
        propagate: Propagate = "tree",
        speed_scale: float = 1.0,
        contact_forces: bool = True,
        alive: NDArray[np.bool_] | None = None,
        terms: Sequence[Term] = (),
    ) -> None:
        """Start at rest, with the attractor at the robot's home; raises InvalidValue and UnknownName.

        Args:
            model: evaluates contacts when `step` is given neither forces nor a pose.
            gains: of the law; None: the default ones.
            modality: of the commands.
            propagate: how far down the body a contact acts, "tree" or "part".
            speed_scale: share of the motors' largest speed that is used, above 0, at most 1.
            contact_forces: False leaves f_coll at zero.
            alive: (n,) the motors on which forces act; the others are never moved. None: all.
            terms: user-defined forces, added to those of the law; `max_dt` does not include them.
        """
        if not callable(getattr(model, "track", None)):  # other classes with the same methods are valid too
            raise InvalidValue(f"model is {model!r}; it must be a Model, as Model(robot, world).")
        if not isinstance(gains, Gains | None):
            raise InvalidValue(f"gains is {gains!r}; it must be Gains, as Gains.default() or Gains.named(name), or None.")
        if not 0 < speed_scale <= 1:
            raise InvalidValue(f"speed_scale {speed_scale}: must be above 0 and at most 1")
        if modality not in ("position", "velocity", "torque"):
            raise UnknownName("modality", modality, ("position", "velocity", "torque"))
        self.model = model
        self._track = model.track()
        self.robot = model.robot
        self.gains = gains if gains is not None else Gains.default()
        self.modality: Modality = modality
        self.propagate: Propagate = propagate
        self.contact_forces = contact_forces
        self.weight = self.gains.weight(self.robot.motors)
        self.max_dt = largest_step(self.robot, self.gains)
        self.law = Law(self.robot, self.gains, modality, speed_scale, contact_forces, alive)
        """The law as tables for the core."""
        self.terms = valid_terms(terms)
        self.force_names = (*term_names(), *(term.name for term in self.terms))
        """The names of the forces in `last_forces`, in the order in which they are added."""
        self._reaches = Reaches(self.robot, self.law)
        self._last_forces: Forces | Array
        self._attractor, self._state = self.robot.home.copy(), self.law.at_rest(self.robot.home)
        self.clear()
        self.reset(self.robot.home)

    @property
    def attractor(self) -> Array:
        """q*, shape (n,), in [rad]: a copy."""
        return self._attractor.copy()

    @attractor.setter
    def attractor(self, q: Array) -> None:
        self._attractor[:] = checked("attractor", q, len(self.robot.motors))
        self._state["goal_time"] = 0.0

    @property
    def velocity(self) -> Array:
        """The law's own velocity, shape (n,), in [rad/s]: a copy."""
        own: Array = self._state["velocity"].copy()
        return own

    @property
    def acceleration(self) -> Array:
        """The acceleration of the last step, shape (n,), in [rad/s^2]: a copy."""
        own: Array = self._state["acceleration"].copy()
        return own

    @property
    def state(self) -> Table:
        """The state of the law, a row for each motor (see `mobee._core.law.STATE`); always the same array, which plants change in place."""
        return self._state

    @property
    def goal(self) -> Array:
        """The attractor itself, shape (n,), in [rad]: always the same array, no copy."""
        return self._attractor

    @property
    def last_forces(self) -> Forces:
        """The constraint forces of the last step."""
        known = self._last_forces
        return known if isinstance(known, Forces) else Forces(**dict(zip(self.force_names, known.copy(), strict=True)))

    def note_forces(self, forces: Array) -> None:
        """Set `last_forces` to rows (forces, n) in the order of `force_names`.

        The rows are not copied: `last_forces` always shows their present values.
        """
        self._last_forces = forces

    @property
    def pushed(self) -> bool:
        """Whether a client pushes markers; such forces depend on the pose."""
        return bool(self._pushes)

    @property
    def reaches(self) -> Reaches:
        """The reaches in progress."""
        return self._reaches

    def client_force(self, q: Array) -> Array:
        """Return f_config + f_work at q (n,) rad, each bounded, (n,) rad/s^2 (thesis eqs. 5.9 and 5.10)."""
        total = np.zeros(len(q))
        if self._pushes or self.forced:
            self._add_client(q, total)
        return total

    def set_attractor(self, part: str, q: Array) -> None:
        """Set the attractor of one part, (n_part,) rad, which stands still; raises InvalidValue and UnknownName."""
        where = self.robot.part(part)
        self._attractor[where.slice] = checked(f"attractor of {part}", q, len(where))
        self._state["goal_time"][where.slice] = 0.0

    def follow(self, part: str, q: Array, velocity: Array) -> None:
        """Set the attractor of one part to a moving goal; call it at least every FOLLOW_TIME of the law's time, else the goal stands still.

        The damping of eq. 5.7 is relative to the goal's velocity, C (q' - q*'), so that the part follows without a lag.  A motor yields
        to forces that oppose this velocity: from 0.25 rad/s^2 on, only the spring pulls it.  Raises InvalidValue and UnknownName.

        Args:
            part: the part.
            q: (n_part,) rad, where the goal is now.
            velocity: (n_part,) rad/s, of the goal.
        """
        where = self.robot.part(part)
        moving = checked(f"velocity of {part}", velocity, len(where))
        self.set_attractor(part, q)
        self._state["goal_velocity"][where.slice], self._state["goal_time"][where.slice] = moving, FOLLOW_TIME

    def force(self, f: Array) -> None:
        """Apply a force on the motors, (n,) rad/s^2 or m/s^2, until the next call or `clear` (f of thesis eq. 5.9)."""
        self._client = checked_force("force", f, len(self.robot.motors))
        self.forced = bool(self._client.any())

    def push(self, marker: str, f: Array) -> None:
        """Apply a force (3,), or a force and a moment (6,), root frame, to a marker until the next call or `clear` (thesis eq. 5.10).

        It is per unit mass: J^T f is in rad/s^2 before it is bounded.
        """
        self.robot.marker(marker)
        self._pushes[marker] = checked_force(f"push on {marker}", f, 6 if len(np.atleast_1d(f)) == 6 else 3)

    def clear(self) -> None:
        """End `force` and all pushes; reaches continue."""
        self._client, self.forced = np.zeros(len(self.robot.motors)), False
        self._pushes: dict[str, Array] = {}

    def reach_toward(self, part: str | None, marker: str, target: ReachTarget) -> None:
        """Pull a marker to a target with the motors of one part, against its attractor, until the next call or `end_reach` (thesis 8.2).

        `part` None: with all motors that move the marker. Raises InvalidValue if no such motor may be moved, and UnknownName.
        """
        if self._reaches.marker(part) != marker:
            self._reaches.begin(part, marker)
        self._reaches[part].aim(target)

    def end_reach(self, part: str | None) -> None:
        """End the reach of a part, or of the whole body (None), if it has one."""
        if part is not None:
            self.robot.part(part)
        self._reaches.end(part)

    def is_approaching(self, part: str | None) -> bool:
        """Return whether the part's reach still moves its marker nearer to the target; it is over only when this is False."""
        return self._reaches.is_approaching(part)

    def reset(self, q: Array) -> None:
        """Start from rest at the measured q (n,) rad: own velocity 0, attractor and position reference at q."""
        q = checked("q", q, len(self.robot.motors))
        self._attractor[:] = q
        self._state[:] = self.law.at_rest(q)
        self.note_forces(np.zeros((len(self.force_names), len(q))))

    def hold(self, part: str, q: Array) -> None:
        """Stop a part: own velocity 0, attractor at its measured q (n_part,) rad.

        The commanded velocity follows as fast as the acceleration limit allows.
        """
        self.set_attractor(part, q)
        where = self.robot.part(part).slice
        self._state["velocity"][where] = self._state["acceleration"][where] = 0.0

    def rest(self, part: str, q: Array) -> None:
        """Reset one part to rest at its measured q (n_part,) rad, as `reset` does for all; for a part whose motors do not follow commands.

        Unlike after `hold`, the commanded velocity starts from 0 and the position reference from q.
        """
        self.set_attractor(part, q)
        where = self.robot.part(part).slice
        self._state[where] = self.law.at_rest(self._attractor)[where]

    def forces(self, pose: Pose) -> Forces:
        """Return the law's own constraint forces at a pose, as `step` computes them when it is given none."""
        return forces_of(self.law, pose, self.propagate, self._state)

    def own_forces(self, q: Array, dt: float, pose: Pose | None = None, reaching: Reaching = None) -> dict[str, Array]:
        """Return the forces of `terms` for a tick of dt [s] at the measured q (n,) rad; raises InvalidValue, which names the term.

        `pose` None: evaluated when a term reads it, with the markers that are `reaching` (see `Model.evaluate`).
        """
        if not self.terms:
            return {}
        state = State(self.robot, q, self.velocity, dt, lambda: self._track.evaluate(q, reaching) if pose is None else pose)
        found = {term.name: np.zeros(len(q)) for term in self.terms}
        for term in self.terms:
            found[term.name][self.law.live] = term.force(state)[self.law.live]
        return found

    def step(self, q: Array, dt: float, forces: Forces | None = None, pose: Pose | None = None) -> Command:
        """Advance the law by dt [s] from the measured q (n,) rad and return the command (thesis eq. 5.7).

        `forces`: the constraint forces; None: computed at `pose`, or with the model. Forces that depend on the law's state, and those of
        `terms`, are added if they are absent. Raises InvalidValue for a dt at which the gains are unstable (`max_dt` and above), for a q
        that is not finite, and for forces that are not finite or whose sum is beyond LARGEST_FORCE.
        """
        if not 0 < dt < self.max_dt:
            require_stable(self.robot, self.gains, dt)
        n = len(self._attractor)
        q = checked("q", q, n)
        if forces is None:
            pose = self._track.evaluate(q) if pose is None else pose
            forces = self.forces(pose)
        if not all(name in forces for name in self.force_names):
            forces = self._filled(forces, q, dt, pose)
        total = checked_force("forces", forces.total, n) + self.client_force(q)
        if self._reaches:
            self._reaches.add_forces(q, self._attractor, dt, total)
        if self.modality == "torque":
            self._state["feedforward"] = gravity_torque(self.robot, q)
        commands = self.law.step(q, dt, self._attractor, total, self._state)
        self._last_forces = forces
        return Command(*commands)

    def _filled(self, forces: Forces, q: Array, dt: float, pose: Pose | None) -> Forces:
        """Return the given forces, completed by the forces of `terms` and those that depend on the law's state."""
        more = self.own_forces(q, dt, pose)
        if any(name not in forces for name in state_term_names()):
            more |= self.forces(self._track.evaluate(q) if pose is None else pose)
        return Forces(**{**more, **forces})

    def _add_client(self, q: Array, total: Array) -> None:
        """Add f_config and f_work (thesis eqs. 5.9 and 5.10); for a motor that slides f_work is converted to its unit, as for a contact."""
        self.law.add_client(self._client, total)
        if self._pushes:
            projected = sum((self.model.jacobian(q, m)[: len(f)].T @ f for m, f in self._pushes.items()), np.zeros(len(q)))
            self.law.add_client(projected * motor_units(self.robot) ** 2, total)
