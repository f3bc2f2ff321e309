# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest

from experiments.claims.ch8_reaching.prm_vs_mdp import BLOCK_SIZE, CLAIMS, EXPERIMENT, row_of, rows_of
from experiments.kit.cells import Cell, load_cells, write_cell
from experiments.kit.experiment import judged
from mobee.errors import InvalidValue

HARD = np.tile([True, False], BLOCK_SIZE)


def rival(name, share, seconds):
    success = np.arange(2 * BLOCK_SIZE) < share * 2 * BLOCK_SIZE
    numbers = {
        "success": success,
        "seconds": np.full(2 * BLOCK_SIZE, seconds),
        "actions": np.full(2 * BLOCK_SIZE, 3),
        "repairs": np.zeros(2 * BLOCK_SIZE),
    }
    return {f"{name}|{measure}": values for measure, values in numbers.items()} | {f"{name}|cost": np.array(7.0)}


@pytest.fixture
def folder(tmp_path):
    """Three seeds: planned once succeeds in a half, repaired in all but 2 %, the MDP always."""
    for seed in range(3):
        both = rival("OMPL, planned once", 0.5, 60.0) | rival("OMPL, remembers", 1.0, 20.0)
        write_cell(tmp_path, Cell(f"roadmaps-both-s{seed}", seed, {"belief": "both"}), {"hard": HARD, **both}, 1.0)
        write_cell(
            tmp_path, Cell(f"mdp-s{seed}", seed, {"learned": 4000}), {"hard": HARD, **rival("MDP, 4000 learned", 1.0, 18.0 + seed)}, 1.0
        )
    return tmp_path


def test_a_row_summarises_all_seeds_of_a_rival_under_a_belief(folder):
    rows = rows_of(load_cells(folder))
    once = row_of(rows, "OMPL, planned once", "both")
    assert [once.numbers[name].mean() for name in ("success", "hard", "seconds")] == [0.5, 0.5, 60.0] and once.cost == 7.0
    learned = row_of(rows, "MDP, 4000 learned", "")
    assert learned.numbers["seconds"].tolist() == [18.0, 19.0, 20.0] and len(learned.blocks) == 2
    with pytest.raises(InvalidValue, match="resume"):
        row_of(rows, "straight", "")


def test_a_rival_that_fails_confirms_and_one_that_works_refutes(folder):
    first, second = judged(CLAIMS, rows_of(load_cells(folder)))
    assert (first["verdict"], second["verdict"]) == ("confirmed", "refuted")
    assert "0.50" in first["ours"] and "7.0 h" in second["ours"]


@pytest.mark.parametrize(("once", "mdp", "verdict"), [(0.9, 1.0, "confirmed"), (0.96, 1.0, "refuted"), (0.9, 0.8, "open")])
def test_a_roadmap_must_be_below_95_percent_and_below_the_mdp(tmp_path, once, mdp, verdict):
    for seed in range(2):
        all_hard = np.ones(2 * BLOCK_SIZE, dtype=bool)
        both = rival("OMPL, planned once", once, 60.0) | rival("OMPL, remembers", once, 20.0)
        write_cell(tmp_path, Cell(f"roadmaps-both-s{seed}", seed, {"belief": "both"}), {"hard": all_hard, **both}, 1.0)
        learned = {"hard": all_hard, **rival("MDP, 4000 learned", mdp, 18.0)}
        write_cell(tmp_path, Cell(f"mdp-s{seed}", seed, {"learned": 4000}), learned, 1.0)
    claims = judged(CLAIMS, rows_of(load_cells(tmp_path)))
    assert [claim["verdict"] for claim in claims] == [verdict, verdict]


def test_the_figure_of_an_unfinished_run_is_drawn(folder):
    pytest.importorskip("matplotlib")
    assert EXPERIMENT.method.figure(folder).stat().st_size > 10_000
