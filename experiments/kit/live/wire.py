# SPDX-License-Identifier: Apache-2.0
"""A wire between two network interfaces, with random faults: delay, loss, reordering, and a cut, of which no program is notified.

The wire uses TUN interfaces.  The kernel's own emulator (netem) has no seed before Linux 6.6, and many kernels do not contain it.
"""

from __future__ import annotations

import heapq
import os
import random
import selectors
import sys
import time
from contextlib import suppress
from typing import BinaryIO

import msgspec
from msgspec import Struct

_LARGEST = 65536  # bytes of a packet
_AT_ONCE = 64  # packets that are read in a row


class Faults(Struct, frozen=True):
    """What the wire does to packets, in both directions.

    `delay`: s.  `loss`: share of packets that are lost.  `reorder`: share of packets that are not delayed, and so overtake others.  `cut`:
    all packets are lost.
    """

    delay: float = 0.0  # s
    loss: float = 0.0  # share of packets that are lost
    reorder: float = 0.0  # share of packets that are not delayed, so that they overtake others
    cut: bool = False  # all are lost


class Wire:
    """Carries packets between two TUN interfaces.

    Attributes:
        faults: what happens to packets that `take` reads after this attribute was set.
        carried: number of packets that were not lost.
        lost: number of lost packets.
    """

    def __init__(self, ends: tuple[int, int], seed: int) -> None:
        """`ends`: file descriptors of the two interfaces.  `seed`: of the random faults."""
        self.faults = Faults()
        self.carried = self.lost = 0
        self._other = {ends[0]: ends[1], ends[1]: ends[0]}
        self._random = random.Random(seed)
        self._under_way: list[tuple[float, int, int, bytes]] = []  # time of arrival, number, end, packet
        for end in ends:
            os.set_blocking(end, False)

    def wait(self) -> float | None:
        """Return the time [s] until the next packet is due for delivery; None if there is no packet on the wire."""
        return max(0.0, self._under_way[0][0] - time.monotonic()) if self._under_way else None

    def take(self, end: int) -> None:
        """Read the packets that an interface has sent, at most 64, and lose or delay them as `faults` says.

        `end`: file descriptor of the interface.
        """
        for _ in range(_AT_ONCE):
            try:
                packet = os.read(end, _LARGEST)
            except OSError:  # none waits, or the interface is down
                return
            faults = self.faults
            if faults.cut or self._random.random() < faults.loss:
                self.lost += 1
                continue
            delay = 0.0 if self._random.random() < faults.reorder else faults.delay
            self.carried += 1
            heapq.heappush(self._under_way, (time.monotonic() + delay, self.carried, self._other[end], packet))

    def deliver(self) -> None:
        """Write the packets that are due to the interface at the other end of the wire."""
        while self._under_way and self._under_way[0][0] <= time.monotonic():
            *_, end, packet = heapq.heappop(self._under_way)
            with suppress(OSError):  # the interface is down, or full: the packet is lost
                os.write(end, packet)


def run(ends: tuple[int, int], seed: int, commands: BinaryIO) -> None:
    """Carry packets between two interfaces until the stream `commands` ends.

    `ends`: file descriptors of the interfaces.  `seed`: seed of the random faults.  `commands`: each line has new `Faults` as JSON.
    """
    wire = Wire(ends, seed)
    with selectors.DefaultSelector() as selector:
        for source in (*ends, commands.fileno()):
            selector.register(source, selectors.EVENT_READ)
        while True:
            for key, _ in selector.select(wire.wait()):
                if key.fd != commands.fileno():
                    wire.take(key.fd)
                elif line := commands.readline():
                    wire.faults = msgspec.json.decode(line, type=Faults)
                else:
                    return
            wire.deliver()


if __name__ == "__main__":
    run((int(sys.argv[1]), int(sys.argv[2])), int(sys.argv[3]), os.fdopen(0, "rb", buffering=0))
