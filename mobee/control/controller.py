# SPDX-License-Identifier: Apache-2.0
"""The MoBeE controller: a dynamical system for the motor positions, with an attractor and constraint forces (thesis 5.2)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NoReturn

import numpy as np
from numpy.typing import NDArray

from mobee._core import Table
from mobee._core.law import state_term_names, term_names
from mobee.arrays import Array, is_number
from mobee.control.forces import (
    Forces,
    Propagate,
    State,
    Term,
    checked,
    checked_force,
    forces_of,
    require_forces,
    require_pose_of,
    valid_terms,
)
from mobee.control.gains import Gains
from mobee.control.law import Command, Law, Modality, largest_step, require_stable
from mobee.control.reach_forces import ReachForces
from mobee.errors import InvalidValue, MobeeError, UnknownName
from mobee.model.engine import MAX_HANDS
from mobee.model.masses import gravity_torque
from mobee.reach import ReachTarget, checked_target
from mobee.robot.motor_units import motor_units

if TYPE_CHECKING:
    from mobee.model.model import Model, Reaching
    from mobee.model.pose import Pose

FOLLOW_TIME = 0.1  # s of the law's time for which the velocity of a moving goal is valid


class Controller:
    """Computes the motion of all motors by thesis eq. 5.7 and returns a command in every tick.

    The velocity in the equation is the controller's own state; only the position q comes from the encoders. The modality is the kind of
    command: "velocity" (as in the original program); "position", the integral of the controller's own velocity; "torque", which also
    compensates gravity if the robot's file has masses. Commands stay within the motors' limits of acceleration and of velocity (times
    `speed_scale`), so the gate (the last safety check before the motors) accepts them.

    The attractor q* may be outside the motors' limits: its spring pulls with at most the force `max_spring` of the gains, and the force
    `limits` pushes back. Plants (`mobee.plant.Plant`) refuse an attractor outside the limits.
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
        """Start at rest, with the attractor at the robot's home.

        Raises InvalidValue if `model`, `gains`, `speed_scale`, `alive` or `terms` is not valid. Raises UnknownName for an unknown modality
        or propagation, or if a pattern that was given to `Gains.with_motors` matches no motor of the robot.

        Args:
            model: the robot in its world; it evaluates contacts when `step` is given neither forces nor a pose.
            gains: numbers of the control law; None: `Gains.default()`.
            modality: the kind of the commands, "position", "velocity" or "torque".
            propagate: the motors on which a contact acts: "tree": all motors down to the base; "part": only those of the part that touches.
            speed_scale: fraction of the motors' largest speed that commands may use, above 0, at most 1.
            contact_forces: False: contacts cause no force (f_coll is 0).
            alive: (n,) True for the motors on which forces act; the others are never moved. None: all motors.
            terms: user-defined forces, added to the forces of the law. The largest stable time step `max_dt` is computed without them.
        """
        if not callable(getattr(model, "track", None)):  # other classes with the same methods are valid too
            raise InvalidValue(f"model is {model!r}; it must be a Model, as Model(robot, world).")
        if not isinstance(gains, Gains | None):
            raise InvalidValue(f"gains is {gains!r}; it must be Gains, as Gains.default() or Gains.named(name), or None.")
        if not (is_number(speed_scale) and 0 < speed_scale <= 1):
            raise InvalidValue(f"speed_scale {speed_scale!r}: must be above 0 and at most 1")
        if modality not in ("position", "velocity", "torque"):
            raise UnknownName("modality", modality, ("position", "velocity", "torque"))
        if propagate not in ("tree", "part"):
            raise UnknownName("propagation", propagate, ("tree", "part"))
        count = len(model.robot.motors)
        if alive is not None and not (isinstance(alive, np.ndarray) and alive.dtype == np.bool_ and alive.shape == (count,)):
            raise InvalidValue(f"alive is {alive!r}; it must be an array of {count} booleans, one for each motor, or None.")
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
        """The control law of this robot as tables for the core."""
        self.terms = valid_terms(terms)
        self.force_names = (*term_names(), *(term.name for term in self.terms))
        """The names of the forces in `last_forces`, in the order in which they are added."""
        self._reaches = ReachForces(self.robot, self.law)
        self._last_forces: Forces | Array
        self._attractor, self._state = self.robot.home.copy(), self.law.at_rest(self.robot.home)
        self.clear()
        self.reset(self.robot.home)

    def __reduce__(self) -> NoReturn:
        """Raise MobeeError: a copy (`copy.copy`, pickle) would share its state, which the compiled core changes, with the original."""
        raise MobeeError("a controller cannot be copied or pickled: the core holds its state. Make a new one, as Controller(model, gains).")

    @property
    def attractor(self) -> Array:
        """The position q* that attracts the motors, shape (n,), in [rad]; a copy.

        Assign an array to set it. This also ends the effect of `follow`: the new attractor does not move.
        """
        return self._attractor.copy()

    @attractor.setter
    def attractor(self, q: Array) -> None:
        self._attractor[:] = checked("attractor", q, len(self.robot.motors))
        self._state["goal_time"] = 0.0

    @property
    def velocity(self) -> Array:
        """The velocity q' of the control law's own state, shape (n,), in [rad/s]; a copy. It is not measured."""
        own: Array = self._state["velocity"].copy()
        return own

    @property
    def acceleration(self) -> Array:
        """The commanded acceleration of the last step, shape (n,), in [rad/s^2]; a copy."""
        own: Array = self._state["acceleration"].copy()
        return own

    @property
    def state(self) -> Table:
        """The state of the control law: a table with one row for each motor, always the same array.

        Its columns are those of `mobee._core.law.STATE`: velocity, acceleration, position reference and others. The law and the plants
        change it in place.
        """
        return self._state

    @property
    def goal(self) -> Array:
        """The attractor q*, shape (n,), in [rad]. It is the controller's own array and not a copy, so it always has the present values."""
        return self._attractor

    @property
    def last_forces(self) -> Forces:
        """The constraint forces of the last step by name, with the forces of user-defined terms, each (n,) rad/s^2; 0 after `reset`."""
        known = self._last_forces
        return known if isinstance(known, Forces) else Forces(**dict(zip(self.force_names, known.copy(), strict=True)))

    def note_forces(self, forces: Array) -> None:
        """Store the forces that `last_forces` returns: (number of forces, n) rad/s^2, one row for each name in `force_names`.

        The array is not copied: if the caller changes it later, `last_forces` shows the new values.
        """
        self._last_forces = forces

    @property
    def pushed(self) -> bool:
        """Whether `push` was called since the last `clear`. The pushed forces are projected to the motors in each step."""
        return bool(self._pushes)

    @property
    def reaches(self) -> ReachForces:
        """The reaches in progress: forces that pull a marker to a target, begun by `reach_toward`."""
        return self._reaches

    def client_force(self, q: Array) -> Array:
        """Return the force of the client (the caller of `force` and `push`) at q (n,) rad: f_config + f_work, (n,) rad/s^2.

        f_config (thesis eq. 5.9) is the force given to `force`. f_work (eq. 5.10) is the sum of the forces given to `push`, projected to
        the motors. Each is bounded, and 0 if no such force was given.
        """
        total = np.zeros(len(q))
        if self._pushes or self.forced:
            self._add_client(q, total)
        return total

    def set_attractor(self, part: str, q: Array) -> None:
        """Set the attractor of one part, (n_part,) rad, as a goal that does not move.

        Raises UnknownName for an unknown part, InvalidValue for a wrong shape or numbers that are not finite.
        """
        where = self.robot.part(part)
        self._attractor[where.slice] = checked(f"attractor of {part}", q, len(where))
        self._state["goal_time"][where.slice] = 0.0

    def follow(self, part: str, q: Array, velocity: Array) -> None:
        """Set the attractor of one part to a goal that moves with a known velocity.

        The damping of eq. 5.7 then acts on the velocity relative to the goal, C (q' - q*'), so that the part follows without a lag. If the
        sum of all other forces on a motor opposes the goal's velocity q*', only a fraction of q*' is used; it decreases linearly with the
        force and is 0 from 0.25 rad/s^2 on, so that the motor then moves as for a goal at rest. Call this at least every FOLLOW_TIME (0.1 s
        of the control law's time); later the goal counts as not moving. Raises UnknownName for an unknown part, InvalidValue for a wrong
        shape or numbers that are not finite.

        Args:
            part: name of the part.
            q: (n_part,) rad, present position of the goal.
            velocity: (n_part,) rad/s, velocity of the goal.
        """
        where = self.robot.part(part)
        moving = checked(f"velocity of {part}", velocity, len(where))
        self.set_attractor(part, q)
        self._state["goal_velocity"][where.slice], self._state["goal_time"][where.slice] = moving, FOLLOW_TIME

    def force(self, f: Array) -> None:
        """Apply a client's force f to the motors until the next call or `clear` (thesis eq. 5.9).

        `f`: (n,) rad/s^2, or m/s^2 for a motor that slides. Raises InvalidValue for a wrong shape, and for numbers that are not finite or
        above LARGEST_FORCE (1e9) in size.
        """
        self._client = checked_force("force", f, len(self.robot.motors))
        self.forced = bool(self._client.any())

    def push(self, marker: str, f: Array) -> None:
        """Apply a client's force to a marker until the next call for this marker, or `clear` (thesis eq. 5.10).

        `f`: force (3,), or force and moment (6,), in the root frame. It is given per unit mass, so that J^T f is the acceleration of the
        motors in rad/s^2, before it is bounded (thesis eq. 5.8). Raises UnknownName for an unknown marker, and InvalidValue for a wrong
        shape, or for numbers that are not finite or above LARGEST_FORCE (1e9) in size.
        """
        self.robot.marker(marker)
        self._pushes[marker] = checked_force(f"push on {marker}", f, 6 if len(np.atleast_1d(f)) == 6 else 3)

    def clear(self) -> None:
        """End the forces of `force` and of all calls of `push`. Forces that pull a marker to a target (`reach_toward`) continue."""
        self._client, self.forced = np.zeros(len(self.robot.motors)), False
        self._pushes: dict[str, Array] = {}

    def reach_toward(self, part: str | None, marker: str, target: ReachTarget) -> None:
        """Pull a marker to a target with the motors of one part, until the next call for this part or `end_reach` (thesis 8.2).

        The spring of the attractor and all other forces act at the same time. `part` None: pull with all motors that move the marker.
        Raises UnknownName for an unknown part or marker, InvalidValue if the target is no `ReachTarget`, or if the marker is moved by none
        of the motors that may move; then nothing changes.
        """
        checked_target(target)
        if self._reaches.marker(part) != marker:
            self._reaches.begin(part, marker)
        self._reaches[part].aim(target)

    def end_reach(self, part: str | None) -> None:
        """End the reach of a part (None: the reach of the whole body). Without such a reach nothing happens."""
        if part is not None:
            self.robot.part(part)
        self._reaches.end(part)

    def is_approaching(self, part: str | None) -> bool:
        """Return whether the reach of a part (None: of the whole body) still moves its marker nearer to the target.

        An action with a reach is over only when this is False. It is always False without a reach, and with the gains of 2014
        (`Gains.published_2014`).
        """
        return self._reaches.is_approaching(part)

    def reset(self, q: Array) -> None:
        """Set the control law to rest at the measured q (n,) rad: velocity of the law's state 0, attractor and position reference at q.

        Forces given to `force` and `push`, and those that pull a marker to a target (`reach_toward`), continue.
        """
        q = checked("q", q, len(self.robot.motors))
        self._attractor[:] = q
        self._state[:] = self.law.at_rest(q)
        self.note_forces(np.zeros((len(self.force_names), len(q))))

    def hold(self, part: str, q: Array) -> None:
        """Stop a part: set its velocity in the control law's state to 0, and its attractor to its measured position q (n_part,) rad.

        The commanded velocity then decreases as fast as the acceleration limit allows. Forces given to `force` and `push`, and those that
        pull a marker to a target (`reach_toward`), continue, and move the part again: end them too (`clear`, `end_reach`).
        """
        self.set_attractor(part, q)
        where = self.robot.part(part).slice
        self._state["velocity"][where] = self._state["acceleration"][where] = 0.0

    def rest(self, part: str, q: Array) -> None:
        """Set one part to rest at its measured q (n_part,) rad, as `reset` does for all parts. Use it if the motors do not follow commands.

        The next commands start from velocity 0 and from the position q. After `hold`, in contrast, they continue from the last commands.
        Forces given to `force`, `push` and `reach_toward` continue, as in `hold`.
        """
        self.set_attractor(part, q)
        where = self.robot.part(part).slice
        self._state[where] = self.law.at_rest(self._attractor)[where]

    def forces(self, pose: Pose) -> Forces:
        """Return the constraint forces of the control law at a pose, for the present state of the law.

        The forces of user-defined terms are not included; `own_forces` returns them. Raises InvalidValue for a batch of poses, or a pose
        of another robot.
        """
        if getattr(pose, "robot", None) is not self.robot:
            require_pose_of(self.robot, pose)
        return forces_of(self.law, pose, self.propagate, self._state)

    def own_forces(self, q: Array, dt: float, pose: Pose | None = None, reaching: Reaching = None) -> dict[str, Array]:
        """Return a dict from the name of each user-defined term to its force, (n,) rad/s^2, at the measured q (n,) rad in a tick of dt [s].

        `pose`: the robot at q; None: evaluated when a term reads it. `reaching`: names of the markers that reach for a target. If the pose
        is evaluated here, contacts of the hands of these markers with targets are ignored. Raises InvalidValue, with the name of the term,
        if a term fails.
        """
        if not self.terms:
            return {}
        state = State(self.robot, q, self.velocity, dt, lambda: self._track.evaluate(q, reaching) if pose is None else pose)
        found = {term.name: np.zeros(len(q)) for term in self.terms}
        for term in self.terms:
            found[term.name][self.law.live] = term.force(state)[self.law.live]
        return found

    def step(self, q: Array, dt: float, forces: Forces | None = None, pose: Pose | None = None) -> Command:
        """Advance the control law by dt [s] from the measured q (n,) rad and return the command (thesis eq. 5.7).

        `forces`: the constraint forces at q; None: computed from `pose`, the robot at q. Without a pose the model evaluates q, and contacts
        of the hands of the first two reaches with targets are ignored. Forces that depend on the law's state, and those of the user-defined
        terms, are computed if `forces` does not contain them. Forces of the client and of reaches are added. Raises InvalidValue for a dt
        at which the law is unstable (`max_dt` or more), for a q that is not finite, for forces that are not finite, of another shape or
        whose sum is above LARGEST_FORCE (1e9 rad/s^2), and for a pose of another robot.
        """
        try:
            is_stable = 0 < dt < self.max_dt
        except TypeError:  # dt is no number
            is_stable = False
        if not is_stable:
            require_stable(self.robot, self.gains, dt)
        n = len(self._attractor)
        q = checked("q", q, n)
        if forces is None:
            pose = self._evaluated(q) if pose is None else pose
            forces = self.forces(pose)
        else:
            require_forces(forces, n)
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
        """Return the given forces with those that are missing: of the user's `terms`, and of all terms that depend on the law's state."""
        more = self.own_forces(q, dt, pose, self._reaches.markers[:MAX_HANDS])
        if any(name not in forces for name in state_term_names()):
            more |= self.forces(self._evaluated(q) if pose is None else pose)
        return Forces(**{**more, **forces})

    def _evaluated(self, q: Array) -> Pose:
        """Return the pose at q; its contacts leave out those between a target and a hand that is reaching."""
        return self._track.evaluate(q, self._reaches.markers[:MAX_HANDS]) if self._reaches else self._track.evaluate(q)

    def _add_client(self, q: Array, total: Array) -> None:
        """Add the client's forces to `total` (n,) rad/s^2, in place: f_config on the motors (thesis eq. 5.9), f_work on markers (eq. 5.10).

        f_work is projected to the motors by the Jacobian and, for a motor that slides, converted to its unit, as for a contact. Then each
        of the two is bounded separately (`Law.add_client`).
        """
        self.law.add_client(self._client, total)
        if self._pushes:
            projected = sum((self.model.jacobian(q, m)[: len(f)].T @ f for m, f in self._pushes.items()), np.zeros(len(q)))
            self.law.add_client(projected * motor_units(self.robot) ** 2, total)
