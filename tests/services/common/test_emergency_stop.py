# SPDX-License-Identifier: Apache-2.0
"""The emergency stop on disk, on the bus and in datagrams."""

from __future__ import annotations

import socket
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import pytest
import zenoh

from bus_schema import VERSION, encode, encoding_of
from bus_schema.messages import EStop
from services.common.emergency_stop import Stop, StopDatagrams, StopLine, StopRecord, StopSender, datagram_address
from services.common.session import open_client
from tests.services.harness import Rig, wait_for

STOP = Stop("mobee", "a hand in the way", 1.8e9)


def test_a_record_holds_the_stop_until_its_release_and_the_newest_creation_changes_nothing(tmp_path: Path) -> None:
    record = StopRecord(tmp_path / "states" / "stop.json")
    record.create()
    assert record.read() is None
    record.latch(STOP)
    record.create()
    record.remove()
    assert StopRecord(record.path).read() == STOP
    before = record.released_at()
    record.release()
    assert record.read() is None and record.released_at() > before
    record.remove()
    assert list(record.path.parent.iterdir()) == []


def test_a_stop_that_another_process_records_is_noticed_once_and_the_end_of_a_launch_is_none(tmp_path: Path) -> None:
    watching, other = StopRecord(tmp_path / "stop.json"), StopRecord(tmp_path / "stop.json")
    assert watching.new_stop() is None
    other.create()
    assert watching.new_stop() is None
    other.latch(STOP)
    assert [watching.new_stop() for _ in range(2)] == [STOP, None]
    other.release()
    assert watching.new_stop() is None
    other.remove()
    assert watching.new_stop() is None


