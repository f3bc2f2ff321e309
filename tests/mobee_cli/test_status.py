# SPDX-License-Identifier: Apache-2.0
"""The table of `mobee status`."""

from __future__ import annotations

import pytest

from bus_schema import VERSION
from bus_schema.rpc import Stat
from mobee_cli.status import _as_text, _services

HEALTH = {"rate": 99.8, "age_ms": 4.2, "gap_ms": 1131.0, "refused_rate": 0.0, "memory_mb": 61.4, "files": 31, "threads": 4, "waiting": 0}


def service(**changes: object) -> dict[str, object]:
    plain: dict[str, object] = {
        "state": "ready",
        "pid": 4242,
        "uptime_s": 12.3,
        "restarts": 0,
        "rejected": {},
        "text": "100 ticks",
        "host": None,
    }
    return plain | {"health": HEALTH, "warnings": []} | changes


def test_each_process_has_a_row_of_health_in_80_columns_with_bad_numbers_marked(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    services = {
        "robot_sim": service(),
        "controller": service(warnings=["gap"]),
        "model": service(health={**HEALTH, "waiting": 12345}, warnings=["waiting"]),
        "vision": service(state="down", health={}),
    }
    text = _as_text({"services": services, "parts": {}, "agents": {}})
    rows = {line.split()[0]: line.split()[1:] for line in text.split("process ")[1].splitlines()[1:]}
    assert rows == {
        "robot_sim": ["100", "4", "1131", "0", "61", "31", "0"],
        "controller": ["100", "4", "!1131", "0", "61", "31", "0"],
        "model": ["100", "4", "1131", "0", "61", "31", "!12345"],
    }
    assert max(map(len, text.splitlines())) <= 80


def test_a_text_that_80_columns_cut_is_whole_below_the_table(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    reason = "emergency stop by mobee since 2026-11-28 12:02:26: the cup has fallen"
    text = _as_text({"services": {"robot_sim": service(text=reason), "model": service()}, "parts": {}, "agents": {}})
    assert f"robot_sim: {reason}" in text.splitlines()
    assert "model: " not in text


def test_the_text_of_a_service_moves_no_cursor() -> None:
    text = _as_text({"services": {"robot_sim": service(text="stop by a\nb\x1b[2J")}, "parts": {}, "agents": {}})
    assert "stop by a b\\x1b[2J" in text and "\x1b" not in text


def test_a_service_has_the_numbers_that_it_answers_and_one_that_is_silent_has_none() -> None:
    numbers = {"look_ms_p50": 11.5, "latency_ms_p95": 62.0}
    stat = Stat(v=VERSION, who="vision", instance="i1", pid=1, uptime=2.0, ready=True, rejected={}, text="", numbers=numbers)
    found = _services({"vision": ["i1"], "model": ["i2"]}, {"vision": stat})
    assert found["vision"]["numbers"] == numbers and found["model"]["numbers"] == {}
