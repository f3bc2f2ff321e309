# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import json
from pathlib import Path

from bus_schema import VERSION
from bus_schema.rpc import Stat
from services.launcher.child import Child, Program
from services.launcher.summary import as_text, summarise


def child(
    who: str, numbers: dict[str, float], rejected: dict[str, int] | None = None, restarts: int = 0, words: dict[str, str] | None = None
) -> Child:
    header = {"v": VERSION, "who": who, "instance": "i1", "pid": 1, "uptime": 1.0, "ready": True, "text": ""}
    stat = Stat(**header, numbers=numbers, rejected=rejected or {}, words=words or {})
    return Child(Program(who, (), Path("log")), stat=stat, restarts=restarts)


ROBOT = {
    "ticks": 12000.0,
    "missed_ticks": 3.0,
    "age_p50": 1.0,
    "age_p99": 2.0,
    "age_max": 4.0,
    "hold_ticks": 7.0,
    "solid_depth_max": 0.0042,
    "solid_ticks": 9.0,
    "pairs_watched": 211.0,
    "gap_min": None,
}
RUN = {"scenario": "default", "run": "runs/x", "duration_s": 120.0, "seconds_to_ready": 3.2, "faults": []}


def test_figures_of_a_run_come_from_the_services_that_measure_them() -> None:
    summary = summarise(
        [
            child("robot_sim", ROBOT, {"run": 2, "age": 1}, restarts=1),
            child("model", {"table_ticks": 42.0, "field_ticks": 50.0}),
            child("agent_left_arm", {"transitions": 14.0, "timeouts": 1.0, "interrupted": 0.0, "action_time_mean": 5.1}),
        ]
    )
    assert summary["agents"] == {"left_arm": {"transitions": 14, "timeouts": 1, "mean_action_time_s": 5.1, "interrupted": 0}}
    assert summary["table_contact_ticks"] == 42
    assert summary["deepest_solid_contact_m"] == 0.0042
    assert summary["pairs_watched"] == 211
    assert summary["rejected_commands"] == {"age": 1, "run": 2}
    assert summary["command_age_ticks"] == {"p50": 1.0, "p99": 2.0, "max": 4.0}
    assert (summary["hold_ticks"], summary["missed_ticks"], summary["ticks"]) == (7, 3, 12000)
    assert summary["restarts"] == {"robot_sim": 1, "model": 0, "agent_left_arm": 0}


def test_a_number_that_was_not_measured_is_null() -> None:
    summary = summarise([child("robot_sim", ROBOT)])
    assert summary["closest_gap_m"] is None
    assert summary["table_contact_ticks"] is None
    assert "null" in json.dumps(summary)


def test_the_text_says_the_same_to_a_person() -> None:
    summary = RUN | summarise(
        [child("robot_sim", ROBOT, {"age": 1}), child("agent_torso", {"transitions": 14.0, "action_time_mean": 5.123})]
    )
    text = as_text(summary)
    assert "default: ready after 3.2 s, then ran for 120.0 s" in text
    assert "torso           14 transitions, - timeouts, mean action 5.12 s" in text
    assert "deepest 4.2 mm of 211 watched pairs" in text
    assert "p50 1, p99 2, worst 4 ticks" in text
    assert "rejected        age 1" in text


def test_the_text_of_a_run_that_never_was_names_the_fault() -> None:
    text = as_text(RUN | summarise([]) | {"seconds_to_ready": None, "faults": ["model was killed"]})
    assert "never ready" in text
    assert "FAULT           model was killed" in text
