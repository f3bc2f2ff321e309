from __future__ import annotations

import numpy as np
import pytest

from experiments.kit.cells import Cell
from experiments.reach_vs_planners.findings import SCENES, WHO, claims, summary


class Done:
    def __init__(self, cell, values):
        self.cell, self.values = cell, values


def sweep(learner=0.9, peer=0.9, seconds=0.01, smoothing=0.1):
    done = {}
    for seed in range(6):
        values = {}
        for scene in SCENES:
            for who, share in zip(WHO, (learner, peer), strict=True):
                values[f"{scene}|{who}|success"] = np.arange(10) < 10 * share
                values[f"{scene}|{who}|seconds"] = np.full(10, 5.0)
                values[f"{scene}|{who}|thinking"] = np.full(10, 0.001)
        done[f"cases-s{seed}"] = Done(Cell(f"cases-s{seed}", seed, {"scene": "cases"}), values)
        arms = {"found": np.ones(4), "seconds": np.full(4, seconds), "smoothing": np.full(4, smoothing)}
        arms |= {"corners": np.full(4, 3), "missing": np.full(4, 0.01)}
        done[f"arms-s{seed}"] = Done(Cell(f"arms-s{seed}", seed, {"scene": "two arms"}), arms)
    return done


@pytest.mark.parametrize(("learner", "expected"), [(0.9, "confirmed"), (1.0, "confirmed"), (0.8, "refuted")])
def test_the_learner_may_not_fall_behind_the_peer(learner, expected):
    assert [claim.verdict for claim in claims(sweep(learner))[:3]] == [expected] * 3


@pytest.mark.parametrize(("seconds", "smoothing", "expected"), [(0.01, 0.1, "refuted"), (5.0, 60.0, "confirmed")])
def test_a_planner_is_slow_if_it_takes_a_tenth_of_the_published_time(seconds, smoothing, expected):
    assert [claim.verdict for claim in claims(sweep(seconds=seconds, smoothing=smoothing))[3:]] == [expected] * 2


def test_the_table_tells_planning_in_milliseconds():
    table = summary(sweep())
    assert len(table["cases"]) == len(SCENES) * len(WHO) and table["cases"][0]["planning [ms]"].startswith("1.0")
    assert table["both arms"]["seconds"].startswith("0.010")
