# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest

from experiments.claims.ch7_learning.plant_sensitivity import CLAIMS, PUBLISHED, VARIANTS, Row, normalised
from experiments.claims.ch7_learning.unreachable_states import NEVER
from experiments.kit.experiment import judged
from experiments.kit.learning.arm import arm_plant, robot


def test_normalised_rows_allow_the_same_poses():
    poses = np.random.default_rng(0).uniform(*robot().limits.T, size=(20, len(robot().motors)))
    for ours, theirs in zip(normalised().clauses, robot().clauses, strict=True):
        assert np.linalg.norm(ours.a, axis=1) == pytest.approx(1.0)
        assert ((poses @ ours.a.T + ours.b > 0.0) == (poses @ theirs.a.T + theirs.b > 0.0)).all()


def row(**changed):
    numbers = {
        "never": len(NEVER),
        "hardly": 1.0,
        "others": 0.0,
        "deflected": 1.0,
        "where": "62",
        "failing": 1.0,
        "entering": 0.0,
        "uncertain": 9.0,
    }
    return Row(**{**numbers, "timeouts": 0.0, "seconds": 4.0, **changed})


@pytest.mark.parametrize(
    ("changed", "rank4", "rank3"),
    [
        ({}, True, True),
        ({"never": 3.0}, False, True),
        ({"hardly": 30.0}, False, True),
        ({"others": 1.0}, False, True),
        ({"deflected": 0.5}, False, True),
        ({"failing": 0.2}, True, False),
        ({"entering": 0.5}, True, False),
        ({"failing": float("nan")}, True, False),  # never tried
    ],
)
def test_a_finding_is_lost_where_one_of_its_numbers_is_not_as_published(changed, rank4, rank3):
    assert (row(**changed).rank4, row(**changed).rank3) == (rank4, rank3)


def test_every_run_must_reproduce_the_findings_and_intervals_decide_what_they_depend_on():
    each = {variant: [row(uncertain=9.0 + seed) for seed in range(5)] for variant in VARIANTS}
    for variant, runs in each.items():
        if variant.startswith("settle speed, deg/s (1): 0.2"):
            runs[:] = [row(failing=0.0)] * 5
        if variant.startswith("encoder noise, deg (0.1): 0.4"):
            runs[:] = [row(uncertain=40.0 + seed) for seed in range(5)]
        if variant.endswith("(0.1): 0"):
            runs[:] = [row(uncertain=1.0 + seed) for seed in range(5)]
    assert [claim["verdict"] for claim in judged(CLAIMS, each)] == ["met", "met", "confirmed", "confirmed"]
    each[PUBLISHED][0] = row(failing=0.2)
    lost, *_ = judged(CLAIMS, each)
    assert lost["verdict"] == "not met" and "both in 4 of 5 runs" in lost["ours"]


def test_the_first_variant_is_the_published_plant():
    ours, published = VARIANTS[PUBLISHED].plant(4), arm_plant(4)
    target = robot().limits[robot().part("left_arm").slice].mean(axis=1)
    assert np.array_equal(ours.act("left_arm", target).q, published.act("left_arm", target).q)
