from __future__ import annotations

from experiments.claims.ch7_learning.uniformity import EXPERIMENT, EXPLORERS, GRAPHS, findings, trial
from tests.experiments.finished_cells import Cell, finished


def test_a_short_exploration_by_everybody_gives_all_claims_a_number():
    cells = [
        Cell(f"{graph}-{explorer}", 0, {"graph": graph, "explorer": explorer, "transitions": 60})
        for graph in GRAPHS
        for explorer in EXPLORERS
    ]
    results = findings(finished(lambda cell: trial(cell.settings, cell.seed), cells))
    assert [claim["text"] for claim in results["claims"]] == [claim.text for claim in EXPERIMENT.claims]
    assert all(claim["ours"] for claim in results["claims"])
    assert results["runs"]["nearest, curious"]["most"] <= results["runs"]["nearest, random"]["most"]
