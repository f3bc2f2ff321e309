# SPDX-License-Identifier: Apache-2.0
"""Opens Zenoh sessions, as a client of the launcher's router or as that router."""

from __future__ import annotations

import json
import os
import re
import socket
import sys
import tempfile
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress

import zenoh

from services.common.identity import LONGEST_SOCKET, Identity, is_local, secured

Session = zenoh.Session  # for modules that do not import zenoh

NAMESPACE = "icub"  # of the robot itself
LEASE = 1.0  # s
_MOST_CONNECTIONS = 10_000  # of a router
LOCAL_ENDPOINT = "MOBEE_LOCAL_ENDPOINT"  # environment variable: address at which a service connects to the router, instead of its endpoint

_COMMON: dict[str, object] = {
    "scouting/multicast/enabled": False,
    "scouting/gossip/enabled": False,
    "transport/shared_memory/enabled": False,
    "transport/unicast/open_timeout": 2000,  # ms; a listener that does not answer blocks `open`, and signals, for so long
    "timestamping/enabled": {"router": True, "peer": True, "client": True},  # events keep a history
}


_ONE_THREAD = "(rx: (worker_threads: 1), tx: (handover: rx), acc: (handover: rx), app: (handover: rx), net: (handover: rx))"


_NOT_HELD_UP: dict[str, object] = {
    "qos/network": [
        {
            "id": "observers",
            "link_protocols": ["tcp"],
            "flows": ["egress"],
            "messages": ["put"],
            "overwrite": {"congestion_control": "drop"},
        }
    ],
    "transport/link/tx/queue/size/real_time": 16,  # batches of 64 kB: for observers that get no processor for a moment
    "transport/link/tx/queue/congestion_control/drop/wait_before_drop": 0,
}
"""Settings of a router at which the services that depend on each other have a local endpoint: clients that connect by TCP only observe.

A router with one thread would wait in vain until a full queue has room, because the same thread empties it.
"""


class BusUnreachable(Exception):
    """Raised if there is no router at the endpoint, or if a router cannot listen there; the message has the endpoint and the remedy."""


def _config(namespace: str, lease: float, settings: dict[str, object]) -> zenoh.Config:
    config = zenoh.Config()
    for path, value in {**_COMMON, "namespace": namespace, "transport/link/tx/lease": round(1e3 * lease), **settings}.items():
        config.insert_json5(path, json.dumps(value))
    return config


def end_unreceived(endpoint: str, lease: float) -> None:
    """Let Linux end a connection of this process at `endpoint` if sent data does not arrive at the other side for `lease` [s].

    This sets the socket option TCP_USER_TIMEOUT; on other systems nothing is changed. Zenoh itself ends a silent connection after the
    lease, but with TLS it first waits until the data in the socket is sent. After an interruption of the network, this wait can last long
    after the network works again. For an endpoint of this host nothing is changed: the network cannot interrupt such a connection, and the
    other process may be paused on a busy machine for longer than the lease. A router calls this once, because the connections that it
    accepts inherit the option of its listening socket. A client must call this again for each new connection.
    """
    if not is_local(endpoint) and hasattr(socket, "TCP_USER_TIMEOUT"):
        _set_option(sockets_at(endpoint), socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, round(1e3 * lease))


def receive_together(sockets: Iterable[int], count: int) -> None:
    """Let Linux wake this process for data of a connection only when `count` bytes wait there; on other systems nothing is changed.

    `sockets`: file descriptors of the connections, as `sockets_at` returns them. `count` = 1: the process is woken for any data, and at
    once if data already waits. A caller that sets a larger `count` must call this again with `count` = 1 several times per lease, so that
    waiting data is received. The lease is a time set in Zenoh: a connection from which nothing is received for a whole lease counts as
    dead.
    """
    if sys.platform == "linux":
        _set_option(sockets, socket.SOL_SOCKET, socket.SO_RCVLOWAT, count)


def sockets_at(endpoint: str) -> list[int]:
    """Return the descriptors of this process's TCP sockets that listen at the port of `endpoint`, or are connected to this port.

    Empty if the endpoint has no port, or the system has no folder /proc.
    """
    port = endpoint.rpartition(":")[2]
    if not port.isdecimal() or not os.path.isdir("/proc/self/fd"):
        return []
    found = []
    for number in map(int, os.listdir("/proc/self/fd")):
        try:
            one = socket.socket(fileno=number)
        except OSError:  # no socket, or closed meanwhile
            continue
        try:
            if one.family in (socket.AF_INET, socket.AF_INET6) and one.type == socket.SOCK_STREAM and int(port) in _ports(one):
                found.append(number)
        except OSError:  # closed meanwhile
            continue
        finally:
            one.detach()  # it stays Zenoh's
    return found


def _set_option(sockets: Iterable[int], level: int, option: int, value: int) -> None:
    for number in sockets:
        with suppress(OSError):  # closed meanwhile
            one = socket.socket(socket.AF_INET, socket.SOCK_STREAM, 0, fileno=number)
            try:
                one.setsockopt(level, option, value)
            finally:
                one.detach()


def _ports(one: socket.socket) -> tuple[int, ...]:
    """Return the port at which a socket listens, or the one to which it is connected."""
    if one.getsockopt(socket.SOL_SOCKET, socket.SO_ACCEPTCONN):
        return (one.getsockname()[1],)
    return (one.getpeername()[1],)


