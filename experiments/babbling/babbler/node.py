"""The babbler at work: one posture after the other, to all parts at once, until its ticks are over."""

from __future__ import annotations

from pathlib import Path

from bus_schema.messages import Clock
from experiments.babbling.babbler.config import Config
from experiments.babbling.babbler.drives import AtDrives
from experiments.babbling.babbler.goals import AtGoals
from experiments.babbling.command_log import COMMANDS, Commanded, CommandLog
from experiments.babbling.moved import Targets
from mobee.robot.robot import Robot
from services.common.lockstep import Participant
from services.common.service import Service


class BabblerNode:
    """Counts the ticks, writes down every command, and answers the barrier; the process ends when its ticks are over."""

    def __init__(self, service: Service, config: Config, robot: Robot) -> None:
        self._ticks = config.ticks
        self._log = CommandLog(Path(config.run_dir) / COMMANDS)
        self._participant = Participant(service)
        self._commands = 0
        targets = Targets(robot, config.seed)
        if config.at == "drives":
            self._mover: AtDrives | AtGoals = AtDrives(service, robot, targets, config.speed, self._note, self._tick)
        else:
            self._mover = AtGoals(service, robot, targets, self._note, self._tick)
        service.describe = lambda: (f"{self._commands} commands", {"commands": self._commands})

    def _tick(self, clock: Clock) -> None:
        is_over = clock.k >= self._ticks
        if not is_over and clock.k > 0:  # tick 0 gathers those who take part
            self._mover.move(clock)
        if is_over:
            self._log.finish(clock.k)
        self._participant.done(clock.k, last=is_over)
        if is_over:
            raise SystemExit(0)

    def _note(self, commanded: Commanded) -> None:
        self._commands += 1
        self._log.note(commanded)
