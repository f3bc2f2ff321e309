"""What one part is told to do, whichever message said so."""

from __future__ import annotations

import numpy as np
from msgspec import Struct

from bus_schema.chain import Commands
from bus_schema.messages import Command, Mode
from mobee.robot.robot import Array, Robot


class Order(Struct, frozen=True, eq=False):
    """See `Command`; `reference` (n,) rad, rad/s or N m by mode."""

    src: str
    epoch: int
    seq: int
    re_k: int
    mode: Mode
    reference: Array
    ttl: int  # ms

    @classmethod
    def of(cls, command: Command) -> Order:
        """That of a command to one part."""
        return cls(command.src, command.epoch, command.seq, command.re_k, command.mode, np.array(command.ref), command.ttl)


def orders_of(commands: Commands, robot: Robot) -> dict[str, Order]:
    """Those of a message to several parts, by part; raises KeyError for one that the robot does not have."""
    reference = np.array(commands.ref)
    src, seq, re_k, ttl = commands.src, commands.seq, commands.re_k, commands.ttl
    return {
        part: Order(src, order.epoch, seq, re_k, order.mode, reference[robot.parts[part].slice], ttl)
        for part, order in commands.parts.items()
    }
