"""The arm on the live robot, with the ticks at which its reaches were asked for, moved it, and ended."""

from __future__ import annotations

import numpy as np

from bus_schema import keys
from bus_schema.chain import Commands
from bus_schema.messages import Reach
from bus_schema.rpc import Request
from experiments.live_reach.settings import PART
from mobee.robot.robot import Array, Robot
from services.common.bus_plant import BusPlant
from services.common.service import Service

MOVES = 5e-3  # rad/s by which a command that moves differs from the last before the request


class Hand(BusPlant):
    """A BusPlant that knows its ticks."""

    def __init__(self, service: Service, robot: Robot) -> None:
        super().__init__(service, robot, (PART,))
        self._link, self._where = service, robot.part(PART).slice
        self.end = 0
        """Tick at which the force of the last reach ended."""
        self.first = -1
        """Ticks from the request of the last reach to the first command that moves; -1: not looked at."""
        self.asked = 0
        """Tick of the last request."""
        self._before: Array | None = None
        service.on_each(keys.reach(PART), Reach, self._note_reach, part=PART)

    @property
    def tick(self) -> int:
        """Now: in lockstep who has no turn hears of his part alone."""
        motion = self._motion.get(PART)
        return self._link.bus.k if motion is None else max(self._link.bus.k, motion.k)

    def look_at_commands(self) -> None:
        """Find out how soon a reach moves; costs time in every tick."""
        self._link.on_each(keys.COMMANDS, Commands, self._note_commands)

    def _ask(self, part: str, verb: str, request: type[Request], **fields: object) -> int:
        self.first = -1
        self.asked = super()._ask(part, verb, request, **fields)
        return self.asked

    def _note_reach(self, reach: Reach) -> None:
        self.end = reach.end_k

    def _note_commands(self, commands: Commands) -> None:
        """Those formed of tick k act from tick k + 1 on; what is asked for in tick k is known to those of the next."""
        reference = np.array(commands.ref[self._where])
        if commands.re_k <= self.asked:
            self._before = reference
        elif self.first < 0 and self._before is not None and np.abs(reference - self._before).max() > MOVES:
            self.first = commands.re_k + 1 - self.asked
