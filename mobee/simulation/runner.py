"""Hands the compiled loop what it works on, and takes back what it leaves."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from mobee.control import Controller, Forces
from mobee.control.layout import FEEDFORWARD, MODALITY, POSITION, REFERENCE, TORQUE
from mobee.engine.numba_engine import engine_of
from mobee.engine.numba_hands import Hand, hands
from mobee.engine.numba_track import Neighbours
from mobee.kinematics.gravity import gravity_torque
from mobee.robot.robot import Array, Ints
from mobee.simulation.load import compiled_loop
from mobee.simulation.motors import Motors
from mobee.simulation.rigid import stiffened

SKIN = 0.04  # m


class Runner:
    """The loop of one plant: its memory, the commands on their way, the encoders and forces of the last tick."""

    def __init__(self, controller: Controller, motors: Motors, alive: NDArray[np.bool_], dt: float, command_age: int) -> None:
        n = len(alive)
        robot = controller.robot
        self._controller, self._motors, self._dt = controller, motors, dt
        self._substeps = motors.parameters.substeps(dt)
        self._cut = controller.propagate == "part"
        self._alive = alive
        self._fields = self._neighbours(solids=False)
        self._solids: Neighbours | None = None  # where they are asked for
        self._whole: Neighbours | None = None
        self._reaching: dict[tuple[tuple[Hand, ...], bool], tuple[Neighbours, int]] = {}  # for hands that have reached, with these
        self._mode = int(controller.law.integers[MODALITY])
        self._commands = np.zeros((command_age, n))
        if self._mode == POSITION:
            self._commands[:] = controller.state[REFERENCE]
        self._seed, self._noise = np.uint64(motors.seed), motors.noise(dt)
        self._noisy = bool(self._noise.any())
        self.q: Array = robot.home.copy()
        self._torque = np.zeros(n)
        self._forces = np.zeros((3, n))
        self._loop = compiled_loop()

    def run(self, ticks: int, most: int, parts: Ints, tests: Array, kept: bool, solids: bool) -> tuple[Array, int, bool]:
        """Run up to that many ticks after those there have been; the record, how many were run, whether the state is lost.

        `kept`: the record is; `solids`: contacts of solids are found too, for its sake.
        """
        controller, motors = self._controller, self._motors
        motors.begin_substeps(self._dt / self._substeps)
        if self._mode == TORQUE or controller.pushed:  # forces that depend on the pose, beyond what the loop knows
            most = 1
            client = self._pose_forces(motors.encoders(ticks + 1, self._dt))
        else:
            client = controller.client_force(self.q)
        record = np.zeros((most if kept else 0, 3 * len(self.q) + 2))
        done, why = self._loop.run(
            *self._scene(solids), controller.contact_forces or solids,
            controller.law.integers, controller.law.floats, controller.law.settle, controller.state, controller.goal, client, self._forces,
            *controller.reaches,
            motors.living, motors.whole, motors.fixed, motors.state, motors.line, motors.at, self._commands, self._mode,
            self._substeps, self._seed, self._noise, self._noisy, parts, tests, self.q, self._torque, record, ticks, self._dt, most,
        )  # fmt: skip
        if done:
            controller.last_forces = Forces(*self._forces.copy())
        return record[:done], done, why == self._loop.LOST

    def _scene(self, solids: bool) -> tuple[Any, ...]:
        """The robot in the world of now, and its memory; with all its links where a link is meant by its name."""
        model = self._controller.model
        snapshot = model.world.snapshot
        near, reaching = self._fields, hands()
        if snapshot.attached:
            near = self._whole = self._whole or Neighbours(engine_of(model.robot), SKIN)
            reaching = hands(*model.hands)
        elif model.hands:
            near, reaching = self._sparing(model.hands, solids)
        elif solids:
            near = self._solids = self._solids or self._neighbours(solids=True)
        return (*near.scene(snapshot, reaching, self._cut), *near.memory)

    def _neighbours(self, solids: bool) -> Neighbours:
        return Neighbours(engine_of(stiffened(self._controller.robot, self._alive, self._cut, solids)), SKIN)

    def _sparing(self, reaching: tuple[Hand, ...], solids: bool) -> tuple[Neighbours, int]:
        """Those of a robot whose hands are apart from what carries them, and their `hands`."""
        known = self._reaching.get((reaching, solids))
        if known is None:
            robot = self._controller.robot
            stiff = stiffened(robot, self._alive, self._cut, solids, apart=[link for hand in reaching for link in (hand.link, hand.fields)])
            new = {robot.links.index(name): index for index, name in enumerate(stiff.links)}
            known = Neighbours(engine_of(stiff), SKIN), hands(*(Hand(new[hand.link], new[hand.fields]) for hand in reaching))
            self._reaching[reaching, solids] = known
        return known

    def _pose_forces(self, q: Array) -> Array:
        """What clients push with at q (n,), after what carries the robot's weight has been set: both depend on the pose."""
        controller, motors = self._controller, self._motors
        if self._mode == TORQUE:
            controller.state[FEEDFORWARD] = gravity_torque(controller.robot, q)
            motors.load = gravity_torque(controller.robot, motors.q)
        return controller.client_force(q)
