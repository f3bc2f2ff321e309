# SPDX-License-Identifier: Apache-2.0
"""Two hosts on one machine: two network namespaces, joined by a wire.  A test sets the wire's faults.  No packet leaves the machine."""

from __future__ import annotations

import ctypes
import fcntl
import os
import struct
import subprocess
import sys
import threading
import time
from collections.abc import Sequence
from types import TracebackType
from typing import Self

import msgspec

from experiments.kit.live.launch import LaunchFailed
from experiments.kit.live.wire import Faults

FIRST, SECOND = "10.77.0.1", "10.77.0.2"  # addresses of the hosts
AHEAD = 3600  # s by which the monotonic clock of the second host is ahead
_TUN = "/dev/net/tun"
_TUNSETIFF, _IFF_TUN, _IFF_NO_PI = 0x400454CA, 0x0001, 0x1000
_CLONE_NEWNET = 0x40000000
_PATIENCE = 5.0  # s


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
        argv = [sys.executable, "-m", "experiments.kit.live.wire", *map(str, ends), str(self._seed)]
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
        """Runs in a thread of its own, which alone enters the namespace."""
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
