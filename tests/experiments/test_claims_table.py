# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import argparse
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import false_discovery_control

from experiments import chapters, claims_table, frozen_rules
from experiments.claims.ch7_learning import hypercube_exploration
from experiments.claims_table import (
    FALSE_DISCOVERIES,
    better,
    chapters_text,
    claims_text,
    entries_of,
    finished_runs,
    largest_rate,
    page,
    recorded,
    rows,
    runs_in,
    stated,
)
from experiments.frozen_rules import CONFIRMING_SEED
from experiments.kit import raw_records
from experiments.kit.cells import write_cell
from experiments.kit.experiment import Claim, Envelope
from experiments.kit.run_folder import new_run, write
from experiments.kit.statistics import RATES
from experiments.registry import BEYOND, CHAPTER7, EXPERIMENTS, load_experiment
from mobee.errors import InvalidValue
from mobee_cli.errors import UserError
from mobee_cli.experiment import add_arguments
from mobee_cli.experiment import run as run_command
from tests.experiments.options import options_of

REGENERATE = "run `mobee experiment claims --write` and check experiments/README.md and claims.json in"


def test_the_page_names_every_claim_that_an_experiment_states():
    said = claims_table.PAGE.read_text()
    missing = [claim.text for _, claim in stated() if claim.text.replace("|", "\\|") not in said]
    assert not missing, REGENERATE


def test_the_page_follows_from_the_recorded_numbers():
    assert claims_table.PAGE.read_text() == page(recorded()), REGENERATE


def test_the_chapters_in_the_results_follow_from_the_recorded_numbers():
    said = chapters.PAGE.read_text()
    assert said == chapters.with_section(said, chapters_text(recorded())), REGENERATE
    assert {chapters.chapter_of(claim) for _, claim in stated() if not claim.is_aim} == set(chapters.CHAPTERS)
    assert all(said.count(claim.text[1:]) for _, claim in stated() if not claim.is_aim)


@pytest.mark.parametrize("name", EXPERIMENTS)
def test_an_experiment_states_distinct_claims_without_numbers_and_one_of_chapter_7_some(name):
    claims = load_experiment(name).claims
    assert len({claim.text for claim in claims}) == len(claims) and (claims or name not in (*CHAPTER7, *BEYOND))
    assert all(claim.text and claim.source and claim.published and not claim.ours for claim in claims)


def found_in(folders):
    return entries_of(runs_in(folders))


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
    assert r"| 0.4 [0.3, 0.5] \| 7 | **confirmed** |  | exploration-coverage, 10 seeds |" in page(found_in([run]))


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
    assert "| 0.4 (4 seeds, too few for a verdict) | **open** |  | exploration-coverage, 4 seeds |" in page(record)


def test_short_and_unfinished_runs_are_not_taken_by_themselves(tmp_path, claim):
    finished(tmp_path, "exploration-coverage", [claim], quick=True)
    new_run(tmp_path, "hypercube-exploration", {})
    live = tmp_path / "20260101-000000-default"  # a run of `mobee launch` beside them
    live.mkdir()
    write(live / "config.json", {"scenario": "default"})
    assert finished_runs(tmp_path) == []


def test_a_short_run_gives_no_verdict_and_is_not_written_into_the_table(toy, tmp_path, claim):
    run = finished(tmp_path, "exploration-coverage", [claim.measured("0.4", True)], quick=True)
    (entry,) = found_in([run])["exploration-coverage"]["claims"]
    assert (entry["verdict"], entry["ours"]) == ("open", "0.4 (a short version, without a verdict)")
    with pytest.raises(UserError, match="was started with --quick: the table takes whole runs only"):
        command("--write", run)


def test_a_run_without_options_is_refused(tmp_path, claim):
    run = finished(tmp_path, "exploration-coverage", [claim.measured("0.4", True)])
    write(run / "config.json", {"experiment": "exploration-coverage"})
    with pytest.raises(InvalidValue, match=r"is not the folder of a run: it has no readable config\.json"):
        found_in([run])


