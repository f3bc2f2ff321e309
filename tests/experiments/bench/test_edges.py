# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import pytest

from experiments.bench.edges import Settings, measure, palm_map, verdict


@pytest.fixture(scope="module")
def result() -> dict:
    return measure(Settings(spacing=0.1, rounds=1))


def test_all_methods_of_checking_agree_and_the_fast_ones_evaluate_fewer_poses(result: dict) -> None:
    assert result["agree"]
    assert 0 < result["change_edges"] < result["edges"] and 0 < result["blocked"] <= result["change_edges"]
    assert result["once_poses"] < result["plain_poses"] and result["once_poses"] < result["both_poses"]


def test_times_are_judged_as_on_the_standard_machine() -> None:
    slow = {"standard_thesis_s": 1.4, "standard_once_us": 4.0, "thesis_s": 100.0, "once_s": 100.0}
    assert verdict(slow, agree=True)["passed"]
    assert not verdict(slow, agree=False)["passed"]
    assert not verdict(slow | {"standard_thesis_s": 5.0}, agree=True)["passed"]


def test_the_map_is_of_free_poses_above_the_table() -> None:
    trm = palm_map(0.12)
    pose = trm.model.evaluate(trm.q)
    assert (pose.count == 0).all()
    assert abs(pose.position("right_palm")[:, :2] - trm.y).max() < 0.002
    assert (pose.normal("right_palm")[:, 2] < -0.99).all()
