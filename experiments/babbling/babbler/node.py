"""The babbler at work: one posture after the other, to all parts at once."""

from __future__ import annotations

from pathlib import Path

from bus_schema.messages import Clock, Turn
from experiments.babbling.babbler.config import Config
from experiments.babbling.babbler.drives import AtDrives
from experiments.babbling.babbler.goals import AtGoals
from experiments.babbling.command_log import COMMANDS, Commanded, CommandLog
from experiments.babbling.moved import Targets
from mobee.robot.robot import Robot
from services.common.lockstep import Participant
from services.common.service import Service


class BabblerNode:
    """Has its turn tick by tick, writes down every command, and answers the barrier; goes on until it is ended."""

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
        if service.locked and config.at == "goals":  # behind the controller, when something may have come to its end
            service.on_turn(self._tick)
        else:
            service.on_clock(self._tick)

    def _tick(self, now: Clock | Turn) -> None:
        if now.k > 0:  # tick 0 gathers those who take part
            self._mover.move(now.k, now.dt * 1e-9)
        self._participant.done(now.k)

    def _note(self, commanded: Commanded) -> None:
        self._commands += 1
        self._log.note(commanded)
