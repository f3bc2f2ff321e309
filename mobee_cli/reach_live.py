# SPDX-License-Identifier: Apache-2.0
"""Sets up `mobee reach` with the running robot."""

from __future__ import annotations

import json
import logging
import os
import signal
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from bus_schema import keys
from bus_schema.messages import Commands, Reach
from bus_schema.rpc import Config, Empty, World
from mobee.arrays import Array
from mobee.errors import ActionInterrupted, MobeeError
from mobee.plant import Outcome
from mobee.reach import ReachOutcome
from mobee.robot.load import load_robot
from mobee.robot.robot import Robot
from mobee_cli.connect import connected
from mobee_cli.errors import UserError
from mobee_cli.reach_setup import Choose, Setup
from services.common import rpc
from services.common.bus_plant import BusPlant
from services.common.config import ServiceConfig
from services.common.exit_codes import ENVIRONMENT, FAILED
from services.common.service import Service

WHO = f"mobee_reach_{os.getpid()}"  # unique, so that a second process that presents a target gets an error
CONTROL_TIMEOUT = 8.0  # s for the part to come under control and its goal to be free
REACH_TIMEOUT = 300.0  # s of wall-clock time for a reach or an action
RECORDED_TIME = 1.0  # s after the request for which commands are recorded
_TIMED_OUT = f"has not come to rest in {REACH_TIMEOUT:g} s: is the robot paused? See `mobee status`"
MOVES = {"position": 5e-5, "velocity": 5e-3, "torque": 25e-3}  # rad, rad/s, N m: least change of a command that moves a motor at rest


class LivePlant(BusPlant):
    """The running robot as a `BusPlant` (moves parts by messages on the bus), with time limits for measurements, actions and reaches.

    After a time limit UserError is raised.
    It also measures how soon the robot begins to move after a reach is requested.
    """

    def __init__(self, service: Service, robot: Robot, part: str, modality: str) -> None:
        super().__init__(service, robot, (part,))
        self._service, self._where, self._moves = service, robot.part(part).slice, MOVES[modality]
        self._asked = self._heard = np.inf  # s, monotonic clock: of the request, and of the first message of the reach
        self._begun = np.inf  # s, the controller's clock, which may be that of another host: of that message
        self._commands: list[tuple[float, Array]] = []  # time by that clock, and value: the last before the request, and those after it
        service.on_each(Reach, self._note_reach, part)
        service.on_each(Commands, self._note_commands)

    @property
    def q(self) -> Array:
        """The positions of all motors in the newest tick, (n,) rad. Raises UserError if no tick arrives for 8 s."""
        with self._timeout(CONTROL_TIMEOUT, f"no tick of the robot in {CONTROL_TIMEOUT:g} s: `mobee status` shows whether robot_sim runs"):
            return super().q

    def measure(self, part: str) -> Array:
        """Measure the motor positions of a part, (n_part,) rad.

        Raises UserError if the part stays in hold (stands still, follows no commands) for 8 s, or another client owns it.
        """
        with self._timeout(CONTROL_TIMEOUT, f"{part} is in hold: `mobee status` shows why, `mobee estop --reset` ends an emergency stop"):
            try:
                return super().measure(part)
            except ActionInterrupted:
                raise
            except MobeeError as error:
                raise UserError(f"{error}. `mobee launch reach` starts a system in which no agent owns it.", FAILED) from None

    def act(self, part: str, target: Array) -> Outcome:
        """Set the part's attractor (goal of its motors) to `target` (n_part,) rad; return the outcome when it has settled or timed out.

        Raises UserError if this takes longer than REACH_TIMEOUT (300 s).
        """
        with self._timeout(REACH_TIMEOUT, f"{part} {_TIMED_OUT}"):
            return super().act(part, target)

    def reach(self, part: str, marker: str, stay: bool = False) -> ReachOutcome:
        """Pull a marker by a force to the target that was presented last, and return the outcome.

        When the force ends, the part returns to the attractor (goal of its motors) that it had before. With `stay`, the part stays where
        the force ended. Raises UserError if the reach takes longer than REACH_TIMEOUT (300 s).
        """
        self._asked, self._heard, self._begun = time.monotonic(), np.inf, np.inf
        with self._timeout(REACH_TIMEOUT, f"{part} {_TIMED_OUT}"):
            return super().reach(part, marker, stay)

    def first_motion(self) -> float | None:
        """Return the time [s] from the last request of a reach to the first command that moves the robot; None without such a command."""
        moved = first_moving_command(self._commands, self._begun, self._moves)
        return None if moved is None else self._heard - self._asked + moved - self._begun

    @contextmanager
    def _timeout(self, patience: float, why: str) -> Iterator[None]:
        """Raise UserError in the code inside if it waits longer than `patience` s of wall-clock time."""
        waits = True

        def end() -> None:
            if waits:
                raise UserError(why, ENVIRONMENT)

        self._service.inbox.at(time.monotonic() + patience, end)
        try:
            yield
        finally:
            waits = False

    def _note_reach(self, reach: Reach) -> None:
        """Note when the first message of the reach was sent, by the controller's clock, and when it came, by this process's."""
        if reach.phase == "reaching" and not np.isfinite(self._begun):
            self._heard, self._begun = time.monotonic(), reach.tw * 1e-9

    def _note_commands(self, commands: Commands) -> None:
        if not np.isfinite(self._asked):
            self._commands.clear()
        if time.monotonic() < self._asked + RECORDED_TIME:
            self._commands.append((commands.tw * 1e-9, np.array(commands.ref[self._where])))


