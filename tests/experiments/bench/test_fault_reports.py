# SPDX-License-Identifier: Apache-2.0
"""Reports and verdicts of the benchmarks of stops, faults and long runs on given results; nothing is launched here."""

from __future__ import annotations

from collections import Counter
from typing import Any

import pytest

from bus_schema.rpc import Stat
from experiments.bench import faults, soak, stop
from experiments.kit.live.faults import Fault
from experiments.kit.live.system import Kept, Stop

FINE = Kept(97, 0, 0, 0)


def result(load: float, hold: float = 0.02, broken: tuple[str, ...] = (), kept: Kept = FINE) -> dict[str, Any]:
    stops = [("kill", Stop(hold, 0.1, 0.01))] * 10
    row = {
        "seed": 7,
        "schedule": ["1.00 s kill model"],
        "load": load,
        "back_s": 1.2,
        "oldest_ms": 30.0,
        "broken": list(broken),
        "stops": stops,
    }
    row["actions"] = [("agent", True), ("model", False)]
    return faults._result(faults.Settings(schedules=1, seed=7), [row], kept, 12.0)


@pytest.mark.parametrize(
    ("given", "passed"),
    [
        ({"load": 0.5}, True),
        ({"load": 0.5, "hold": 0.2}, False),
        ({"load": 20.0, "hold": 0.2}, True),  # times say nothing of the system
        ({"load": 20.0, "broken": ("torso: tick 2 after tick 3",)}, False),
        ({"load": 20.0, "kept": Kept(97, 1, 0, 0)}, False),
        ({"load": 20.0, "kept": Kept(97, 0, 0, 1)}, False),
    ],
)
def test_a_broken_promise_counts_always_and_a_time_on_a_quiet_machine(given: dict[str, Any], passed: bool) -> None:
    found = result(**given)
    assert found["passed"] is passed
    assert found["actions_survived"] == {"agent": {"survived": 1, "of": 1}, "model": {"survived": 0, "of": 1}}
    report = faults.report(found)
    assert max(map(len, report.splitlines())) <= 80
    assert "times are not judged" in report if given["load"] > faults.QUIET else "times" not in report


def test_the_effect_of_a_fault_is_measured_only_if_no_other_is_near() -> None:
    schedule = [Fault(0.0, "freeze", "model", 1.0), Fault(1.5, "kill", "model"), Fault(4.0, "kill", "model"), Fault(4.5, "kill", "model")]
    assert [fault.at for fault, _, _ in faults._alone(schedule, [10.0, 11.5, 14.0, 14.5])] == [0.0]
    schedule[3] = Fault(6.0, "kill", "model")
    assert [fault.at for fault, _, _ in faults._alone(schedule, [10.0, 11.5, 14.0, 16.0])] == [0.0, 4.0, 6.0]


def test_the_report_of_stops_fits_80_columns_and_names_ended_processes() -> None:
    row = {"flood": "calls of robot_sim's stat", "stop_ms_p50": 12.0, "stop_ms_p99": 168.2, "connect_ms_p50": 4.0, "connect_ms_p99": 60.0}
    row |= {"datagram_stop_ms_p50": 12.0, "datagram_stop_ms_p99": 1242.1, "bus_stop_ms_p50": 12.0, "bus_stop_ms_p99": 4146.2}
    row |= {"armed_again": 12, "ended": ["model"], "load": 2.0}
    given = {"stops": 12, "at_most_ms": 50.0, "floods": [row], "load": 2.0, "times_judged": True, "late": ["tokens"], "passed": False}
    report = stop.report(given | {"late_by_bus": ["idle connections"], "resting": ["tokens"]})
    assert "ENDED: model" in report and "LATE: tokens" in report and "late by the bus alone: idle connections" in report
    assert "NOT ARMED AGAIN after each release: tokens" in report and " 1242.1" in report
    assert max(len(line.partition("  ENDED")[0]) for line in report.splitlines()) <= 80


@pytest.mark.parametrize(
    ("rate", "grow", "aged", "passed"), [(1.0, 0.0, 0, True), (1.3, 0.0, 0, False), (1.0, 0.1, 0, False), (1.0, 0.0, 1, False)]
)
def test_a_long_run_is_judged_by_growth_pace_and_ages(rate: float, grow: float, aged: int, passed: bool) -> None:
    samples, now = list[Any](), 0.0
    for n in range(101):
        late = n > 90
        now += 0.1 * (rate if late else 1.0)
        health: dict[str, Any] = {"memory_mb": 100.0 + grow * n, "files": 20, "threads": 4}
        stat = Stat(v=1, who="model", instance="i1", pid=7, uptime=1.0, ready=True, text="", numbers={}, rejected={}, health=health)
        samples.append(soak._Sample(now, 36.0 * n, {"model": stat}, Counter({1: 100, 2 + aged * late: 10})))
    found = soak._judged(samples, ["model"])
    assert found["passed"] is passed
    assert found["slower"] == pytest.approx(rate)
    assert found["apart"] == pytest.approx(aged * 10 / 110)
    assert max(map(len, soak.report(found).splitlines())) <= 80
