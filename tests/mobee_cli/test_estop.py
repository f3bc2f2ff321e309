# SPDX-License-Identifier: Apache-2.0
"""`mobee estop` against a robot that the test plays."""

from __future__ import annotations

import logging
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from bus_schema import VERSION, encode, encoding_of, keys
from bus_schema.messages import EStop, State
from bus_schema.rpc import Done
from mobee_cli import estop
from mobee_cli.__main__ import main
from services.common.bus import Bus
from services.common.emergency_stop import StopDatagrams, StopRecord
from services.common.observe import Received, listen
from services.common.session import open_router


class Robot:
    """Two parts; one of them may be deaf."""

    def __init__(self, endpoint: str) -> None:
        self.session = open_router(endpoint)
        bus = Bus(self.session, "robot_sim", logging.getLogger("robot_sim"))
        self.gates = {"torso": "armed", "head": "armed"}
        self.deaf: set[str] = set()
        self.is_paused = threading.Event()  # no part publishes its state
        self.repeats = False  # the robot repeats a stop that it obeys
        self.stops = bus.publisher(EStop)
        self.over = threading.Event()
        publishers = {part: bus.publisher(State, part) for part in self.gates}
        listen(self.session, EStop.stream.key(), self.stop)
        self.session.declare_queryable(keys.ESTOP_RESET, self.reset)

        def speak() -> None:
            while not self.over.wait(0.02):
                if self.is_paused.is_set():
                    continue
                for part, publisher in publishers.items():
                    publisher.put(
                        q=[0.0],
                        dq=[0.0],
                        tau=[0.0],
                        mode="velocity",
                        gate=self.gates[part],
                        faults=0,
                        epoch=1,
                        cmd_seq=0,
                        cmd_age=1,
                    )

        self.thread = threading.Thread(target=speak)
        self.thread.start()

    def stop(self, heard: Received) -> None:
        self.gates.update({part: "estop" for part in self.gates if part not in self.deaf})
        if self.repeats and heard.content()["src"] != "robot_sim":
            self.stops.put(set=True, source="mobee", reason="repeated")

    def release(self) -> None:
        self.gates.update(dict.fromkeys(self.gates, "hold"))

    def reset(self, query: object) -> None:
        self.release()
        with query:
            query.reply(keys.ESTOP_RESET, encode(Done(v=VERSION)), encoding=encoding_of(Done))


@contextmanager
def confirming(port: int) -> Iterator[set[str]]:
    """Confirm each stop that arrives as a datagram; the set has the reasons of all."""
    over, datagrams, reasons = threading.Event(), StopDatagrams(f"127.0.0.1:{port}"), set[str]()

    def obey() -> None:
        while not over.wait(0.01):
            reasons.update(stop.reason for stop in datagrams.take())
            datagrams.confirm()

    thread = threading.Thread(target=obey)
    thread.start()
    try:
        yield reasons
    finally:
        over.set()
        thread.join()
        datagrams.close()


@pytest.fixture
def endpoint(free_port: int) -> str:
    return f"tcp/127.0.0.1:{free_port}"


@pytest.fixture
def robot(endpoint: str) -> Iterator[Robot]:
    robot = Robot(endpoint)
    yield robot
    robot.over.set()
    robot.thread.join()
    robot.session.close()


def test_every_part_stops_and_is_named(robot: Robot, endpoint: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["estop", "--endpoint", endpoint]) == 0
    assert robot.gates == {"torso": "estop", "head": "estop"}
    assert capsys.readouterr().out.startswith("stopped: head, torso;")


def test_a_release_by_another_client_is_not_undone(robot: Robot, endpoint: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(estop, "_REPEAT", 1.0)  # the release comes before the first repetition
    listen(robot.session, EStop.stream.key(), lambda heard: threading.Timer(0.3, robot.release).start())
    assert main(["estop", "--endpoint", endpoint]) == 0
    assert set(robot.gates.values()) == {"hold"}


def test_in_a_pause_the_robots_own_repetition_confirms_the_stop(robot: Robot, endpoint: str, capsys: pytest.CaptureFixture[str]) -> None:
    robot.repeats = True
    robot.is_paused.set()
    assert main(["estop", "--endpoint", endpoint]) == 0
    assert robot.gates == {"torso": "estop", "head": "estop"}
    assert capsys.readouterr().out.startswith("stopped: all parts, as robot_sim confirms")


def test_in_a_pause_the_answer_to_a_datagram_confirms_the_stop(
    robot: Robot, endpoint: str, free_port: int, capsys: pytest.CaptureFixture[str]
) -> None:
    robot.is_paused.set()
    with confirming(free_port):
        assert main(["estop", "--endpoint", endpoint]) == 0
    assert capsys.readouterr().out.startswith("stopped: all parts, as robot_sim confirms")


def test_in_a_pause_a_stop_that_is_not_confirmed_is_reported(robot: Robot, endpoint: str, capsys: pytest.CaptureFixture[str]) -> None:
    robot.is_paused.set()
    assert main(["estop", "--endpoint", endpoint]) == 1
    assert "no part of a robot publishes its state" in capsys.readouterr().err


@pytest.mark.parametrize("repeats", [False, True])
def test_a_part_that_does_not_stop_is_named(robot: Robot, endpoint: str, capsys: pytest.CaptureFixture[str], repeats: bool) -> None:
    robot.repeats = repeats
    robot.deaf.add("torso")
    assert main(["estop", "--endpoint", endpoint]) == 1
    assert "torso did not stop" in capsys.readouterr().err


def test_a_stop_is_recorded_although_no_router_answers(
    endpoint: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    monkeypatch.setattr(estop, "_CONNECT_PATIENCE", 0.1)
    record = StopRecord.of_endpoint(endpoint)
    assert main(["estop", "--endpoint", endpoint]) == 3
    assert "recorded" not in capsys.readouterr().err
    record.create()
    assert main(["estop", "--endpoint", endpoint, "--reason", "smoke"]) == 3
    assert "The stop is recorded: robot_sim obeys the record if it still runs" in capsys.readouterr().err
    stop = record.read()
    assert stop is not None and (stop.source, stop.reason) == ("mobee", "smoke")


def test_robot_sim_confirms_a_stop_although_no_router_answers(
    endpoint: str, free_port: int, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(estop, "_CONNECT_PATIENCE", 0.1)
    with confirming(free_port) as reasons:
        assert main(["estop", "--endpoint", endpoint, "--reason", "smoke"]) == 3
    assert reasons == {"smoke"}
    assert "robot_sim confirms the stop." in capsys.readouterr().err


def test_reset_releases(robot: Robot, endpoint: str) -> None:
    main(["estop", "--endpoint", endpoint])
    assert main(["estop", "--reset", "--endpoint", endpoint]) == 0
    assert set(robot.gates.values()) == {"hold"}


def test_status_shows_the_gates(robot: Robot, endpoint: str, capsys: pytest.CaptureFixture[str]) -> None:
    main(["status", "--endpoint", endpoint])
    assert "torso           armed    velocity" in capsys.readouterr().out
