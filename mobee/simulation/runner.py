# SPDX-License-Identifier: Apache-2.0
"""Runs the ticks of one plant in the compiled core, and records their trace."""

from __future__ import annotations

import ctypes
from collections.abc import Generator
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from mobee._core import Table, View, address, view
from mobee._core import plant as core
from mobee._core.law import term_names
from mobee.arrays import Array
from mobee.control import Controller
from mobee.model.engine import Hand, Hands, Neighbours, Snapshot
from mobee.model.masses import gravity_torque
from mobee.model.model import engine_of
from mobee.simulation.motors import Motors
from mobee.simulation.rigid import stiffened

SKIN = 0.06  # m, distance within which pairs of shapes are candidates for contacts

T = TypeVar("T")
Work = Generator[int, None, T]
"""A generator of the steps of a plant's work: it yields the address of the structure that the core must run next, then continues."""


def finished(work: Work[T]) -> T:
    """Run the generator `work` to its end, and run ticks in the compiled core after each of its steps; return the generator's value.

    In each step, `work` yields the address of the structure whose ticks the core must run next (`Plant` of core/plant.cpp). Such generators
    come from `OfflinePlant.advancing` and `OfflinePlant.running`.
    """
    run = core.calls().run
    try:
        while True:
            run(next(work))
    except StopIteration as end:
        found: T = end.value
        return found
    finally:
        work.close()  # after a Ctrl-C between two steps, the plant takes over the ticks that were run


@dataclass(frozen=True, slots=True, eq=False)
class Trace:
    """The record of a run, one row per tick.

    Attributes:
        encoders: (ticks, n) rad, measured at the beginning of the tick.
        q: (ticks, n) rad, true positions of the motors at the end of the tick, on the output side of the backlash.
        velocity: (ticks, n) rad/s, the velocities in the controller's own state, which are computed and not measured.
        solid: (ticks,) m, depth of the deepest contact of solids at the pose of the encoders; 0 without contacts.
        field: (ticks,) m, depth of the deepest contact of fields, volumes that cause repulsive forces; 0 without contacts.
    """

    encoders: Array
    q: Array
    velocity: Array
    solid: Array
    field: Array

    @classmethod
    def of(cls, record: Array) -> Trace:
        """Make a trace from the array (ticks, 3 n + 2) that the compiled core has written, a row per tick.

        Columns: n encoders, n true positions, n velocities, the depth [m] of the deepest contact of solids, and that of the deepest contact
        of fields (volumes that cause repulsive forces), as in `Trace`.
        """
        n = (record.shape[1] - 2) // 3
        return cls(record[:, :n], record[:, n : 2 * n], record[:, 2 * n : 3 * n], record[:, 3 * n], record[:, 3 * n + 1])

    def __len__(self) -> int:
        return len(self.q)


