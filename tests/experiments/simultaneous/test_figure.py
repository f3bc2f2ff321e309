from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

import mobee
from experiments.kit.cells import Cell
from experiments.kit.reaching.arm import reach_space
from experiments.simultaneous.figure import draw
from experiments.simultaneous.findings import findings
from experiments.simultaneous.trial import WAYS

LOOKS = [1000, 2000]


def cells():
    """Two runs of every way, whose models believe that a quarter of all transitions fail: none does."""
    space, model = reach_space(), mobee.TransitionModel(reach_space())
    pairs = np.argwhere(space.goals >= 0)
    seen = np.column_stack([pairs, space.goals[tuple(pairs.T)]])
    found = {"truth": SimpleNamespace(cell=Cell("truth", 9001, {"way": "walk"}), values={"seen": seen})}
    for way in WAYS:
        for seed in range(2):
            cell = Cell(f"{way}-s{seed}", seed, {"way": way, "looks": LOOKS})
            values = {"scores": np.full((2, 3), 5.0 + seed), "tries": np.array([300, 700]), "failed": np.array([20, 40])}
            if way == "first-3000":
                values["scores"][0] = np.nan
            values |= {"outcomes_1": model.outcomes, "probabilities_1": model.debiased(0.3, 0.1).probabilities}
            found[cell.name] = SimpleNamespace(cell=cell, values=values)
    return found


def test_runs_are_drawn_and_their_models_compared_with_what_was_walked(tmp_path):
    pytest.importorskip("matplotlib")
    found = cells()
    rows = {row["way"]: row for row in findings(found)["ways"]}
    assert rows["contact"]["L1 at 2000"] == "0.500 [0.500, 0.500]" and "L1 at 1000" not in rows["contact"]
    assert "score at 1000" in rows["contact"] and "score at 1000" not in rows["first-3000"]
    assert draw(found, tmp_path / "simultaneous.png").stat().st_size > 20_000


def test_nothing_is_drawn_of_a_run_that_was_stopped_before_its_first_cell(tmp_path):
    with pytest.raises(mobee.InvalidValue, match="no finished cells"):
        draw({}, tmp_path / "simultaneous.png")
