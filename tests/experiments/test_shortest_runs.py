# SPDX-License-Identifier: Apache-2.0
"""The shortest run of each experiment that ends in seconds, in this process: its claims, record, figure and resume."""

from __future__ import annotations

import importlib
import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from experiments.claims_table import entries_of, page, rows, runs_in
from experiments.kit.cells import load_cells
from experiments.kit.experiment import Experiment
from experiments.kit.run_folder import RESULTS, new_run, write
from experiments.kit.sweep import Sweep
from experiments.registry import EXPERIMENTS, load_experiment
from tests.experiments.options import options_of

QUICK = ("--quick", "--seeds", "1", "--jobs", "1")
SHORTEST = {
    "constraint-discovery": QUICK,
    "constraint-violations": ("--gains", "default", "--tries", "2", "--forced-tries", "2"),
    "exploration-uniformity": QUICK,
    "forced-contact": ("--gains", "default", "--walls", "chest", "--targets", "in-reach"),
    "hypercube-exploration": QUICK,
    "information-gain": QUICK,
    "mdp-planner": QUICK,
    "model-throughput": ("--edits", "5", "--objects", "3"),
    "neighbour-count": QUICK,
    "reward-decay": QUICK,
    "push-disturbance": ("--laws", "default", "--directions", "down-to-table"),
    "shallow-contact-recovery": ("--angles", "60", "--spots", "1", "--repeat", "1"),
    "shared-workspace": ("--minutes", "0.03", "--seeds", "1"),
    "step-response": ("--gains", "default", "--periods", "20", "--postures", "1", "--motors", "l_elbow"),
}
SMALLER = {  # constants of the modules, where no option makes the run shorter
    "forced-contact": {"LEVELS": (0.0, 3.0), "LEVEL_SECONDS": 2.0, "DRAWN_SECONDS": 4.0},
    "push-disturbance": {"FORCES": (2.0, 50.0)},
}
PASS = ("constraint-violations", "push-disturbance", "step-response")  # the least run decides the claim already
ROWS = {  # of the default gains, in experiments whose results are one row for each case
    "forced-contact": {"chest", "drawn: in-reach"},
    "push-disturbance": {"down-to-table"},
    "step-response": {"20 ms, motors", "20 ms, postures"},
}


@dataclass(frozen=True)
class Run:
    name: str
    experiment: Experiment
    folder: Path
    results: dict[str, Any]

    def again(self) -> dict[str, Any]:
        return self.experiment.method.run(options_of(self.experiment, *SHORTEST[self.name]), self.folder)


@pytest.fixture(scope="session", params=SHORTEST)
def run(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Run]:
    name = request.param
    experiment = load_experiment(name)
    with pytest.MonkeyPatch.context() as patch:
        for constant, value in SMALLER.get(name, {}).items():
            patch.setattr(importlib.import_module(EXPERIMENTS[name]), constant, value)
        options = options_of(experiment, *SHORTEST[name])
        folder = new_run(tmp_path_factory.mktemp("runs"), name, vars(options))
        yield Run(name, experiment, folder, experiment.method.run(options, folder))


def test_every_claim_has_a_number_and_a_row_in_the_record(run: Run) -> None:
    claims = run.results.get("claims", [])
    assert [(claim["source"], claim["text"]) for claim in claims] == [(claim.source, claim.text) for claim in run.experiment.claims]
    assert all(claim["ours"] for claim in claims)
    assert run.results.get("passed") is True or run.name not in PASS
    assert run.name not in ROWS or run.results["default"].keys() == ROWS[run.name]
    write(run.folder / RESULTS, run.results)
    record = entries_of(runs_in([run.folder]))
    table = {claim.text: claim for name, claim in rows(record) if name == run.name}
    assert all(table[claim["text"]].ours.startswith(claim["ours"]) for claim in claims)
    assert all(claim["text"].replace("|", "\\|") in page(record) for claim in claims)


def test_it_resumes_without_repeating_or_changing_anything(run: Run) -> None:
    before = {path: path.read_bytes() for path in run.folder.rglob("*") if path.is_file() and path.suffix != ".png"}
    assert json.dumps(run.again()) == json.dumps(run.results)
    assert {path: path.read_bytes() for path in before} == before


def test_a_cell_depends_on_its_settings_and_its_seed_alone(run: Run) -> None:
    method = run.experiment.method
    if not isinstance(method, Sweep):
        pytest.skip("no sweep")
    cell = min(method.cells(options_of(run.experiment, *SHORTEST[run.name])), key=lambda cell: cell.cost)
    before, again = load_cells(run.folder)[cell.name].values, method.trial(cell.settings, cell.seed)
    assert before.keys() == again.keys()
    for name in before.keys():
        np.testing.assert_equal(again[name], before[name], name)


def test_its_figure_is_drawn(run: Run) -> None:
    pytest.importorskip("matplotlib")
    assert run.experiment.method.figure(run.folder).read_bytes().startswith(b"\x89PNG")