def test_a_run_without_results_is_refused(tmp_path):
    with pytest.raises(InvalidValue, match="has no results: finish the run"):
        found_in([new_run(tmp_path, "exploration-coverage", {})])


def test_the_text_fits_the_terminal(claim):
    said = claims_text([("exploration-coverage", claim.measured("0.26 [0.22, 0.32]", Envelope("unit", {"1 cm": False})))], 60)
    assert said.startswith("not reproduced  ") and "ours: 0.26 [0.22, 0.32]" in said and "unit: fails for 1 cm" in said
    assert all(len(line) <= 60 for line in said.splitlines())


def test_the_page_keeps_the_records_of_experiments_that_did_not_run(tmp_path, monkeypatch, claim):
    monkeypatch.setattr(raw_records, "RECORDS", tmp_path / "records")
    monkeypatch.setattr(claims_table, "RECORD", tmp_path / "claims.json")
    monkeypatch.setattr(claims_table, "PAGE", tmp_path / "README.md")
    monkeypatch.setattr(chapters, "PAGE", tmp_path / "results.md")
    (tmp_path / "results.md").write_text("")
    record = found_in([finished(tmp_path, "exploration-coverage", [claim.measured("0.3", True)])])
    claims_table.write_page(record)
    (kept,) = recorded()["exploration-coverage"]["claims"]
    assert (kept["ours"], kept["verdict"]) == ("0.3 (no raw record)", "open")
    assert "0.3" in (tmp_path / "README.md").read_text()


P_VALUES = st.lists(st.sampled_from([*RATES, 1.0]), min_size=1, max_size=40)


@given(P_VALUES)
def test_verdicts_that_chance_could_explain_among_all_rows_are_those_of_benjamini_and_hochberg(p):
    most = largest_rate(p)
    theirs = false_discovery_control(p) <= FALSE_DISCOVERIES + 1e-12
    assert [value <= most for value in p] == theirs.tolist()


def test_a_row_that_is_not_distinguished_from_chance_among_all_rows_is_open(claim):
    def record(p):
        claims = [replace(one, ours="1", verdict="confirmed", p=p).record() for one in load_experiment("exploration-coverage").claims]
        claims[0] |= {"p": 0.05}
        return {"exploration-coverage": {"seeds": 10, "commit": "1", "claims": claims}}

    strict, lenient = (dict((c.text, c) for _, c in rows(record(p)))[claim.text] for p in (1.0, 0.001))
    assert (strict.verdict, lenient.verdict) == ("open", "confirmed") and "p 0.05" in strict.ours


@pytest.fixture
def toy(tmp_path, monkeypatch):
    """A table, records and frozen rules of their own; makes runs of hypercube-exploration whose numbers are those of its seed."""
    for module, name, path in (
        (claims_table, "RECORD", "claims.json"),
        (claims_table, "PAGE", "README.md"),
        (raw_records, "RECORDS", "records"),
        (frozen_rules, "FROZEN", "frozen.json"),
        (chapters, "PAGE", "results.md"),
    ):
        monkeypatch.setattr(module, name, tmp_path / path)
    (tmp_path / "results.md").write_text(f"before\n{chapters.BEGIN}\nformer text\n{chapters.END}\nafter\n")
    experiment = load_experiment("hypercube-exploration")
    cells = experiment.method.cells(options_of(experiment, "--seeds", "5"))
    values = experiment.method.trial(cells[0].settings, 0)

    def run(seed):
        folder = new_run(tmp_path / "runs", "hypercube-exploration", {"seed": seed, "seeds": 5})
        for cell in cells:
            write_cell(folder, cell, values | {"transitions": values["transitions"] + seed % 7}, 1.0)
        write(folder / "results.json", {"claims": [claim.record() for claim in experiment.claims]})
        return folder

    return run


def command(*words):
    parser = argparse.ArgumentParser()
    add_arguments(parser)
    return run_command(parser.parse_args(["claims", *map(str, words)]))


