# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import pytest

from experiments import claims_table
from experiments.claims_table import better, claims_text, finished_runs, found_in, page, recorded, rows, stated
from experiments.kit.experiment import Claim
from experiments.kit.run_folder import new_run, write
from experiments.registry import BEYOND, CHAPTER7, EXPERIMENTS, load_experiment
from mobee.errors import InvalidValue

REGENERATE = "run `mobee experiment claims --write` and check experiments/README.md and claims.json in"


def test_the_page_names_every_claim_that_an_experiment_states():
    said = claims_table.PAGE.read_text()
    missing = [claim.text for _, claim in stated() if claim.text.replace("|", "\\|") not in said]
    assert not missing, REGENERATE


def test_the_page_is_what_the_recorded_numbers_give():
    assert claims_table.PAGE.read_text() == page(recorded()), REGENERATE


@pytest.mark.parametrize("name", EXPERIMENTS)
def test_an_experiment_states_distinct_claims_without_numbers_and_one_of_chapter_7_some(name):
    claims = load_experiment(name).claims
    assert len({claim.text for claim in claims}) == len(claims) and (claims or name not in (*CHAPTER7, *BEYOND))
    assert all(claim.text and claim.source and claim.published and not claim.ours for claim in claims)


def finished(runs, name, claims, **options):
    folder = new_run(runs, name, {"seeds": 10, **options})
    write(folder / "results.json", {"claims": [claim.record() for claim in claims]})
    return folder


@pytest.fixture
def claim() -> Claim:
    return load_experiment("exploration-coverage").claims[0]


def test_a_finished_run_fills_its_rows_and_no_others(tmp_path, claim):
    run = finished(tmp_path, "exploration-coverage", [claim.measured("0.4 [0.3, 0.5] | 7", True)])
    table = dict((c.text, c) for _, c in rows(found_in([run])))
    assert table[claim.text].ours == "0.4 [0.3, 0.5] | 7" and table[claim.text].verdict == "confirmed"
    assert all(c.verdict == "open" for c in table.values() if c.text != claim.text)
    assert r"| 0.4 [0.3, 0.5] \| 7 | **confirmed** | exploration-coverage, 10 seeds |" in page(found_in([run]))


def test_the_parts_of_a_chapter_count_and_a_later_run_more(tmp_path, claim):
    chapter = new_run(tmp_path, "chapter7", {})
    part = chapter / "exploration-coverage"
    part.mkdir()
    write(part / "config.json", {"experiment": "exploration-coverage", "options": {"seeds": 6}})
    write(part / "results.json", {"claims": [claim.measured("old", False).record()]})
    assert found_in([chapter])["exploration-coverage"]["seeds"] == 6
    assert found_in([chapter / "exploration-coverage"]) == found_in([chapter])
    run = finished(tmp_path, "exploration-coverage", [claim.measured("new", True)])
    assert found_in([chapter, run])["exploration-coverage"]["claims"][0]["ours"] == "new"
    assert set(finished_runs(tmp_path)) == {chapter, run}


def test_of_several_runs_the_one_with_most_seeds_counts_then_the_newest(tmp_path, claim):
    folders = [finished(tmp_path, "exploration-coverage", [claim.measured(f"of {n}", True)], seeds=n) for n in (6, 10, 10, 5)]
    before, found = found_in(folders[:1]), found_in(folders)
    assert found["exploration-coverage"]["seeds"] == 10 and found == found_in(folders[2:3])
    assert better(before, found) == better(found, before) == found


def test_runs_of_few_seeds_are_open_on_the_page(tmp_path, claim):
    record = found_in([finished(tmp_path, "exploration-coverage", [claim.measured("0.4", True)], seeds=4)])
    assert "| 0.4 (4 seeds, too few for a verdict) | **open** | exploration-coverage, 4 seeds |" in page(record)


def test_short_and_unfinished_runs_are_not_taken_by_themselves(tmp_path, claim):
    finished(tmp_path, "exploration-coverage", [claim], quick=True)
    new_run(tmp_path, "hypercube-exploration", {})
    live = tmp_path / "20260101-000000-default"  # a run of `mobee launch` beside them
    live.mkdir()
    write(live / "config.json", {"scenario": "default"})
    assert finished_runs(tmp_path) == []


def test_a_run_without_results_is_refused(tmp_path):
    with pytest.raises(InvalidValue, match="has no results: finish the run"):
        found_in([new_run(tmp_path, "exploration-coverage", {})])


def test_the_text_fits_the_terminal(claim):
    said = claims_text([("exploration-coverage", claim.measured("0.26 [0.22, 0.32]", False))], 60)
    assert said.startswith("refuted ") and "ours: 0.26 [0.22, 0.32]" in said
    assert all(len(line) <= 60 for line in said.splitlines())


def test_the_page_keeps_what_was_recorded_of_experiments_that_did_not_run(tmp_path, monkeypatch, claim):
    monkeypatch.setattr(claims_table, "RECORD", tmp_path / "claims.json")
    monkeypatch.setattr(claims_table, "PAGE", tmp_path / "README.md")
    record = found_in([finished(tmp_path, "exploration-coverage", [claim.measured("0.3", True)])])
    claims_table.write_page(record)
    assert recorded() == record
    assert "0.3" in (tmp_path / "README.md").read_text()
