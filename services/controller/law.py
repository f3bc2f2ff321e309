# SPDX-License-Identifier: Apache-2.0
"""The control law of the whole robot in the controller; this file alone changes the law's state."""

from __future__ import annotations

import numpy as np

from bus_schema import VERSION, decode, encode, encoding_of
from bus_schema.messages import Forces as ForcesMessage
from bus_schema.messages import Tick
from bus_schema.rpc import ReachFor
from mobee import Controller, Gains, Model
from mobee.arrays import Array
from mobee.control import Command, Forces
from mobee.control.forces import needs_contacts
from mobee.errors import InvalidValue
from mobee.model.contact import links_moved
from mobee.reach import ReachTarget
from mobee.robot.motor_units import fine_units
from mobee.robot.robot import Robot
from services.common.bus import Bus
from services.common.exit_codes import BAD_INPUT
from services.controller.config import Config
from services.controller.forces import ModelForces, PublishedContacts, load_terms

WARM_UP_TICK = 0.01  # s


class RobotLaw:
    """Keeps the state of the control law and all its inputs: measured positions, forces of model and clients, attractors, reaches.

    The attractor of a part is the posture to which the springs of the control law pull it. The other objects of the controller change the
    law only by these methods.
    """

    def __init__(self, bus: Bus, config: Config, robot: Robot) -> None:
        """Start at rest at home, and run every code path of a reach once, so that the first real reach is not delayed."""
        self._bus, self._config, self._robot = bus, config, robot
        model = Model(robot)  # without a world: contacts come from the model service
        gains = Gains.named(config.gains)
        self._law = Controller(model, gains, config.modality, speed_scale=config.speed_scale, terms=load_terms(config.terms))
        self._needs_contacts = bool(self._law.terms) or needs_contacts()
        self.forces = ModelForces(robot, self._needs_contacts)
        self.max_dt = self._law.max_dt  # s, longest tick for which the gains are stable
        self.q: Array = robot.home  # (n,) rad, measured at the newest tick
        self._where = {name: part.slice for name, part in robot.parts.items()}
        self._units = fine_units(robot)
        self._torques = np.array([motor.max_torque for motor in robot.motor_table])
        self._client_forces = np.zeros(len(robot.motors))
        self._pushes: dict[str, dict[str, Array]] = {}  # part -> marker -> (3,)
        self._own_terms = bus.publisher(ForcesMessage, "controller", "LATEST")
        self._last_k = -1  # last tick of this run in which the law was used
        self._last_tick: Tick | None = None  # that of the last step, while the step can be repeated
        warm_up(self._law, robot)
        self._state_before = self._law.state.copy()  # before the last step

    # Ticks

    def reset(self) -> None:
        """Reset the control law at the start of a run: the robot is at rest at home, and the model's forces of the last run are dropped."""
        self.forces.forget()
        self._last_k, self._last_tick = -1, None
        self._law.reset(self._robot.home)

    def measure(self, q: Array) -> None:
        """Store the measured positions q (n,) rad of all motors; call this at the start of a tick."""
        self.q, self._last_tick = q, None

    def count_ticks(self, k: int) -> int:
        """Return the number of ticks since the previous call of this method, at least 1; 1 at the first call in a run.

        `k`: number of the present tick.
        """
        ticks = max(k - self._last_k, 1) if self._last_k >= 0 else 1
        self._last_k = k
        return ticks

    def step(self, tick: Tick, ticks: int) -> Array:
        """Advance the control law by `ticks` steps; return the reference (n,): rad, rad/s or N m, by the modality in the settings.

        `tick`: the newest `Tick` message, which contains the duration of one step. `ticks`: more than 1 if ticks were missed.
        """
        for _ in range(ticks):
            self._state_before = self._law.state.copy()
            command = self._step(tick)
        self._last_tick = tick
        return self._reference(command)

    def repeat_step(self) -> Array | None:
        """Compute the last step again, with the requests that clients have made since then; return the new reference (n,).

        The reference is in rad, rad/s or N m, by the modality in the settings. None: no step was made since the last call of `measure`,
        `brake` or `reset`, so that none can be repeated.
        """
        if self._last_tick is None:
            return None
        self._law.state[:] = self._state_before
        return self._reference(self._step(self._last_tick))

    def _step(self, tick: Tick) -> Command:
        """Advance the law by one step under the forces of the model; user-defined terms get the model's contacts."""
        dt, forces = tick.dt / 1e9, self.forces.vectors
        if not self._needs_contacts:
            return self._law.step(self.q, dt, forces)
        pose = self._law.model.evaluate(self.q)
        pose.compute_contacts(PublishedContacts(pose, self.forces.contacts))
        try:
            command = self._law.step(self.q, dt, forces, pose)
        except InvalidValue as error:  # a restart would fail at the same term
            self._bus.event("error", "term", str(error))
            raise SystemExit(BAD_INPUT) from None
        if self._own_terms.has_subscribers:
            own = {name: row.tolist() for name, row in self._law.last_forces.items() if name not in forces}
            self._own_terms.put(re_k=tick.k, terms=own, part_age={}, touched={})
        return command

    def _reference(self, command: Command) -> Array:
        reference: Array = getattr(command, self._config.modality)
        return np.clip(reference, -self._torques, self._torques) if self._config.modality == "torque" else reference

    def limit_torques(self, part: str, torques: Array) -> None:
        """Set the largest torques of the part's motors, (n_part,) N m, which can differ from those in the robot's file."""
        self._torques[self._where[part]] = torques

    # One part

    def rest(self, part: str) -> None:
        """Put the part at rest in the control law's state: commanded velocity 0, attractor at the measured position.

        Call this while the motors of the part do not follow the law's commands, and when they begin to follow them again. The attractor is
        the posture to which the springs of the control law pull the part.
        """
        self._law.rest(part, self.q[self._where[part]])

    def brake(self, part: str) -> None:
        """Stop a part that has no owner: it brakes and stays, or moves to the posture in the settings, if there is one.

        The owner is the service that may set the part's attractor. Nothing happens before the first step of a run.
        """
        if self._last_k >= 0:
            self._law.hold(part, self.q[self._where[part]])
            self._last_tick = None
            self.seek_posture(part)

    def seek_posture(self, part: str) -> None:
        """Set the attractor of a part to the part's posture in the settings; nothing happens if the settings have none.

        Call this only for a part that has no owner (a service that may set its attractor): the method does not check this.
        """
        if part in self._config.posture:
            self._law.set_attractor(part, np.array(self._config.posture[part]))

    def set_attractor(self, part: str, target: Array) -> None:
        """Set the attractor of the part, the posture to which the springs of the control law pull it, to `target` (n_part,) rad."""
        self._law.set_attractor(part, target)

    def follow(self, part: str, target: Array, velocity: Array) -> None:
        """Set the attractor of the part to `target` (n_part,) rad, which moves with `velocity` (n_part,) rad/s.

        The attractor is the posture to which the springs of the control law pull the part. If this method is not called again within
        0.1 s of the control law's time, the attractor counts as not moving (velocity 0).
        """
        self._law.follow(part, target, velocity)

    def motion(self, part: str) -> tuple[Array, Array, Array]:
        """Return commanded velocity [rad/s], acceleration [rad/s^2] and attractor [rad] of the part's motors, each (n_part,)."""
        where = self._where[part]
        return self._law.velocity[where], self._law.acceleration[where], self._law.attractor[where]

    def settle_speeds(self, part: str) -> tuple[Array, Array]:
        """Return commanded velocity and acceleration of the part's motors, (n_part,) each, by which the end of a motion is detected.

        Units: rad/s and rad/s^2. For a motor that slides, the values in m/s and m/s^2 are divided by the distance [m] that counts as 1 rad
        for this motor, as `mobee.robot.motor_units.fine_units` gives it.
        """
        where = self._where[part]
        return self._law.velocity[where] / self._units[where], self._law.acceleration[where] / self._units[where]

    # Reaches and forces of clients

    def reach(self, part: str, marker: str, target: ReachTarget) -> None:
        """Begin to pull a marker (a named point on a link) to a target by forces on the part.

        Raises UnknownName for an unknown part or marker. Raises InvalidValue if the part has no motor that moves the marker, or if all such
        motors are forbidden to move (weight 0 in the gains).
        """
        self._law.reach_toward(part, marker, target)

    def end_reach(self, part: str) -> None:
        """Stop pulling the marker of the part's reach to its target; nothing happens if the part has no reach."""
        self._law.end_reach(part)

    def is_approaching(self, part: str) -> bool:
        """Return whether the marker of the part's reach still comes nearer to its target; False without a reach."""
        return self._law.is_approaching(part)

    def marker_position(self, marker: str) -> Array:
        """Return the position of a marker at the measured motor positions, (3,) m, root frame."""
        return self._law.model.evaluate(self.q).position(marker)

    def set_client_force(self, part: str, force: Array) -> None:
        """Set the joint-space force of a client on a part, (n_part,) rad/s^2 (thesis eq. 5.9).

        A client is another process that commands the robot. The force replaces the one that was set before for this part.
        """
        self._client_forces[self._where[part]] = force
        self._apply_client_forces()

    def set_push(self, part: str, marker: str, push: Array) -> None:
        """Set the force of a client at a marker: `push`, (3,) m/s^2, root frame (thesis eq. 5.10).

        A client is another process that commands the robot. `part`: the part for which the client set the push; `clear_client_forces` of
        this part ends it. If pushes at one marker were set for several parts, they are added.
        """
        self._pushes.setdefault(part, {})[marker] = push
        self._apply_client_forces()

    def clear_client_forces(self, part: str) -> None:
        """End the joint-space force and all pushes that a client has set for a part.

        The reach of the part continues. So do forces and pushes that were set for other parts.
        """
        self._client_forces[self._where[part]] = 0.0
        self._pushes.pop(part, None)
        self._apply_client_forces()

    def _apply_client_forces(self) -> None:
        self._law.clear()
        self._law.force(self._client_forces)
        at_marker: dict[str, Array] = {}
        for pushes in self._pushes.values():
            for marker, push in pushes.items():
                at_marker[marker] = at_marker.get(marker, 0.0) + push
        for marker, push in at_marker.items():
            self._law.push(marker, push)


def warm_up(law: Controller, robot: Robot) -> None:
    """Begin, step and end a reach of each part with each marker that it moves, and decode a request, so that later reaches start quickly.

    Afterwards the control law is at rest at home.
    """
    asked = ReachFor(
        v=VERSION, id="0", who="warm", epoch=0, action_id="0", marker="none", object="none", position=[0.0] * 3, radius=1.0, aim="centre"
    )
    decode(ReachFor, encode(asked), encoding_of(ReachFor))
    nothing = np.zeros(len(robot.motors))
    moved = links_moved(robot)
    here = law.model.evaluate(robot.home)
    for part in robot.parts:
        for name, marker in robot.markers.items():
            if marker.link in moved[part]:
                try:
                    law.reach_toward(part, name, ReachTarget(here.position(name)))
                except InvalidValue:  # only motors of weight 0 move it: a request for such a reach is refused
                    continue
                law.step(robot.home, min(WARM_UP_TICK, 0.5 * law.max_dt), Forces(**dict.fromkeys(law.force_names, nothing)))
                law.is_approaching(part)
                law.end_reach(part)
    law.reset(robot.home)
