"""The ticks of one plant in the core, core/plant.cpp: hands it what it works on, and takes back what it leaves."""

from __future__ import annotations

import ctypes

import numpy as np
from numpy.typing import NDArray

from mobee._core import address
from mobee._core import plant as core
from mobee._core.law import TERMS
from mobee._core.tables import Table, View, view
from mobee.control import Controller, Forces
from mobee.kinematics.gravity import gravity_torque
from mobee.robot.robot import Array
from mobee.simulation.motors import Motors


class Runner:
    """The loop of one plant: its memory, the commands on their way, the encoders and forces of the last tick."""

    def __init__(self, controller: Controller, motors: Motors, alive: NDArray[np.bool_], dt: float, command_age: int, parts: Table) -> None:
        """`parts`: the actions, see `mobee._core.plant.PART`."""
        n = len(alive)
        self._controller, self._motors, self._dt = controller, motors, dt
        substeps = motors.parameters.substeps(dt)
        self._substep = dt / substeps
        self._commands = np.zeros((command_age, n))
        if controller.modality == "position":
            self._commands[:] = controller.state["reference"]
        self._noise = motors.noise(dt)
        self._client, self._torque, self._total, self._forces = np.zeros(n), np.zeros(n), np.zeros(n), np.zeros((len(TERMS), n))
        self.q: Array = controller.robot.home.copy()
        """The encoders of the last tick, (n,) rad."""
        self._struct = core.Plant(
            law=controller.law.address, law_state=address(controller.state), attractor=address(controller.goal),
            client=address(self._client), forces=address(self._forces), motors=motors.address, commands=address(self._commands),
            command_age=command_age, substeps=substeps, dt=dt, seed=motors.seed,
            noise=address(self._noise) if self._noise.any() else None, parts=view(parts), q=address(self.q),
            torque=address(self._torque), total=address(self._total),
        )  # fmt: skip
        self._parts = parts
        self._address = ctypes.addressof(self._struct)
        self._core = core.calls()

    def run(self, ticks: int, most: int, kept: bool, solids: bool) -> tuple[Array, int, bool]:
        """Run up to that many ticks after those there have been; the record, how many were run, whether the state is lost.

        `kept`: the record is; `solids`: contacts of solids are found too, for its sake.
        """
        controller, motors, struct = self._controller, self._motors, self._struct
        motors.begin_substeps(self._substep)
        if controller.modality == "torque" or controller.pushed:  # forces that depend on the pose, beyond what the core knows
            most = 1
            self._client[:] = self._pose_forces(motors.encoders(ticks + 1, self._dt))
        else:
            self._client[:] = controller.client_force(self.q)
        record = np.zeros((most if kept else 0, 3 * len(self.q) + core.RECORD_DEPTHS))
        struct.record = address(record) if kept else None
        struct.reaches = View(controller.reaches.address, len(controller.reaches))
        struct.near = None
        struct.ticks, struct.most = ticks, most
        self._core.run(self._address)
        done: int = struct.done
        if done:
            controller.last_forces = Forces(*self._forces.copy())
        return record[:done], done, struct.end == core.STATE_LOST

    def _pose_forces(self, q: Array) -> Array:
        """What clients push with at q (n,), after what carries the robot's weight has been set: both depend on the pose."""
        controller, motors = self._controller, self._motors
        if controller.modality == "torque":
            controller.state["feedforward"] = gravity_torque(controller.robot, q)
            motors.load = gravity_torque(controller.robot, motors.q)
        return controller.client_force(q)