class Runner:
    """Runs the ticks of one plant in the compiled core.

    It holds the commands that the motors have not received yet, and the encoders and forces of the last tick.

    Args:
        controller: the controller, which holds the control law and the attractor.
        motors: the simulated motors.
        alive: (n,) whether each motor is active; the others never move.
        dt: duration of a tick [s].
        command_age: delay of the commands, in ticks: in tick k the motors move by the command computed from the encoders of tick
            k - `command_age`.
        parts: the state of each part's action, a row for each (`mobee._core.plant.PART`).
    """

    def __init__(self, controller: Controller, motors: Motors, alive: NDArray[np.bool_], dt: float, command_age: int, parts: Table) -> None:
        n = len(alive)
        self._controller, self._motors, self._alive, self._dt = controller, motors, alive, dt
        self._cut = controller.propagate == "part"
        self._neighbours: dict[tuple[bool, Hands, bool], tuple[Neighbours, Hands]] = {}  # see `_near`
        substeps = motors.parameters.substeps(dt)
        self._substep = dt / substeps
        self._commands = np.zeros((command_age, n))
        self._noise = motors.noise(dt)
        self._client, self._torque, self._total = np.zeros(n), np.zeros(n), np.zeros(n)
        self._forces = np.zeros((len(controller.force_names), n))
        self.q: Array = controller.robot.home.copy()
        """The encoder values at the last tick, (n,) rad."""
        self._struct = core.Plant(
            law=controller.law.address, law_state=address(controller.state), attractor=address(controller.goal),
            client=address(self._client), forces=address(self._forces), rows=len(self._forces), motors=motors.address,
            commands=address(self._commands),
            command_age=command_age, substeps=substeps, dt=dt,
            noise=address(self._noise) if self._noise.any() else None, parts=view(parts), q=address(self.q),
            torque=address(self._torque), total=address(self._total),
        )  # fmt: skip
        self.batch_world: Snapshot | None = None
        """The world for which `prepare_batch` has prepared the ticks; None if `prepare` was called after it."""
        self._parts, self._record, self._listed = parts, np.zeros((0, 3 * n + core.RECORD_DEPTHS)), (0, 0)
        self._clients_act = False
        self.address = ctypes.addressof(self._struct)
        """The memory address of the structure that the core runs."""
        self.restart(self.q)

    def restart(self, q: Array) -> None:
        """Start again at tick 0 and at rest at q (n,) rad; delayed commands and forces are removed."""
        self.q[:] = q
        self._struct.ticks = 0
        self._commands[:] = self._controller.state["reference"] if self._controller.modality == "position" else 0.0
        for forces in (self._client, self._torque, self._total, self._forces):
            forces[:] = 0.0

    @property
    def ticks(self) -> int:
        """Number of ticks since the start or the last restart."""
        ticks: int = self._struct.ticks
        return ticks

    def prepare(self, most: int, kept: bool, solids: bool, reaching: tuple[str, ...] = ()) -> int:
        """Prepare the next run of up to `most` ticks; return the address of the structure that the core must run.

        The structure is `Plant` of core/plant.cpp. The run has at most one tick if Python computes forces for each pose. `kept`: whether
        encoders, positions, velocities and contact depths of every tick are recorded, see `results`. `solids`: whether contacts of solids
        are computed too; only the depths depend on them, the control does not. `reaching`: names of markers; the targets exert no
        repulsive force on the hands that carry these markers.
        """
        controller, motors, struct = self._controller, self._motors, self._struct
        if self.batch_world is not None:
            self.batch_world, struct.deepest = None, None
        motors.begin_substeps(self._substep)
        if controller.modality == "torque" or controller.pushed or controller.terms:  # forces that Python computes for each pose
            most, self._clients_act = 1, True
            self._client[:] = self._pose_forces(motors.encoders(struct.ticks + 1, self._dt), reaching)
        elif controller.forced or self._clients_act:
            self._clients_act = controller.forced
            self._client[:] = controller.client_force(self.q)
        if kept:
            self._record = np.zeros((most, 3 * len(self.q) + core.RECORD_DEPTHS))
            struct.record = address(self._record)
        elif len(self._record):
            self._record, struct.record = self._record[:0], None
        listed = controller.reaches.address, len(controller.reaches)
        if listed != self._listed:
            struct.reaches, self._listed = View(*listed), listed
        struct.neighbours = self._near(solids, reaching) if controller.contact_forces or solids else None
        struct.max_ticks, struct.ticks_run = most, 0
        return self.address

    @property
    def needs_python(self) -> bool:
        """Whether Python code is needed between ticks, so that `prepare` must be called before each run.

        It is needed in torque mode, while a force given to `Controller.force` or `Controller.push` acts, while a reach (a pull of a marker
        to a target) is in progress, and if the control law has terms that are Python functions.
        """
        controller = self._controller
        return bool(controller.forced or controller.pushed or controller.reaches or controller.terms or controller.modality == "torque")

    def prepare_batch(self, deepest: Array) -> None:
        """Prepare the core's structure (`Plant` of core/plant.cpp) for runs of `PlantBatch`, during which no Python code is needed.

        It stays prepared for any number of runs, until the world changes or `prepare` is called.

        `deepest`: (2,) m, depths of the deepest contact of solids and of the deepest contact of fields (volumes that cause repulsive
        forces). The core increases a number when a contact in a tick is deeper. The caller must keep the array alive.
        """
        world = self._controller.model.world.snapshot
        if self.batch_world is not world:
            self.prepare(0, False, True)
            self._struct.deepest, self.batch_world = address(deepest), world

    def results(self) -> tuple[Array, int, bool]:
        """Return the record (ticks, 3 n + 2) of the last run, the number of ticks run, and whether the motors' state is no longer finite.

        A row of the record has the columns that `Trace.of` takes; there are no rows if the ticks were not recorded.
        """
        done, end = self._struct.ticks_run, self._struct.end
        if done:
            self._controller.note_forces(self._forces)
        return self._record[:done], done, end == core.STATE_LOST

    def _near(self, solids: bool, reaching: tuple[str, ...]) -> int:
        """Return the address of the contact search in the current world; of the whole robot if objects are attached to links."""
        model = self._controller.model
        snapshot = model.world.snapshot
        key = bool(snapshot.attached), model.hands(reaching), solids
        if key not in self._neighbours:
            self._neighbours[key] = self._new_neighbours(*key)
        near, hands = self._neighbours[key]
        return near.enter(snapshot, hands)

    def _new_neighbours(self, whole: bool, reaching: Hands, solids: bool) -> tuple[Neighbours, Hands]:
        """Return a new contact search, and the hands whose contacts with targets it ignores, with the link indices of its robot.

        `whole`: search the whole robot; else a reduced one, in which links that cannot move relative to each other are merged, but the
        links of the hands are kept. `reaching`: the hands that reach for a target. `solids`: whether contacts of solids are needed too.
        """
        robot = stiff = self._controller.robot
        if not whole:
            apart = [link for hand in reaching for link in (hand.link, hand.fields)]
            stiff = stiffened(robot, self._alive, self._cut, solids, apart)
            link = {robot.links.index(name): index for index, name in enumerate(stiff.links)}
            reaching = tuple(Hand(link[hand.link], link[hand.fields]) for hand in reaching)
        return Neighbours(engine_of(stiff), SKIN, self._cut), reaching

    def _pose_forces(self, q: Array, reaching: tuple[str, ...]) -> Array:
        """Compute the forces that depend on the pose q (n,) rad, and return the force of the client (n,) rad/s^2.

        The client is the caller of `Controller.force` and `push`. The forces of the user's own terms are written to `_forces`. In torque
        mode the torque [N m] against gravity is set too. `reaching`: names of the markers that reach for a target; targets do not repel
        their hands.
        """
        controller, motors = self._controller, self._motors
        if controller.terms and np.isfinite(q).all():
            self._forces[len(term_names()) :] = list(controller.own_forces(q, self._dt, reaching=reaching).values())
        if controller.modality == "torque":
            controller.state["feedforward"] = gravity_torque(controller.robot, q)
            motors.load = gravity_torque(controller.robot, motors.q)
        return controller.client_force(q)
