# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import sys

import numpy as np
import pytest

from experiments.bench.nes import FUNCTIONS, Settings, measure
from experiments.bench.peers import CmaStrategy
from mobee.errors import NotInstalled


@pytest.mark.parametrize("name", FUNCTIONS)
def test_every_function_is_zero_at_its_optimum_alone(name: str) -> None:
    best = np.ones(5) if name == "Rosenbrock" else np.zeros(5)
    costs = FUNCTIONS[name](best + np.concatenate([np.zeros((1, 5)), 0.1 * np.eye(5)]))
    assert costs[0] == 0.0 and (costs[1:] > 0.0).all()


def test_rows_hold_what_both_needed_and_their_ratio() -> None:
    pytest.importorskip("cma")
    result = measure(Settings(dimensions=(4,), runs=1))
    assert [row["function"] for row in result["rows"]] == list(FUNCTIONS)
    assert all(row["ratio"] == row["nes"] / row["cma"] and np.isfinite(row["ratio"]) for row in result["rows"])
    assert result["requirements"][0]["found"] == np.median([row["ratio"] for row in result["rows"]])


def test_the_peer_gives_the_same_for_the_same_seed() -> None:
    pytest.importorskip("cma")
    one, two, other = (CmaStrategy(np.zeros(3), 0.5, seed).ask() for seed in (0, 0, 1))
    np.testing.assert_array_equal(one, two)
    assert not np.array_equal(one, other)


def test_without_cma_it_names_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "cma", None)
    with pytest.raises(NotInstalled, match=r"\[bench\]"):
        measure(Settings())
