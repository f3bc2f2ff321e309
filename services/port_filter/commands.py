"""Commands of one part to robot_sim: forwarded from the client, or from the reflex."""

from __future__ import annotations

from collections import OrderedDict

from bus_schema.messages import Command, Mode
from services.common.bus import Bus

REMEMBERED = 1000  # commands under way, at most


class Stream:
    """One stream with one numbering, and which number of the client's is behind each."""

    def __init__(self, bus: Bus, part: str) -> None:
        self._stream = bus.publisher(Command, part)
        self._seq = 0
        self._theirs: OrderedDict[int, int] = OrderedDict()

    def forward(self, command: Command) -> None:
        """Pass a client's command on."""
        self._theirs[self._seq] = command.seq
        if len(self._theirs) > REMEMBERED:
            self._theirs.popitem(last=False)
        self.put(command.epoch, command.re_k, command.mode, command.ref, command.ttl)

    def put(self, epoch: int, re_k: int, mode: Mode, reference: list[float], ttl: int) -> None:
        """Command the part."""
        self._stream.put(epoch=epoch, re_k=re_k, mode=mode, ref=reference, ttl=ttl)
        self._seq += 1

    def theirs(self, seq: int) -> int:
        """The client's number of what robot_sim knows as `seq`; -1 when it was none of the client's."""
        return self._theirs.get(seq, -1)
