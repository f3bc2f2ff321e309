# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import argparse
import json
import sys
from types import SimpleNamespace

import pytest

from experiments.claims.ch7_learning import chapter7
from experiments.kit.experiment import Claim, Experiment, Steps
from experiments.kit.run_folder import new_run
from experiments.kit.sweep import sweep_arguments
from experiments.registry import EXPERIMENTS
from mobee.errors import MobeeError

CLAIM = Claim("thesis 7", "a toy works", "it does")


def options(*given: str) -> argparse.Namespace:
    parser = argparse.ArgumentParser()
    chapter7.add_arguments(parser)
    parser.add_argument("--seed", type=int, default=0)
    return parser.parse_args(given)


@pytest.fixture
def toys(monkeypatch):
    """Two experiments that record their calls, in place of hypercube-exploration and exploration-coverage."""
    calls = []

    def run(name):
        def toy(arguments, folder):
            calls.append((name, arguments.seeds, arguments.seed, arguments.quick))
            if name in broken:
                raise broken[name]
            return {"answer": 42, "claims": [CLAIM.measured("0.3", True).record()]}

        return toy

    def figure(folder):
        (folder / "toy.png").touch()
        return folder / "toy.png"

    broken: dict[str, Exception] = {}
    monkeypatch.setattr(chapter7, "CHAPTER7", ("hypercube-exploration", "exploration-coverage"))
    monkeypatch.setattr(chapter7, "BEYOND", ())
    for name in ("hypercube-exploration", "exploration-coverage"):
        toy = SimpleNamespace(EXPERIMENT=Experiment("it works", "thesis 7", Steps(sweep_arguments, run(name), figure)))
        monkeypatch.setitem(EXPERIMENTS, name, f"toy_{name}")
        monkeypatch.setitem(sys.modules, f"toy_{name}", toy)
    return SimpleNamespace(calls=calls, broken=broken)


def test_every_part_runs_in_its_own_folder_with_its_own_defaults(tmp_path, toys):
    folder = new_run(tmp_path, "chapter7", {})
    results = chapter7.run(options("--seed", "3"), folder)
    assert toys.calls == [("hypercube-exploration", 10, 3, False), ("exploration-coverage", 10, 3, False)]
    assert results["passed"] and results["parts"]["exploration-coverage"]["figure"] == "exploration-coverage/toy.png"
    assert json.loads((folder / "hypercube-exploration" / "results.json").read_text())["answer"] == 42
    config = json.loads((folder / "hypercube-exploration" / "config.json").read_text())
    assert config == {
        "experiment": "hypercube-exploration",
        "options": {"seeds": 10, "jobs": None, "engine": "processes", "quick": False, "seed": 3},
    }


@pytest.mark.parametrize(
    ("error", "reason"),
    [(MobeeError("the toy is broken"), "the toy is broken"), (ValueError("of its own code"), "ValueError: of its own code")],
)
def test_a_part_that_fails_stops_no_other_and_is_run_again(tmp_path, toys, error, reason):
    folder = new_run(tmp_path, "chapter7", {})
    toys.broken["hypercube-exploration"] = error
    results = chapter7.run(options(), folder)
    assert not results["passed"] and results["parts"]["hypercube-exploration"]["failed"] == reason
    assert str(error) in (folder / "hypercube-exploration" / "failed.txt").read_text()
    toys.broken.clear()
    assert chapter7.run(options(), folder)["passed"]
    assert [name for name, *_ in toys.calls] == ["hypercube-exploration", "exploration-coverage", "hypercube-exploration"]
    assert not (folder / "hypercube-exploration" / "failed.txt").exists()


def test_a_part_continues_for_more_seeds_and_not_for_fewer(tmp_path, toys):
    folder = new_run(tmp_path, "chapter7", {})
    for seeds in ("2", "6", "3"):
        chapter7.run(options("--only", "exploration-coverage", "--seeds", seeds), folder)
    assert [seeds for _, seeds, *_ in toys.calls] == [2, 6]


@pytest.mark.parametrize(("seeds", "verdict"), [("4", "open"), ("5", "confirmed")])
def test_few_seeds_leave_every_claim_open(tmp_path, toys, seeds, verdict):
    folder = new_run(tmp_path, "chapter7", {})
    chapter7.run(options("--only", "exploration-coverage", "--seeds", seeds), folder)
    assert json.loads((folder / "exploration-coverage" / "results.json").read_text())["claims"][0]["verdict"] == verdict


def test_options_for_all_are_passed_on(tmp_path, toys):
    chapter7.run(options("--seeds", "2", "--quick", "--only", "exploration-coverage"), new_run(tmp_path, "chapter7", {}))
    assert toys.calls == [("exploration-coverage", 2, 0, True)]


def test_the_option_all_adds_the_experiments_beyond_the_chapter(tmp_path, toys, monkeypatch):
    monkeypatch.setattr(chapter7, "CHAPTER7", ("hypercube-exploration",))
    monkeypatch.setattr(chapter7, "BEYOND", ("exploration-coverage",))
    assert list(chapter7.run(options(), tmp_path)["parts"]) == ["hypercube-exploration"]
    assert list(chapter7.run(options("--all"), tmp_path)["parts"]) == ["hypercube-exploration", "exploration-coverage"]
