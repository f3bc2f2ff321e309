# SPDX-License-Identifier: Apache-2.0
"""The plant's benchmark on given numbers, and the determinism of its workloads."""

from __future__ import annotations

import pytest

from experiments.bench.plant import REQUIREMENTS, Batch, Pace, batch_text, measure_batch, robot, trajectory_hash
from experiments.bench.verdicts import verdict


@pytest.mark.parametrize("slower", [1.0, 3.0])
def test_the_verdict_is_the_same_on_a_slower_machine(slower: float) -> None:
    ended = {"one_arm": (12_000.0, 1850), "reaching": (8000.0, 780), "three_agents": (3900.0, 1700)}
    paces = {name: Pace(slower, seconds, 600_000, count) for name, (seconds, count) in ended.items()}
    result = {name: one.numbers | one.standard(1.0 / slower) for name, one in paces.items()} | {"batch": {"ratio": 1.6}}
    judged = verdict(result, REQUIREMENTS, same_hash=True)
    assert judged["passed"] and result["one_arm"]["times_real_time"] == pytest.approx(12_000.0 / slower)
    assert [one["found"] for one in judged["requirements"]] == pytest.approx([12_000.0, 1850.0, 8000.0, 1700.0, 1.6])


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
