# SPDX-License-Identifier: Apache-2.0
"""The plant's benchmark on given numbers, and the determinism of its workloads."""

from __future__ import annotations

from typing import Any

import pytest

from experiments.bench.plant import REQUIREMENTS, Batch, Pace, batch_text, measure_batch, report, robot, trajectory_hash, verdict


def result(speed: float, slower: float = 1.0) -> dict[str, Any]:
    """Of a machine of that speed on which everything takes so many times longer than on the standard machine."""
    paces = {
        "one_arm": Pace(1.0, 12_000.0, 600_000, 1850),
        "reaching": Pace(1.0, 8000.0, 400_000, 780),
        "three_agents": Pace(1.0, 3900.0, 195_000, 1700),
    }
    measured = {name: Pace(slower * one.seconds, one.plant_seconds, one.ticks, one.ended) for name, one in paces.items()}
    about: dict[str, Any] = {"tick": 0.02, "core": 1, "rounds": 3, "speed": speed, "mujoco_us_per_tick": 100.0, "times_mujoco": 60.0}
    each = {"us_per_tick": 0.4, "ticks_per_second": 2.5e6}
    about |= {"batch": {"plants": 64, "alone": each, "together": each, "ratio": 1.6, "two_threads": None}}
    return about | {name: one.numbers | one.standard(speed) for name, one in measured.items()}


@pytest.mark.parametrize("slower", [1.0, 3.0])
def test_the_verdict_is_the_same_on_a_slower_machine(slower: float) -> None:
    found = result(1.0 / slower, slower)
    judged = verdict(found, same_hash=True)
    assert judged["passed"]
    assert [one["found"] for one in judged["requirements"]] == pytest.approx([12_000.0, 1850.0, 8000.0, 1700.0, 1.6])
    assert found["one_arm"]["times_real_time"] == pytest.approx(12_000.0 / slower)


def test_a_slow_plant_a_slow_batch_and_another_hash_fall_short() -> None:
    slow = verdict(result(1.0, slower=3.0), same_hash=True)["requirements"]
    assert [one["passed"] for one in slow] == [False] * (len(REQUIREMENTS) - 1) + [True]
    assert not verdict(result(1.0), same_hash=False)["passed"]
    found = result(1.0)
    found["batch"]["ratio"] = 0.93
    assert not verdict(found, same_hash=True)["passed"]


def test_the_report_fits_80_columns() -> None:
    found = result(0.5, slower=2.0)
    lines = report(found | verdict(found, same_hash=True)).splitlines()
    assert max(map(len, lines)) <= 80


def test_a_batch_and_one_alone_do_the_same_and_are_timed() -> None:
    body = robot()
    one_by_one, at_once = Batch(body, 3), Batch(body, 3)
    spent = one_by_one.alone(2), at_once.together(2, threads=2)
    assert spent[0].ticks == spent[1].ticks > 0
    assert [plant.time for plant in one_by_one.plants] == [plant.time for plant in at_once.plants]
    found = measure_batch(1, 1)
    assert found["ratio"] == pytest.approx(found["together"]["ticks_per_second"] / found["alone"]["ticks_per_second"])
    assert max(map(len, batch_text(found).splitlines())) <= 80


def test_the_same_seed_has_the_same_hash() -> None:
    assert trajectory_hash(3) == trajectory_hash(3)