def first_moving_command(commands: list[tuple[float, Array]], begun: float, moves: float) -> float | None:
    """Return the time [s] of the first command that moves the robot; None if there is no such command, or no command before `begun`.

    A command moves the robot if one of its values differs by more than `moves` from the last command before `begun`. `commands`: (time sent
    [s], values (n_part,)), in order. `begun`: time at which the reach began [s], by the same clock. `moves`: in the unit of the values.
    """
    before = [ref for sent, ref in commands if sent < begun]
    moving = (sent for sent, ref in commands if sent >= begun and before and np.abs(ref - before[-1]).max() > moves)
    return next(moving, None)


@contextmanager
def live(endpoint: str, choose: Choose, target: Array | str) -> Iterator[Setup]:
    """Set up the robot of the system at `endpoint` for a reach, for the block of a `with` statement.

    If the block ends without an error, the goal of the part (the right to set its attractor) is then released, and the target is removed.
    `choose(robot, position)`: function that returns the hand for a target at `position`, (3,) m in the root frame; `position` is None if it
    is not known. `target`: a position (3,) m in the root frame, or the name of an object in the model's world. Raises UserError if no
    system runs.
    """
    with connected(endpoint) as session:
        try:
            settings = json.loads(rpc.call(session, WHO, keys.service_rpc("controller", "config"), Empty, Config, tries=3).config)
        except rpc.CallFailed as failed:
            raise UserError(f"no controller answers at {endpoint} ({failed}): `mobee status` shows what runs", ENVIRONMENT) from None
        robot = load_robot(settings["robot"])
        hand = choose(robot, _position_of(session, target) if isinstance(target, str) else target)
        with Service(WHO, ServiceConfig(endpoint=endpoint, robot=settings["robot"]), robot, session=session) as service:
            signal.signal(signal.SIGINT, signal.default_int_handler)  # Ctrl-C ends the reach, and the verb reports it
            logging.getLogger().setLevel(logging.CRITICAL)  # the verb itself prints what the user needs
            plant = LivePlant(service, robot, hand.part, settings["modality"])
            service.ready()
            yield Setup(
                robot,
                plant,
                hand,
                lambda: plant.q,
                lambda name, aim, faces: plant.present_object(name, aim, faces=faces),
                plant.first_motion,
            )
            plant.leave()


def _position_of(session: Any, name: str) -> Array | None:
    """Return the position of an object in the world of the service `model`, (3,) m, root frame.

    None if there is no such object, or no answer; the later call that makes the object the target then raises an error.
    """
    try:
        objects = rpc.call(session, WHO, keys.world_rpc("list"), Empty, World, tries=3).objects
    except rpc.CallFailed:
        return None
    return next((np.array(one.position) for one in objects if one.name == name), None)
