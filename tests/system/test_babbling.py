# SPDX-License-Identifier: Apache-2.0
"""Thesis 4.1.1 in short: a quarter of a minute of random position moves without MoBeE, with the first and with the second one."""

from __future__ import annotations

import json
import subprocess
import sys
from typing import Any

import pytest

from experiments.kit.live.launch import stop
from tests.services.harness import ROOT

pytestmark = [pytest.mark.system, pytest.mark.untimed]

MINUTES = 0.25  # of the robot, in each mode


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    pytest.importorskip("pybullet")
    folder = tmp_path_factory.mktemp("babbling")
    argv = ["-m", "mobee_cli", "experiment", "run", "babbling", "--minutes", str(MINUTES), "--seed", "1", "--json", "--runs", str(folder)]
    pipe = subprocess.PIPE
    run = subprocess.Popen([sys.executable, *argv], cwd=ROOT, stdout=pipe, stderr=pipe, text=True, process_group=0)
    try:
        printed, said = run.communicate(timeout=240)
    finally:
        stop(run)
    assert printed, said
    found = json.loads(printed)
    print({mode: {key: row[key] for key in KEYS} for mode, row in found["modes"].items()})
    return found


KEYS = ("collisions", "deepest_mm", "worst_beyond_limit_deg", "commands", "completed", "returned", "jerk_over_speed", "times_real_time")


def test_babbling_breaks_nothing_under_mobee_and_hits_things_without(results: dict[str, Any]) -> None:
    off, two = results["modes"]["off"], results["modes"]["two"]
    assert off["collisions"] >= 1
    assert two["deepest_mm"] <= 2.0
    assert two["worst_beyond_limit_deg"] <= 0.5


def test_the_second_mobee_completes_more_than_the_first_and_moves_more_smoothly(results: dict[str, Any]) -> None:
    one, two = results["modes"]["one"], results["modes"]["two"]
    assert one["returned"] > 0
    assert two["completed"] / two["commands"] > one["completed"] / one["commands"]
    assert two["jerk_over_speed"] < one["jerk_over_speed"]


def test_every_mode_ran_its_time(results: dict[str, Any]) -> None:
    for mode, row in results["modes"].items():
        assert row["minutes"] == MINUTES, mode
        assert row["trials"] == 1, mode
