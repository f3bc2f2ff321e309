# SPDX-License-Identifier: Apache-2.0
"""The emergency stop under floods of messages, calls or connections: time until robot_sim obeys it, and until a client is connected.

Claim: under each flood of `experiments.kit.live.floods`, and with a thousand idle connections, the stop is obeyed within 50 ms in 99 of 100
cases, and no process ends.  The robot moves by the motor model at 100 Hz, with its three agents; each stop is sent by a new client.  On the
machine of robot_sim, `mobee estop` and the web page write the stop into a file, the record of stops: this time begins before it is written.
From other machines they send it past the router, as UDP datagrams: this time begins before the socket is opened.  A program that only
publishes its stop has the bus alone: this time begins when the client is connected; it is shown, but not judged.  The times end at the
time stamp, by robot_sim's clock, of the first state message of the head in which the gate (the last check before the motors) is in the
state `estop`; this is at most a tick after robot_sim has obeyed the stop.  Run time: about a minute for each flood.
"""

from __future__ import annotations

import logging
import os
import tempfile
import time
from collections.abc import Sequence
from contextlib import nullcontext, suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from bus_schema import keys
from bus_schema.messages import EStop, State
from bus_schema.rpc import Done, Empty
from experiments.kit.command_line import Progress
from experiments.kit.live.faults import VITAL
from experiments.kit.live.floods import FLOODS, flood
from experiments.kit.live.launch import LaunchFailed
from experiments.kit.live.system import System, running, stat_of, wait_for
from services.common import rpc
from services.common.bus import Bus
from services.common.emergency_stop import StopSender
from services.common.observe import Received, listen
from services.common.session import open_client

AT_MOST = 50.0  # ms, p99
QUIET = 3.0  # load of the machine up to which times are judged; system and flood together take about two processors
NOTHING = "nothing"
ALL_VITAL = (*VITAL, "launcher")
_SETTLE = 1.0  # s of the flood before the first stop
_REPEAT, _GIVE_UP = 0.1, 5.0  # s, as `mobee estop`
_ARMED = 3.0  # s after a release in which the robot should move again


@dataclass(frozen=True, slots=True)
class Settings:
    """Settings of the benchmark.

    `floods`: names of the floods of messages under which the robot is stopped; "nothing" for none.  `stops`: number of emergency stops
    under each flood that are written into a file (the record of stops); the same number is sent as datagrams, and as messages on the bus.
    """

    floods: Sequence[str] = (NOTHING, *FLOODS)
    stops: int = 20


QUICK = Settings(floods=(NOTHING, "estop, set = false", "calls of robot_sim's stat", "idle connections"), stops=5)


class _Gate:
    """The newest state of robot_sim's gate (the last check before the motors) for the head: `now`, such as "armed" or "estop".

    `since`: the time [s, monotonic] at which this state was first published; 0 before the first message.
    """

    def __init__(self, session: Any) -> None:
        self.now, self.since = "", 0.0
        listen(session, State.stream.key("head"), self._note)

    def _note(self, received: Received) -> None:
        state = received.content()
        if state["gate"] != self.now:
            self.now, self.since = state["gate"], 1e-9 * state["tw"]