def spare_threads() -> None:
    """Restrict Zenoh to one thread in this process; call this before the first session.

    This makes lockstep faster, because there the services wait for one message after another. With several threads, Zenoh spends a fifth of
    the time on passing messages from one thread to the next.
    """
    os.environ.setdefault("ZENOH_RUNTIME", _ONE_THREAD)


def spare_memory() -> None:
    """Let Zenoh send and receive at most 8 kB at a time in this process; call this before the first session.

    This saves memory and time: for each batch of messages that it receives, Zenoh allocates and clears a buffer of the largest possible
    size, by default 64 kB.
    """
    _COMMON["transport/link/tx/batch_size"] = 8192


@contextmanager
def local_endpoint() -> Iterator[str]:
    """Yield the address of a Unix socket in a private folder: a second address of a router, for processes on this machine.

    Such a socket is faster than TCP on the loopback interface. The address is empty if the system has no Unix sockets, or if the path of
    the socket would be too long. The folder is removed at the end of the `with` block.
    """
    with tempfile.TemporaryDirectory(prefix="mobee-") as folder:
        path = f"{folder}/bus"
        yield f"unixsock-stream/{path}" if os.name == "posix" and len(path) <= LONGEST_SOCKET else ""


def open_client(endpoint: str, patience: float = 10.0, namespace: str = NAMESPACE, lease: float = LEASE) -> zenoh.Session:
    """Open a session with the router at `endpoint`, trying for `patience` seconds; raises BusUnreachable.

    `namespace`: prefix of all keys: "icub" for the robot itself, or the prefix under which the port filter (MoBeE 1.0, a service between
    other programs and the robot) serves its clients. `lease`: time [s] without a message after which this process counts as dead. If the
    environment variable MOBEE_KEYS is set, the connection is secured with the identity of this process (`Identity.of_environment`). Raises
    BadKeys if its keys are missing, or if other users can read them.
    """
    identity = Identity.of_environment()
    place = endpoint if identity is None else secured(endpoint)
    settings: dict[str, object] = {
        "mode": "client",
        "connect/retry": {"period_init_ms": 100, "period_max_ms": 500, "period_increase_factor": 1.5},
    }
    if identity is not None:
        identity.require()
        settings |= identity.settings()
    settings["connect/endpoints"] = [endpoint] if identity is None else identity.endpoints(endpoint)
    give_up = time.monotonic() + patience
    while True:
        try:
            session = zenoh.open(_config(namespace, lease, settings))
            end_unreceived(place, lease)
            return session
        except zenoh.ZError as error:
            if time.monotonic() >= give_up:
                secure = "its keys with --keys, if it is secured" if identity is None else f"other keys than {identity.folder} with --keys"
                raise BusUnreachable(
                    f"no router at {place} within {patience:g} s ({_reason(error)}). Is the system up? Start it with `mobee launch`, "
                    f"or name its endpoint with --endpoint, or {secure}."
                ) from None
            time.sleep(0.1)


def open_router(
    endpoint: str, lease: float = LEASE, local_endpoint: str = "", identity: Identity | None = None, access: dict[str, object] | None = None
) -> zenoh.Session:
    """Open a session that is the router and listens at `endpoint`; raises BusUnreachable if it cannot listen there.

    `lease`: time [s] without a message after which a connection counts as dead. `local_endpoint`: a second address, for processes on this
    machine; empty: none. `identity`: identity of a secured router; None: the router is not secured. The second address of a secured router
    is `Identity.socket`, and `local_endpoint` is not used. `access`: access list of a secured router, as
    `services.common.access.access_list` returns it. A new connection that sends nothing is closed after 5 s. Up to 10 000 new connections
    may wait to be accepted, so that silent connections cannot block other processes.
    """
    settings: dict[str, object] = {
        "mode": "router",
        "listen/endpoints": [endpoint, *filter(None, [local_endpoint])],
        "transport/unicast/accept_pending": _MOST_CONNECTIONS,
        "transport/unicast/accept_timeout": 5000,  # ms
        "transport/unicast/max_sessions": _MOST_CONNECTIONS,
    }
    if identity is not None:
        listens = [endpoint, *filter(None, [identity.socket(endpoint)])]
        settings |= {**identity.settings(), "access_control": access, "listen/endpoints": listens}
    if local_endpoint:
        settings |= _NOT_HELD_UP
    _allow_many_descriptors()
    try:
        router = zenoh.open(_config(NAMESPACE, lease, settings))
        end_unreceived(endpoint, lease)
        return router
    except zenoh.ZError as error:
        raise BusUnreachable(
            f"cannot listen at {endpoint}: {_reason(error)}. If another system runs there, end it with `mobee stop --endpoint {endpoint}`, "
            "or choose another endpoint with --endpoint, such as tcp/127.0.0.1:7448."
        ) from None


def _allow_many_descriptors() -> None:
    """Let this process open as many files as the system allows it to: each connection is one."""
    with suppress(ImportError, ValueError, OSError):  # not on Windows; refused
        import resource

        _, most = resource.getrlimit(resource.RLIMIT_NOFILE)
        resource.setrlimit(resource.RLIMIT_NOFILE, (most, most))


def _reason(error: zenoh.ZError) -> str:
    """Return Zenoh's error message without the positions in its source files."""
    text = re.sub(r" at /\S+\.rs:\d+\.?", "", str(error)).strip(" .")
    text = re.sub(r'^Json5Err\(Message \{ msg: "(.*?)", location:.*', r"\1", text)
    return re.sub(r"Unable to connect to any of \[.*\]!", "no answer", text)
