from __future__ import annotations

from experiments import connectivity
from experiments.connectivity.findings import GRAPHS, findings
from tests.experiments.finished_cells import Cell, finished


def test_a_sparser_graph_is_learnt_sooner_and_its_ways_are_longer():
    cells = [Cell(f"k{graph}", 1, {"graph": graph, "budgets": [700], "tasks": 8}) for graph in (4, 16)]
    rows = findings(finished(connectivity.work, cells))["runs"]
    assert rows["4 neighbours"]["state_actions"] == 324 and rows["16 neighbours"]["state_actions"] == 1296
    assert rows["4 neighbours"]["learned_after"] < 700 and rows["16 neighbours"]["learned_after"] is None
    assert rows["4 neighbours"]["actions"] > rows["16 neighbours"]["actions"]


def test_the_graphs_are_those_of_the_claim():
    assert 16 in GRAPHS and GRAPHS[-1] == "equidistant"
