from __future__ import annotations

import numpy as np

import mobee
from experiments.kit.cells import Cell
from experiments.learning.explored import explored
from tests.experiments.finished_cells import finished

SPACE = mobee.Lattice(mobee.load_robot("icub"), ["l_elbow", "l_shoulder_yaw"], neighbours="equidistant")  # 0 has the goals 1 and 3
SEEN = np.array([[0, 0, 1], [0, 0, 4], [0, 1, 3]])


def test_runs_are_grouped_by_two_settings_in_the_order_of_their_seeds():
    cells = [Cell(f"{how}-s{seed}", seed, {"where": "here", "how": how}) for how in ("one", "other") for seed in (3, 1)]
    groups = explored(finished(lambda cell: {"seen": SEEN[: cell.seed], "more": cell.seed}, cells), lambda where: SPACE, "where", "how")
    assert list(groups) == [("here", "one"), ("here", "other")]
    assert [(run.seed, run.values["more"]) for run in groups["here", "one"]] == [(1, 1), (3, 3)]


def test_tries_and_failures_are_of_the_state_actions_there_are():
    cell = Cell("one", 0, {"where": "here", "how": "one"})
    (run,) = explored(finished(lambda cell: {"seen": SEEN}, [cell]), lambda where: SPACE, "where", "how")["here", "one"]
    assert len(run.tries) == len(run.failures) == SPACE.state_actions
    assert (run.tries[:2].tolist(), run.failures[:2].tolist(), run.tries.sum()) == ([2, 1], [1, 0], 3)
    assert run.visits.tolist() == [0, 1, 0, 1, 1, 0, 0, 0, 0]
