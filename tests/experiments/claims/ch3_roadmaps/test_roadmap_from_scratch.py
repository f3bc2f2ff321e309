# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from experiments.claims.ch3_roadmaps.roadmap_from_scratch import CLAIMS, SAMPLES, findings, plot, trial, unreached

pytest.importorskip("ompl")


@pytest.fixture(scope="module")
def values() -> dict:
    return trial({"most": 6}, 3)


def result(values: dict, seed: int = 0, **other: object) -> SimpleNamespace:
    return SimpleNamespace(cell=SimpleNamespace(seed=seed), values=values | other)


def test_a_short_exploration_tries_edges_harms_nothing_and_is_agreed_with(values: dict) -> None:
    assert values["why"] == "" and not values["finished"] and len(values["minutes"]) == 6
    assert 0 < (values["tried"] > 0).sum() <= 6 and values["deepest"] <= 2e-3
    assert len(values["agree"]) == (values["tried"] > 0).sum() and values["agree"].all()
    assert 0 < unreached(values) < SAMPLES


def test_only_finished_runs_count_and_a_live_run_decides_about_contacts(values: dict) -> None:
    open_ = findings({"a": result(values)}, None)["claims"]
    assert {claim["verdict"] for claim in open_} == {"open"} and len(open_) == len(CLAIMS)
    live = values | {"finished": True, "hours": 1.5, "touches": 3, "edges": 6, "pair": ""}
    long = {"finished": True, "minutes": np.array([50.0, 90.0])}
    found = findings({str(seed): result(values, seed, **long) for seed in range(5)}, live)
    assert [claim["verdict"] for claim in found["claims"]] == ["confirmed"] * 3 + ["open"]  # one live run is too few
    assert "90 minutes" in found["claims"][0]["ours"] and found["maps"]["live"]["minutes"] == 90.0
    deep = findings({"a": result(values, finished=True)}, live | {"deepest": 3e-3})
    assert [deep["claims"][which]["verdict"] for which in (0, 3)] == ["not reproduced", "not met"]


def test_the_map_is_drawn_before_and_after(values: dict) -> None:
    pytest.importorskip("matplotlib")
    assert plot({"a": result(values)}).axes[1].get_title() == "explored offline"
    live = values | {"hours": 0.1, "edges": int(np.sum(values["tried"] > 0))}
    assert plot({"a": result(values)}, live).axes[1].get_title() == "explored live"
