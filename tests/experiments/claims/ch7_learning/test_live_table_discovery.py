# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import argparse

import numpy as np
import pytest

from experiments.claims.ch7_learning import live_table_discovery
from experiments.kit.cells import write_cell
from experiments.kit.learning.live import TASKS, space
from mobee import load_robot
from mobee.store import STORE, Transition, TransitionStore

ROBOT = load_robot("icub")


def seen(part, rng, odd):
    """Every first action of 27 states four times; it fails once in a while, and `odd` always."""
    goals = space(ROBOT, TASKS["published"], part).goals
    return [(s, 0, s if odd or rng.random() < 0.2 else int(goals[s, 0])) for s in range(27) for _ in range(4)]


def prepared(folder, odd):
    arguments = argparse.Namespace(seed=0, seeds=19, jobs=1, engine="processes", quick=False, transitions=108)
    for cell in live_table_discovery.cells(arguments):
        rng = np.random.default_rng(cell.seed)
        write_cell(folder, cell, {f"seen_{part}": np.array(seen(part, rng, False)) for part in TASKS["published"].parts}, 1.0)
    store, rng = folder / "published" / "kinematic", np.random.default_rng(77)
    store.mkdir(parents=True)
    for part in TASKS["published"].parts:
        with TransitionStore(store / STORE, part) as file:
            for n, (s, a, to) in enumerate(seen(part, rng, odd), 1):
                file.append(Transition(n, s, a, to, 0.0, True, 4.0, (0.0,)))
    return arguments


@pytest.mark.parametrize(("odd", "verdict"), [(False, "open"), (True, "not met")])
def test_one_live_run_can_show_a_difference_but_not_that_there_is_none(tmp_path, odd, verdict):
    results = live_table_discovery.run(prepared(tmp_path, odd), tmp_path)
    assert results["claims"][0]["verdict"] == verdict
    assert results["state-actions compared"] == 3 * 27
    assert live_table_discovery.figure(tmp_path).exists()