def measure(settings: Settings) -> dict[str, Any]:
    """Stop the robot under each flood of messages and return the result; raises LaunchFailed if the system or a flood ends early.

    Main keys: "floods", list with a dict for each flood: medians and 99th percentiles (endings "_p50" and "_p99") of the times [ms] from a
    stop in the record of stops, a file ("stop_ms"), by datagrams ("datagram_stop_ms"), or on the bus ("bus_stop_ms") until the robot
    reports it, and of the time to connect a client ("connect_ms"); "late" and "late_by_bus", lists of the names of the floods with a 99th
    percentile above 50 ms by the record or by datagrams, and by the bus alone; "resting", floods after which the robot did not move again
    after every release; "passed", whether no process ended and, unless the machine was busy, both "late" and "resting" are empty.
    """
    rows = []
    with Progress() as progress, tempfile.TemporaryDirectory() as scratch, running(Path(scratch), "kinematic") as system:
        for done, name in enumerate(settings.floods):
            progress.show(done / len(settings.floods), name)
            rows.append(_under(system, name, settings.stops))
    load = float(np.median([row["load"] for row in rows]))
    late = [row["flood"] for row in rows if max(row["stop_ms_p99"], row["datagram_stop_ms_p99"]) > AT_MOST]
    resting = [row["flood"] for row in rows if row["armed_again"] < 3 * settings.stops]
    late_by_bus = [row["flood"] for row in rows if row["bus_stop_ms_p99"] > AT_MOST]
    return {
        "stops": settings.stops,
        "at_most_ms": AT_MOST,
        "floods": rows,
        "load": load,
        "times_judged": load <= QUIET,
        "late": late,
        "late_by_bus": late_by_bus,
        "resting": resting,
        "passed": not any(row["ended"] for row in rows) and not (load <= QUIET and (late or resting)),
    }


def _under(system: System, name: str, stops: int) -> dict[str, Any]:
    with open_client(system.endpoint) as observer:
        gate = _Gate(observer)
        before = _processes(observer)
        wait_for(lambda: gate.now == "armed", 30.0, "the robot is armed")
        with nullcontext() if name == NOTHING else flood(system.endpoint, name):
            time.sleep(_SETTLE)
            recorded, armed_first = zip(*(_stop_by_record(system, observer, gate) for _ in range(stops)), strict=True)
            sent, armed_second = zip(*(_stop_by_datagrams(system, observer, gate) for _ in range(stops)), strict=True)
            connected, stopped, armed_third = zip(*(_stop_by_bus(system, observer, gate) for _ in range(stops)), strict=True)
        after = _processes(observer)
    result: dict[str, Any] = {"flood": name}
    for what, times in (("stop_ms", recorded), ("datagram_stop_ms", sent), ("bus_stop_ms", stopped), ("connect_ms", connected)):
        result |= {f"{what}_p50": float(np.percentile(times, 50)), f"{what}_p99": float(np.percentile(times, 99))}
    ended = [who for who in ALL_VITAL if after[who] != before[who]]
    armed = sum(map(sum, (armed_first, armed_second, armed_third)))
    return result | {"armed_again": armed, "ended": ended, "load": os.getloadavg()[0]}


def _stop_by_record(system: System, observer: Any, gate: _Gate) -> tuple[float, bool]:
    """Stop the robot by the record of stops, a file on this machine, then release it.

    Returns the time [ms] from before the file is written until the state of the head says "estop", or _GIVE_UP if it never does; and
    whether the robot was armed (followed commands) again after the release.
    """
    begun = time.monotonic()
    system.stop_record.stop("bench", "a test of the stop")
    while gate.now != "estop" and time.monotonic() < begun + _GIVE_UP:
        time.sleep(0.001)
    took = 1e3 * (gate.since - begun) if gate.now == "estop" else 1e3 * _GIVE_UP
    return took, _armed_again(observer, gate)


def _stop_by_datagrams(system: System, observer: Any, gate: _Gate) -> tuple[float, bool]:
    """Stop the robot by UDP datagrams, which do not pass through the router, then release it.

    Returns the time [ms] from before the socket is opened until the state of the head says "estop", or _GIVE_UP if it never does; and
    whether the robot was armed (followed commands) again after the release.
    """
    begun = time.monotonic()
    with StopSender(system.endpoint, "bench", "a test of the stop") as sender:
        while gate.now != "estop" and time.monotonic() < begun + _GIVE_UP:
            sender.send()
            repeat = time.monotonic() + _REPEAT
            while gate.now != "estop" and time.monotonic() < repeat:
                time.sleep(0.001)
    took = 1e3 * (gate.since - begun) if gate.now == "estop" else 1e3 * _GIVE_UP
    return took, _armed_again(observer, gate)