def test_a_stop_is_recorded_for_a_robot_of_this_machine_only_and_does_not_replace_another(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    endpoint = "tcp/127.0.0.1:7447"
    record = StopRecord.of_endpoint(endpoint)
    assert not record.stop("page", "pressed")
    assert not record.path.parent.exists()
    record.create()
    assert StopRecord.of_endpoint("tls/127.0.0.1:7447").stop("page", "pressed")
    assert record.stop("mobee", "later")
    stop = record.read()
    assert stop is not None and (stop.source, stop.reason) == ("page", "pressed")


DAMAGED = [b"", b"{", b"null", b"[]", b'{"stopped": true}', b'{"stopped": 0}', b'{"stopped": "false"}', b"\xff\x00", b"[" * 100_000]


@pytest.mark.parametrize("content", [None, *DAMAGED])
def test_a_record_that_is_absent_or_damaged_counts_as_a_stop(tmp_path: Path, content: bytes | None) -> None:
    path = tmp_path / "stop.json"
    if content is not None:
        path.write_bytes(content)
    stop = StopRecord(path).read()
    assert stop is not None and str(path) in stop.reason
    assert StopRecord(path).released_at() == 0


def test_each_endpoint_has_a_record_of_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    paths = {StopRecord.of_endpoint(endpoint).path for endpoint in ("tcp/127.0.0.1:7447", "tcp/127.0.0.1:7448", "tcp/[::1]:7447")}
    assert len(paths) == 3 and all(path.is_relative_to(tmp_path) for path in paths)


def message(sets: bool, reason: str) -> bytes:
    return encode(EStop(v=VERSION, run="r", src="test", seq=0, k=0, t=0, tw=0, set=sets, source="test", reason=reason))


def test_a_stop_is_heard_among_messages_that_set_none_and_only_once(bus: Rig) -> None:
    # Without blocking, Zenoh drops messages of such a burst: a real stop is repeated, this one is sent once.
    key, how = EStop.stream.key(), {"encoding": encoding_of(EStop), "congestion_control": zenoh.CongestionControl.BLOCK}
    with open_client(bus.endpoint) as session:
        line = StopLine(session)
        wait_for(lambda: bus.session.put(key, message(True, "first"), **how) or line.take(), "the first stop")
        wait_for(lambda: not line.take(), "silence")
        for number in range(3000):
            bus.session.put(key, message(False, f"no {number}"), **how)
            bus.session.put(key, b"\xc1 garbage set\xc3", **how)
        bus.session.put(key, message(True, "x" * 1_000_000), **how)  # longer than a reason may be
        bus.session.put(key, message(True, "second"), **how)
        heard: list[EStop] = []
        wait_for(lambda: heard.extend(line.take()) or heard, "the second stop")
        assert [stop.reason for stop in heard] == ["second"]
        assert line.take() == []


@pytest.mark.parametrize(
    ("endpoint", "address"),
    [
        ("tcp/192.168.1.5:7447", "192.168.1.5:7447"),
        ("tcp/[::1]:7447#iface=eth0", "[::1]:7447"),
        ("tls/192.168.1.5:7447", ""),
        ("unixsock-stream/bus", ""),
    ],
)
def test_a_robot_without_keys_receives_datagrams_at_the_number_of_its_port(endpoint: str, address: str) -> None:
    assert datagram_address(endpoint) == address


@pytest.fixture
def datagrams(free_port: int) -> Iterator[StopDatagrams]:
    receiver = StopDatagrams(f"127.0.0.1:{free_port}")
    yield receiver
    receiver.close()


def test_a_datagram_stops_the_robot_and_is_confirmed(datagrams: StopDatagrams, free_port: int) -> None:
    with StopSender(f"tcp/127.0.0.1:{free_port}", "mobee", "a hand in the way") as sender:
        sender.send()
        stops = wait_for(datagrams.take, "the stop")
        assert [(stop.source, stop.reason) for stop in stops] == [("mobee", "a hand in the way")]
        assert not sender.is_confirmed()
        datagrams.confirm()
        wait_for(sender.is_confirmed, "the confirmation")
    assert datagrams.take() == []


@pytest.mark.parametrize("character", ["x", "\N{OCTAGONAL SIGN}"])
def test_a_stop_with_the_longest_reason_is_heard(bus: Rig, datagrams: StopDatagrams, free_port: int, character: str) -> None:
    reason = 2000 * character
    with StopSender(f"tcp/127.0.0.1:{free_port}", "mobee", reason) as sender:
        sender.send()
        assert [stop.reason for stop in wait_for(datagrams.take, "the datagram")] == [reason]
    with open_client(bus.endpoint) as session:
        line = StopLine(session)
        publish = partial(bus.session.put, EStop.stream.key(), message(True, reason), encoding=encoding_of(EStop))
        assert wait_for(lambda: publish() or line.take(), "the message")[0].reason == reason


def test_datagrams_that_set_no_stop_are_dropped_without_an_answer(datagrams: StopDatagrams, free_port: int) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        sender.connect(("127.0.0.1", free_port))
        for payload in (b"", b"\xc1" * 100, b"mobee stopped", message(False, "a release"), message(True, "x" * 5000)):
            sender.send(payload)
        sender.send(message(True, "last"))
        stops = wait_for(datagrams.take, "the stop")
        assert [stop.reason for stop in stops] == ["last"]
        datagrams.confirm()
        sender.settimeout(5.0)
        assert sender.recv(100) == b"mobee stopped"
        sender.setblocking(False)
        with pytest.raises(BlockingIOError):
            sender.recv(100)


@pytest.mark.parametrize("endpoint", ["tls/127.0.0.1:{port}", "tcp/127.0.0.1:{port}"])
def test_a_stop_that_no_process_receives_is_not_confirmed(free_port: int, endpoint: str) -> None:
    with StopSender(endpoint.format(port=free_port), "mobee", "") as sender:
        sender.send()
        sender.send()  # the first one was refused
        assert not sender.is_confirmed()


def test_an_address_in_use_is_an_error(datagrams: StopDatagrams, free_port: int) -> None:
    with pytest.raises(OSError, match="in use"):
        StopDatagrams(f"127.0.0.1:{free_port}")
