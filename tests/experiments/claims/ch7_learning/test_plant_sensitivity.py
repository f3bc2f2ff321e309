from __future__ import annotations

import numpy as np
import pytest

from experiments.claims.ch7_learning.plant_sensitivity import PUBLISHED, VARIANTS, Row, normalised
from experiments.claims.ch7_learning.unreachable_states import NEVER
from experiments.kit.learning.arm import arm_plant, robot


def test_the_first_variant_is_the_published_plant():
    ours, published = VARIANTS[PUBLISHED].plant(4), arm_plant(4)
    target = robot().limits[robot().part("left_arm").slice].mean(axis=1)
    assert np.array_equal(ours.act("left_arm", target).q, published.act("left_arm", target).q)


@pytest.mark.parametrize("name", VARIANTS)
def test_every_variant_makes_a_plant(name):
    assert VARIANTS[name].plant(0).dt == VARIANTS[name].dt


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
        "aside": 1.0,
        "where": "62",
        "failing": 1.0,
        "entering": 0.0,
        "uncertain": 9.0,
    }
    return Row(**{**numbers, "timeouts": 0.0, "seconds": 4.0, **changed})


def test_a_finding_is_lost_where_one_of_its_numbers_is_not_as_published():
    assert row().rank4
    assert row().rank3
    assert not row(never=3.0).rank4
    assert not row(hardly=30.0).rank4
    assert not row(others=1.0).rank4
    assert not row(aside=0.5).rank4
    assert not row(failing=0.2).rank3
    assert not row(entering=0.5).rank3


def test_what_was_never_tried_is_not_carried_and_not_a_number_of_the_results():
    untried = row(failing=float("nan"))
    assert not untried.rank3 and untried.rank4
    assert untried.record()["failing"] is None and untried.record()["rank3"] == "lost"
