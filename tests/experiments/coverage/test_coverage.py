from __future__ import annotations

import argparse

from experiments import coverage
from experiments.coverage.postman import postman_floor
from experiments.kit.cells import Cell


def arguments(*given: str) -> argparse.Namespace:
    parser = argparse.ArgumentParser()
    coverage.add_arguments(parser)
    parser.add_argument("--seed", type=int, default=0)
    return parser.parse_args(given)


def test_quick_leaves_the_long_graph_out():
    everything, quick = coverage.cells(arguments("--seeds", "3")), coverage.cells(arguments("--seeds", "3", "--quick"))
    assert {cell.settings["graph"] for cell in quick} == {"equidistant"}
    assert len(everything) == 2 * len(quick)


def test_a_curious_agent_on_the_real_lattice_tries_everything_near_the_floor():
    found = coverage.work(Cell("equidistant-free-curious-s0", 0, {"graph": "equidistant", "world": "free", "explorer": "curious"}))
    assert len(found["new_actions"]) == found["state_actions"] == 432 == found["floor"]
    assert found["new_actions"][-1] == found["transitions"] <= 1.2 * 432
    assert found["failed"] == 0.0 and len(found["new_states"]) == 81
    assert postman_floor(coverage.arm_space().goals) == 432
