"""`mobee reach` on the running robot."""

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
from mobee_cli.reach_stage import Choose, Stage
from services.common import rpc
from services.common.bus_plant import BusPlant
from services.common.config import ServiceConfig
from services.common.exit_codes import ENVIRONMENT, FAILED
from services.common.service import Service

WHO = f"mobee_reach_{os.getpid()}"  # so that of two who present a target the second is told
CONTROL = 8.0  # s for the part to come under control and its goal to be free
LONGEST = 300.0  # s of the clock on the wall for a reach, whatever the robot does
NOTED = 1.0  # s from the request for which commands are noted
_RESTLESS = f"has not come to rest in {LONGEST:g} s: is the robot paused? See `mobee status`"
MOVES = {"position": 5e-5, "velocity": 5e-3, "torque": 25e-3}  # rad, rad/s, N m: by more a command that moves differs from one at rest


class LivePlant(BusPlant):
    """A BusPlant that is never waited for in vain, and that sees when its reaches begin to move the robot."""

    def __init__(self, service: Service, robot: Robot, part: str, modality: str) -> None:
        super().__init__(service, robot, (part,))
        self._link, self._where, self._moves = service, robot.part(part).slice, MOVES[modality]
        self._asked = self._begun = np.inf  # s, monotonic clock: the request, and when the controller began
        self._commands: list[tuple[float, Array]] = []  # when sent, what: the last before the request, and those after
        service.on_each(Reach, self._note_reach, part)
        service.on_each(Commands, self._note_commands)

    @property
    def q(self) -> Array:
        """As of a BusPlant, but raises UserError if no tick comes for 8 s."""
        with self._at_most(CONTROL, f"no tick of the robot in {CONTROL:g} s: `mobee status` says whether robot_sim runs"):
            return super().q

    def measure(self, part: str) -> Array:
        """As a BusPlant, but with an end: raises UserError while somebody holds the part."""
        with self._at_most(CONTROL, f"{part} is in hold: `mobee status` says why, `mobee estop --reset` ends an emergency stop"):
            try:
                return super().measure(part)
            except ActionInterrupted:
                raise
            except MobeeError as error:
                raise UserError(f"{error}. `mobee launch reach` starts a system in which nobody owns it.", FAILED) from None

    def act(self, part: str, target: Array) -> Outcome:
        """As a BusPlant, but with an end."""
        with self._at_most(LONGEST, f"{part} {_RESTLESS}"):
            return super().act(part, target)

    def reach(self, part: str, marker: str, stay: bool = False) -> ReachOutcome:
        """As a BusPlant, but with an end."""
        self._asked, self._begun = time.monotonic(), np.inf
        with self._at_most(LONGEST, f"{part} {_RESTLESS}"):
            return super().reach(part, marker, stay)

    def first_motion(self) -> float | None:
        """From the last request to the first command that moves, in s; None if none came."""
        moved = first_that_moves(self._commands, self._begun, self._moves)
        return None if moved is None else moved - self._asked

    @contextmanager
    def _at_most(self, patience: float, why: str) -> Iterator[None]:
        """Raise UserError out of whatever is waited for in there, after s of the clock on the wall."""
        waits = True

        def end() -> None:
            if waits:
                raise UserError(why, ENVIRONMENT)

        self._link.inbox.at(time.monotonic() + patience, end)
        try:
            yield
        finally:
            waits = False

    def _note_reach(self, reach: Reach) -> None:
        """Its sender's clock is this machine's."""
        if reach.phase == "reaching" and reach.tw * 1e-9 > self._asked:
            self._begun = min(self._begun, reach.tw * 1e-9)

    def _note_commands(self, commands: Commands) -> None:
        sent = commands.tw * 1e-9
        if sent < self._asked:
            self._commands.clear()
        if sent < self._asked + NOTED:
            self._commands.append((sent, np.array(commands.ref[self._where])))


def first_that_moves(commands: list[tuple[float, Array]], begun: float, moves: float) -> float | None:
    """When the first of the commands was sent, from the time on when a reach began, that differs by more from the last before."""
    before = [ref for sent, ref in commands if sent < begun]
    moving = (sent for sent, ref in commands if sent >= begun and before and np.abs(ref - before[-1]).max() > moves)
    return next(moving, None)


@contextmanager
def live(endpoint: str, choose: Choose, target: Array | str) -> Iterator[Stage]:
    """The robot of the system at `endpoint`; the part that reaches is taken, and given back at the end.

    `target`: the place (3,) m, or the object's name, that is reached for.  Raises UserError where there is no system.
    """
    with connected(endpoint) as session:
        try:
            settings = json.loads(rpc.call(session, WHO, keys.service_rpc("controller", "config"), Empty, Config, tries=3).config)
        except rpc.CallFailed as failed:
            raise UserError(f"no controller answers at {endpoint} ({failed}): `mobee status` says what runs", ENVIRONMENT) from None
        robot = load_robot(settings["robot"])
        hand = choose(robot, _place_of(session, target) if isinstance(target, str) else target)
        with Service(WHO, ServiceConfig(endpoint=endpoint, robot=settings["robot"]), robot, session=session) as service:
            signal.signal(signal.SIGINT, signal.default_int_handler)  # Ctrl-C ends the reach, and that the verb has to tell
            logging.getLogger().setLevel(logging.CRITICAL)  # what concerns a person is told by the verb
            plant = LivePlant(service, robot, hand.part, settings["modality"])
            service.ready()
            yield Stage(robot, plant, hand, lambda: plant.q, plant.present_object, plant.first_motion)
            plant.leave()


def _place_of(session: Any, name: str) -> Array | None:
    """Where an object of the model's world is, (3,) m; None where it is not known, which is an error when it is presented."""
    try:
        objects = rpc.call(session, WHO, keys.world_rpc("list"), Empty, World, tries=3).objects
    except rpc.CallFailed:
        return None
    return next((np.array(one.position) for one in objects if one.name == name), None)
