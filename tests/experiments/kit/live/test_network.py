# SPDX-License-Identifier: Apache-2.0
"""The wire between two interfaces, with pipes in their place: each end is a pair of sockets that keep packets apart."""

from __future__ import annotations

import socket
import time
from collections.abc import Iterator

import pytest

from experiments.kit.live.network import Faults, Wire


@pytest.fixture
def ends() -> Iterator[tuple[socket.socket, ...]]:
    """The two hosts' sockets, and the wire's ends."""
    (first, near), (second, far) = (socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM) for _ in range(2))
    with first, second, near, far:
        yield first, second, near, far


def carried(ends: tuple[socket.socket, ...], faults: Faults, count: int, seed: int = 1) -> list[int]:
    """The numbers of the packets that arrive of `count` sent, in the order of their arrival."""
    first, second, near, far = ends
    wire = Wire((near.fileno(), far.fileno()), seed)
    wire.faults = faults
    second.setblocking(False)
    found: list[int] = []
    for number in range(count):
        first.send(number.to_bytes(2))
        wire.take(near.fileno())
        if number % 10 == 9:  # the sockets hold few packets
            time.sleep(wire.wait() or 0.0)
            time.sleep(faults.delay)
            wire.deliver()
            found += received(second)
    return found


def received(second: socket.socket) -> list[int]:
    found = []
    while True:
        try:
            found.append(int.from_bytes(second.recv(2)))
        except BlockingIOError:
            return found


def test_without_faults_every_packet_arrives_in_order(ends: tuple[socket.socket, ...]) -> None:
    assert carried(ends, Faults(), 50) == list(range(50))


def test_a_cut_lets_nothing_through(ends: tuple[socket.socket, ...]) -> None:
    assert carried(ends, Faults(cut=True), 50) == []


def test_losses_have_their_share_and_are_those_of_the_seed(ends: tuple[socket.socket, ...]) -> None:
    found = carried(ends, Faults(loss=0.3), 1000)
    assert 620 < len(found) < 780
    assert found == sorted(found)
    assert carried(ends, Faults(loss=0.3), 1000) == found
    assert carried(ends, Faults(loss=0.3), 1000, seed=2) != found


def test_packets_that_are_not_delayed_overtake_others(ends: tuple[socket.socket, ...]) -> None:
    found = carried(ends, Faults(delay=0.01, reorder=0.3), 100)
    assert sorted(found) == list(range(100))
    assert found != sorted(found)


def test_a_delayed_packet_arrives_after_its_delay(ends: tuple[socket.socket, ...]) -> None:
    first, second, near, far = ends
    wire = Wire((near.fileno(), far.fileno()), 1)
    wire.faults = Faults(delay=0.05)
    second.setblocking(False)
    sent = time.monotonic()
    first.send(b"00")
    wire.take(near.fileno())
    wire.deliver()
    if time.monotonic() < sent + 0.05:
        assert received(second) == []
    time.sleep(wire.wait() or 0.0)
    wire.deliver()
    assert len(received(second)) == 1 and time.monotonic() >= sent + 0.05
