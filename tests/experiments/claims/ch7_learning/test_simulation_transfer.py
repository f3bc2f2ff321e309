# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest

from experiments.claims.ch7_learning.simulation_transfer import equal, prediction_bound
from experiments.kit.cells import Cell
from experiments.kit.experiment import judged
from experiments.kit.learning.live import Compared, Distance, learn_offline

pytestmark = pytest.mark.timeout(120)


def test_parts_learn_at_the_same_time_and_each_makes_its_number_of_transitions():
    cell = Cell("arms-s0", 0, {"task": "arms", "transitions": 4})
    first, again = learn_offline(cell), learn_offline(cell)
    assert set(first) == {"seen_left_arm", "seen_right_arm"}
    for part, rows in first.items():
        assert rows.shape == (4, 3) and np.array_equal(rows, again[part])
        assert np.array_equal(rows[1:, 0], rows[:-1, 2])


def test_one_more_value_is_below_the_bound_with_95_percent():
    rng = np.random.default_rng(0)
    draws = rng.normal(3.0, 0.5, size=(4000, 6))
    below = [row[-1] <= prediction_bound(list(row[:-1])) for row in draws]
    assert np.mean(below) == pytest.approx(0.95, abs=0.01)


def test_offline_seeds_that_differ_widely_leave_the_claim_open():
    wide = tuple(Distance(v, 1.0, 300) for v in (0.0, 0.05, 0.1))
    assert judged([equal], {"arms": Compared({"pybullet": Distance(0.06, 1.0, 300)}, wide, {})})[0]["verdict"] == "open"
    assert judged([equal], {"arms": Compared({"pybullet": Distance(0.9, 1.0, 300)}, wide, {})})[0]["verdict"] == "not met"


def test_without_compared_actions_the_claim_is_open():
    none = Distance(float("nan"), float("nan"), 0)
    assert judged([equal], {"arms": Compared({"pybullet": none}, (none, none), {})})[0]["verdict"] == "open"


@pytest.mark.parametrize(("variation", "agree", "verdict"), [(0.009, 0.995, "open"), (0.05, 0.995, "not met"), (0.0, 0.9, "not met")])
def test_one_live_robot_can_show_a_difference_but_not_that_there_is_none(variation, agree, verdict):
    offline = tuple(Distance(v, 1.0, 300) for v in (0.0, 0.001, 0.002))
    found = Compared({"pybullet": Distance(variation, agree, 300)}, offline, {})
    assert judged([equal], {"arms": found})[0]["verdict"] == verdict