def _stop_by_bus(system: System, observer: Any, gate: _Gate) -> tuple[float, float, bool]:
    """Stop the robot by messages of a new client on the bus, then release it.

    Returns the time [ms] to connect the client; the time [ms] from its first message until the state of the head says "estop", or _GIVE_UP
    if it never does; and whether the robot was armed (followed commands) again after the release.
    """
    begun = time.monotonic()
    with open_client(system.endpoint, patience=_GIVE_UP) as session:
        publisher = Bus(session, "bench", logging.getLogger("bench")).publisher(EStop)
        said = time.monotonic()
        while gate.now != "estop" and time.monotonic() < said + _GIVE_UP:
            publisher.put(set=True, source="bench", reason="a test of the stop")
            repeat = time.monotonic() + _REPEAT
            while gate.now != "estop" and time.monotonic() < repeat:
                time.sleep(0.001)
    took = 1e3 * (gate.since - said) if gate.now == "estop" else 1e3 * _GIVE_UP
    return 1e3 * (said - begun), took, _armed_again(observer, gate)


def _armed_again(observer: Any, gate: _Gate) -> bool:
    """Release the robot, and return whether it is armed (follows commands) again.

    Tries it twice, because a repeated stop message may arrive after the first release and stop the robot again.
    """
    for _ in range(2):
        _release(observer)
        with suppress(LaunchFailed):
            wait_for(lambda: gate.now == "armed", _ARMED, "the robot is armed again")
            return True
    return False


def _release(session: Any) -> None:
    """Release the robot; under a flood of calls an answer may be lost."""

    def released() -> bool:
        try:
            return bool(rpc.call(session, "bench", keys.ESTOP_RESET, Empty, Done, timeout=1.0).v)
        except rpc.CallFailed:
            return False

    wait_for(released, 30.0, "robot_sim releases the robot")


def _processes(session: Any) -> dict[str, int]:
    """Return the process id of the launcher and of each vital service (robot_sim, controller and model).

    Raises LaunchFailed if one does not answer.
    """
    return {who: wait_for(partial(stat_of, session, who), 60.0, f"{who} answers").pid for who in ALL_VITAL}


def report(result: dict[str, Any]) -> str:
    """Return the result of `measure` as text: a table with one line for each flood (many messages, calls or connections)."""
    lines = [
        f"From a stop to estop in ms, {result['stops']} stops of each kind under each flood",
        f"at most {result['at_most_ms']:g} (p99) by the record (own machine) and by UDP (other machines);",
        f"load of the machine {result['load']:.1f}",
        f"{'':<26}{'record':>13}{'UDP':>13}{'bus alone':>13}{'client':>8}",
        f"{'flood':<26}" + 3 * f"{'p50':>6}{'p99':>7}" + f"{'p99':>8}{'armed':>6}",
    ]
    for row in result["floods"]:
        stops = "".join(f"{row[f'{what}_p50']:>6.1f}{row[f'{what}_p99']:>7.1f}" for what in ("stop_ms", "datagram_stop_ms", "bus_stop_ms"))
        ended = f"  ENDED: {', '.join(row['ended'])}" if row["ended"] else ""
        lines.append(f"{row['flood']:<26}{stops}{row['connect_ms_p99']:>8.1f}{row['armed_again']:>6}{ended}")
    if result["late_by_bus"]:
        lines.append(f"late by the bus alone: {', '.join(result['late_by_bus'])}")
    if result["resting"]:
        lines.append(f"NOT ARMED AGAIN after each release: {', '.join(result['resting'])}")
    if not result["times_judged"]:
        lines.append(f"times are not judged: the load was above {QUIET:g}")
    elif result["late"]:
        lines.append(f"LATE: {', '.join(result['late'])}")
    return "\n".join(lines)
