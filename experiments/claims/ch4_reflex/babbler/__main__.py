# SPDX-License-Identifier: Apache-2.0
"""Starts the babbler, a client that sends random commands: `python -m experiments.claims.ch4_reflex.babbler`."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path

from msgspec import structs

from bus_schema.messages import Clock, Turn
from experiments.claims.ch4_reflex.babbler.config import Config
from experiments.claims.ch4_reflex.babbler.movers import AtDrives, AtGoals
from experiments.claims.ch4_reflex.babbling_trial import COMMANDS, Commanded, CommandLog, Targets
from mobee import load_robot
from mobee.robot.robot import Robot
from services.common.config import load_config
from services.common.entry import explained
from services.common.lockstep import Participant
from services.common.service import Service


class BabblerNode:
    """Commands random postures one after the other, and writes each command that has ended to the log.

    In lockstep each tick waits for the answer of this service, which answers when it has sent its commands for the tick.
    """

    def __init__(self, service: Service, config: Config, robot: Robot) -> None:
        self._commands = 0
        self._log = CommandLog(Path(config.run_dir) / COMMANDS)
        self._participant = Participant(service)
        targets = Targets(robot, config.seed)
        if config.at == "drives":
            self._mover: AtDrives | AtGoals = AtDrives(service, robot, targets, config.speed, self._note)
        else:
            self._mover = AtGoals(service, robot, targets, self._note)
        service.describe = lambda: (f"{self._commands} commands", {"commands": self._commands})
        if service.locked and config.at == "goals":  # after the controller, which reports the end of motions
            service.on_turn(self._tick)
        else:
            service.on_clock(self._tick)

    def _tick(self, now: Clock | Turn) -> None:
        if now.k > 0:  # tick 0 gathers the participants
            self._mover.move(now.k, now.dt * 1e-9)
        self._participant.done(now.k)

    def _note(self, commanded: Commanded) -> None:
        self._commands += 1
        self._log.note(commanded)


def main(argv: Sequence[str] | None = None) -> None:
    """Run the client until the system ends.  `argv`: command-line arguments; None: those of the process."""
    config = load_config(Config, argv, "experiments.claims.ch4_reflex.babbler")
    with explained("experiments.claims.ch4_reflex.babbler"):
        robot = load_robot(config.robot)
        with Service("babbler", config, robot) as service, ExitStack() as stack:
            client = service
            if config.robot_of != config.namespace:
                theirs = structs.replace(config, namespace=config.robot_of)
                client = stack.enter_context(Service("babbler", theirs, robot, inbox=service.inbox))
            BabblerNode(client, config, robot)
            client.ready()
            if client is not service:
                service.ready()
            service.run()


if __name__ == "__main__":
    main()
