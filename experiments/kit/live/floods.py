# SPDX-License-Identifier: Apache-2.0
"""Floods of messages, calls, tokens, connections and datagrams, each from its own process: `python -m experiments.kit.live.floods`.

A flood is one kind of message, call, liveliness token or datagram at a high rate, or 1000 idle connections, to disturb a live system.  It
needs no secret: every program on the machine that follows the documentation of the bus can send it.
"""

from __future__ import annotations

import secrets
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Any

from bus_schema import VERSION, encode, encoding_of, keys
from bus_schema.messages import Clock, Commands, EStop, Event, Forces, Image, Message, Motion, State, Tick, Transition, WorldObject
from bus_schema.rpc import Empty
from experiments.kit.live.launch import LaunchFailed
from services.common.emergency_stop import datagram_address
from services.common.session import open_client

MESSAGES, BIG_MESSAGES, CALLS, TOKENS = 10_000, 100, 1_400, 500  # a second
IDLE = 1000  # connections on which nothing is sent
_BURST = 0.005  # s between two bursts of a flood
_BIG = bytes(1_000_000)
_GARBAGE = b"\xc1" + bytes(99)  # no msgpack


def _paced(rate: float, send: Callable[[], object]) -> None:
    """Call `send` `rate` times a second, in short bursts; never returns."""
    begun, sent = time.monotonic(), 0
    while True:
        due = int((time.monotonic() - begun) * rate)
        for _ in range(due - sent):
            send()
        sent = due
        time.sleep(_BURST)


def _put(cls: type[Message], name: str, payload: bytes, rate: float) -> Callable[[str], None]:
    def flood(endpoint: str) -> None:
        with open_client(endpoint) as session:
            publisher = session.declare_publisher(cls.stream.key(name), encoding=encoding_of(cls))
            _paced(rate, lambda: publisher.put(payload))

    return flood


def _no_stop() -> bytes:
    """Return a message on `estop` that sets no stop."""
    return encode(EStop(v=VERSION, run="-", src="flood", seq=0, k=0, t=0, tw=0, set=False, source="flood", reason=""))


def _ask_stat(endpoint: str) -> None:
    key = keys.service_rpc("robot_sim", "stat")

    def ask() -> None:
        session.get(key, payload=encode(Empty(v=VERSION, id=secrets.token_hex(8), who="flood")), encoding=encoding_of(Empty), timeout=1.0)

    with open_client(endpoint) as session:
        _paced(CALLS, ask)


def _come_and_go(endpoint: str) -> None:
    with open_client(endpoint) as session:
        liveliness: Any = session.liveliness()
        _paced(TOKENS, lambda: liveliness.declare_token(keys.alive("model", f"i{secrets.token_hex(6)}")).undeclare())


def _connect(endpoint: str) -> None:
    """Keep IDLE connections; one that the router closes or refuses is opened again."""
    host, _, port = endpoint.removeprefix("tcp/").rpartition(":")
    held: list[socket.socket] = []
    while True:
        for connection in [each for each in held if _is_closed(each)]:
            held.remove(connection)
            connection.close()
        with suppress(OSError):  # the router refuses, or does not answer in time: the next round tries again
            while len(held) < IDLE:
                connection = socket.create_connection((host, int(port)), timeout=1.0)
                connection.setblocking(False)
                held.append(connection)
        time.sleep(0.05)


def _is_closed(connection: socket.socket) -> bool:
    try:
        return not connection.recv(1)
    except BlockingIOError:  # nothing was sent
        return False
    except OSError:
        return True


def _send_datagrams(endpoint: str) -> None:
    """Send garbage to the address at which robot_sim receives stops without the router."""
    host, _, port = datagram_address(endpoint).rpartition(":")
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        sender.connect((host, int(port)))

        def send() -> None:
            with suppress(OSError):  # no process receives there
                sender.send(_GARBAGE)

        _paced(MESSAGES, send)


FLOODS: dict[str, Callable[[str], None]] = {
    "estop, set = false": _put(EStop, "", _no_stop(), MESSAGES),
    "estop, garbage": _put(EStop, "", _GARBAGE, MESSAGES),
    "calls of robot_sim's stat": _ask_stat,
    "tick, garbage": _put(Tick, "", _GARBAGE, MESSAGES),
    "clock, garbage": _put(Clock, "", _GARBAGE, MESSAGES),
    "commands, garbage": _put(Commands, "", _GARBAGE, MESSAGES),
    "state, garbage": _put(State, "left_arm", _GARBAGE, MESSAGES),
    "motion, garbage": _put(Motion, "left_arm", _GARBAGE, MESSAGES),
    "forces, garbage": _put(Forces, "model", _GARBAGE, MESSAGES),
    "event, garbage": _put(Event, "flood", _GARBAGE, MESSAGES),
    "world, garbage": _put(WorldObject, "flood", _GARBAGE, MESSAGES),
    "transition, garbage": _put(Transition, "left_arm", _GARBAGE, MESSAGES),
    "commands, 1 MB": _put(Commands, "", _BIG, BIG_MESSAGES),
    "world, 1 MB": _put(WorldObject, "flood", _BIG, BIG_MESSAGES),
    "image, 1 MB": _put(Image, "left", _BIG, BIG_MESSAGES),
    "tokens": _come_and_go,
    "idle connections": _connect,
    "datagrams, garbage": _send_datagrams,
}


@contextmanager
def flood(endpoint: str, name: str) -> Iterator[None]:
    """Send a flood (messages at a high rate) from another process while the body of a `with` statement runs.

    `name`: key of the flood in FLOODS.  `endpoint`: address of the router.  Raises LaunchFailed at the end of the statement if the flood's
    process has already ended.
    """
    process = subprocess.Popen([sys.executable, "-m", "mobee_system.run", "experiments.kit.live.floods", endpoint, name])
    try:
        yield
        if process.poll() is not None:
            raise LaunchFailed(f"the flood {name!r} ended with code {process.returncode} while it was needed")
    finally:
        process.kill()
        process.wait()


def main() -> None:
    """Send a flood until the process is killed; command line: address of the router, and key of the flood in FLOODS."""
    endpoint, name = sys.argv[1:]
    FLOODS[name](endpoint)


if __name__ == "__main__":
    main()