def test_new_seeds_confirm_frozen_rules_once_and_stand_beside_the_first(toy, tmp_path, capsys):
    first, again = toy(0), toy(CONFIRMING_SEED)
    runs = ("--runs", tmp_path / "runs")
    assert command("--write", *runs) == 0 and "confirmed" not in recorded()["hypercube-exploration"]
    with pytest.raises(UserError, match="only rules that were frozen before"):
        command("--write", "--confirm", *runs)
    assert command("--freeze", "hypercube-exploration") == command("--write", "--confirm", *runs) == command("--check") == 0
    entry = recorded()["hypercube-exploration"]
    assert entry["claims"] == found_in([first])["hypercube-exploration"]["claims"]
    assert entry["confirmed"]["claims"] == found_in([again])["hypercube-exploration"]["claims"]
    assert "| confirmed: " in claims_table.PAGE.read_text()
    results = (tmp_path / "results.md").read_text()
    assert results.startswith("before\n") and results.endswith("after\n") and "### Chapter 7" in results and "former text" not in results
    toy(CONFIRMING_SEED + 1)
    with pytest.raises(UserError, match="is confirmed once"):
        command("--write", "--confirm", *runs)
    assert command("--write", *runs) == 0 and recorded()["hypercube-exploration"] == entry
    entry["confirmed"]["claims"][1] |= {"ours": "320"}
    assert any("new seeds" in line for line in claims_table.all_differences({"hypercube-exploration": entry}))


def test_rules_that_new_seeds_have_judged_are_not_frozen_again(toy, tmp_path, monkeypatch, capsys):
    toy(0), toy(CONFIRMING_SEED)
    runs = ("--runs", tmp_path / "runs")
    assert command("--freeze", "hypercube-exploration") == 0 and capsys.readouterr().out.endswith("the rules of hypercube-exploration\n")
    with monkeypatch.context() as changed:
        changed.setattr(hypercube_exploration, "PUBLISHED", 330)
        with pytest.raises(UserError, match=r"\(changed: PUBLISHED\): new seeds confirm only rules that were frozen before"):
            command("--write", "--confirm", *runs)
        assert command("--freeze", "hypercube-exploration") == 0
    assert command("--freeze", "hypercube-exploration") == command("--write", *runs) == command("--write", "--confirm", *runs) == 0
    before = frozen_rules.frozen()
    monkeypatch.setattr(hypercube_exploration, "PUBLISHED", 330)
    with pytest.raises(UserError, match="has been run with new seeds, so its rules stay as they are frozen; changed: PUBLISHED"):
        command("--freeze")
    assert frozen_rules.frozen() == before


def test_first_and_new_seeds_are_not_mixed_up(toy, tmp_path):
    first = toy(0)
    with pytest.raises(UserError, match="no finished run with new seeds: start one with `mobee experiment run NAME --seed 1000"):
        command("--write", "--confirm", "--runs", tmp_path / "runs")
    with pytest.raises(UserError, match="leave --confirm out"):
        command("--write", "--confirm", first)
    with pytest.raises(UserError, match="new seeds: add --confirm"):
        command("--write", toy(CONFIRMING_SEED))
    with pytest.raises(UserError, match="--freeze takes names of experiments, and no RUN"):
        command(first, "--freeze", "hypercube-exploration")
    assert recorded() == frozen_rules.frozen() == {}


def test_a_record_that_is_too_large_leaves_its_claims_open_and_is_named(toy, tmp_path, monkeypatch):
    toy(0)
    monkeypatch.setattr(raw_records, "MAX_BYTES", 100)
    with pytest.raises(UserError, match="give its sweep a summary"):
        command("--write", "--runs", tmp_path / "runs")
    assert {claim["verdict"] for claim in recorded()["hypercube-exploration"]["claims"]} == {"open"}


def test_a_verdict_without_a_raw_record_is_a_difference(toy, claim):
    entry = {"seeds": 10, "commit": None, "claims": [claim.measured("0.4", True).record()]}
    assert claims_table.differences("exploration-coverage", entry) == [
        f"exploration-coverage, {claim.text!r}: confirmed without a raw record"
    ]


def test_confirmed_experiments_have_the_rules_that_were_frozen():
    for name, entry in recorded().items():
        if "confirmed" in entry:
            frozen_rules.require_frozen(name)
