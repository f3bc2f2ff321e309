# SPDX-License-Identifier: Apache-2.0
"""Two hosts on one machine: two network namespaces, joined by a wire with random faults.  No packet leaves the machine.

The faults are delay, loss, reordering, and a cut, of which no program is notified.  The wire uses TUN interfaces: the kernel's own emulator
(netem) has no seed before Linux 6.6, and many kernels do not contain it.
"""

from __future__ import annotations

import ctypes
import fcntl
import heapq
import os
import random
import selectors
import struct
import subprocess
import sys
import threading
import time
from collections.abc import Sequence
from contextlib import suppress
from types import TracebackType
from typing import BinaryIO, Self

import msgspec
from msgspec import Struct

from experiments.kit.live.launch import LaunchFailed

_LARGEST = 65536  # bytes of a packet
_AT_ONCE = 64  # packets that are read in a row
FIRST, SECOND = "10.77.0.1", "10.77.0.2"  # addresses of the hosts
AHEAD = 3600  # s by which the monotonic clock of the second host is ahead
_TUN = "/dev/net/tun"
_TUNSETIFF, _IFF_TUN, _IFF_NO_PI = 0x400454CA, 0x0001, 0x1000
_CLONE_NEWNET = 0x40000000
_PATIENCE = 5.0  # s


class Faults(Struct, frozen=True):
    """What the wire does to packets, in both directions.

    `delay`: s.  `loss`: share of packets that are lost.  `reorder`: share of packets that are not delayed, and so overtake others.  `cut`:
    all packets are lost.
    """

    delay: float = 0.0  # s
    loss: float = 0.0  # share of packets that are lost
    reorder: float = 0.0  # share of packets that are not delayed, so that they overtake others
    cut: bool = False  # all are lost


def inside(argv: Sequence[str]) -> list[str]:
    """Return the command that runs the command `argv` in a new network namespace, in which it is permitted to make a `Network`."""
    return ["unshare", "--net", "--map-root-user", "--", *argv]


def refused() -> str:
    """Return the reason why the present user cannot make network namespaces and interfaces on this machine; "" if this is possible."""
    program = "from experiments.kit.live.network import Network\nwith Network(0): pass"
    try:
        done = subprocess.run(inside([sys.executable, "-c", program]), capture_output=True, text=True, timeout=30.0)
    except (OSError, subprocess.TimeoutExpired) as error:
        return f"network namespaces cannot be made here: {error}"
    return "" if done.returncode == 0 else f"network namespaces cannot be made here: {(done.stderr.strip().splitlines() or ['?'])[-1]}"


class Network:
    """Two hosts and the wire between them: the network namespace of this process is the first host, a new namespace the second.

    A `with` statement makes and removes the second host and the wire.  The process must run in a network namespace of its own: start it by
    the command that `inside` returns.
    """

    def __init__(self, seed: int) -> None:
        """`seed`: of the random faults of the wire."""
        self._seed = seed
        self._wire: subprocess.Popen[bytes] | None = None
        self._files: list[int] = []

    def __enter__(self) -> Self:
        self._second = self._new_namespace()
        ends = [_tun("mobee0", None), _tun("mobee0", self._second)]
        self._files += ends
        argv = [sys.executable, "-m", "experiments.kit.live.network", *map(str, ends), str(self._seed)]
        self._wire = subprocess.Popen(argv, stdin=subprocess.PIPE, pass_fds=ends)
        for command, address, peer in ((self.on_first, FIRST, SECOND), (self.on_second, SECOND, FIRST)):
            for words in ("link set lo up", f"addr add {address} peer {peer} dev mobee0", "link set mobee0 up"):
                _run(command(["ip", *words.split()]))
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        if self._wire is not None:
            self._wire.kill()
            self._wire.communicate()
        for file in self._files:
            os.close(file)

    def set(self, faults: Faults) -> None:
        """Set the faults of the wire from now on: delay, loss, reordering and cut."""
        assert self._wire is not None and self._wire.stdin is not None
        self._wire.stdin.write(msgspec.json.encode(faults) + b"\n")
        self._wire.stdin.flush()

    def plug(self, up: bool) -> None:
        """Set the network interface of the second host up or down.

        The programs of this host notice this at once.  They do not notice a cut of the wire at once.
        """
        _run(self.on_second(["ip", "link", "set", "mobee0", "up" if up else "down"]))

    def on_first(self, argv: Sequence[str]) -> list[str]:
        """Return the command that runs the command `argv` on the first host."""
        return list(argv)

    def on_second(self, argv: Sequence[str]) -> list[str]:
        """Return the command that runs the command `argv` on the second host, whose monotonic clock is ahead by AHEAD (3600 s)."""
        namespace = f"--net=/proc/{os.getpid()}/fd/{self._second}"
        return ["nsenter", namespace, "unshare", "--time", f"--monotonic={AHEAD}", f"--boottime={AHEAD}", "--", *argv]

    def _new_namespace(self) -> int:
        """Make a network namespace, and return an open file that keeps it."""
        own = os.readlink("/proc/self/ns/net")
        holder = subprocess.Popen(["unshare", "--net", "sleep", "60"])
        place = f"/proc/{holder.pid}/ns/net"
        give_up = time.monotonic() + _PATIENCE
        try:
            while os.readlink(place) == own:
                if time.monotonic() > give_up or holder.poll() is not None:
                    raise LaunchFailed("a second network namespace cannot be made here")
                time.sleep(0.01)
            found = os.open(place, os.O_RDONLY)
        finally:
            holder.kill()
            holder.wait()
        self._files.append(found)
        return found


def _tun(name: str, namespace: int | None) -> int:
    """Make a TUN interface in a namespace, or in that of this process, and return its file."""
    made: list[int | OSError] = []

    def make() -> None:
        """Make the interface, and append its file descriptor or the error to `made`.

        It runs in a thread of its own: only this thread enters the namespace.
        """
        try:
            if namespace is not None and ctypes.CDLL(None, use_errno=True).setns(namespace, _CLONE_NEWNET) != 0:
                raise OSError(ctypes.get_errno(), os.strerror(ctypes.get_errno()), "setns")
            file = os.open(_TUN, os.O_RDWR)
            fcntl.ioctl(file, _TUNSETIFF, struct.pack("16sH22x", name.encode(), _IFF_TUN | _IFF_NO_PI))
            made.append(file)
        except OSError as error:
            made.append(error)

    thread = threading.Thread(target=make)
    thread.start()
    thread.join()
    result = made[0]
    if isinstance(result, OSError):
        raise LaunchFailed(f"no network interface can be made here: {result}")
    return result


def _run(argv: Sequence[str]) -> None:
    done = subprocess.run(argv, capture_output=True, text=True)
    if done.returncode != 0:
        raise LaunchFailed(f"{' '.join(argv)}: {done.stderr.strip()}")


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
