# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import pytest

from experiments.claims.ch2_model import model_throughput
from experiments.claims.ch7_learning import hypercube_exploration
from experiments.kit.run_folder import locked, new_run
from experiments.registry import EXPERIMENTS
from mobee.errors import InvalidValue
from mobee_cli import experiment
from mobee_cli.__main__ import main

ROOT = Path(__file__).parents[2]
QUICK = ("--robots", "katana", "--objects", "2", "--edits", "3")
SHORT = ("--quick", "--jobs", "1")


def test_list_names_every_experiment_with_its_claim(capsys):
    assert main(["experiment", "list", "--json"]) == 0
    listed = json.loads(capsys.readouterr().out)
    assert [entry["name"] for entry in listed] == list(EXPERIMENTS)
    assert all(entry["claim"] and entry["source"] for entry in listed)
    assert main(["experiment", "list"]) == 0
    said = capsys.readouterr().out
    assert all(f"{entry['name']} {entry['claim']} ({entry['source']})" in " ".join(said.split()) for entry in listed)
    assert all(len(line) <= 80 for line in said.splitlines())


def test_a_run_leaves_its_options_versions_records_and_results(tmp_path, capsys):
    assert main(["experiment", "run", "model-throughput", *QUICK, "--seed", "3", "--runs", str(tmp_path), "--json"]) == 0
    said = capsys.readouterr()
    results = json.loads(said.out)
    folder = Path(results.pop("run"))
    assert folder.parent == tmp_path
    assert said.err == ""
    assert json.loads((folder / "results.json").read_text()) == json.loads(json.dumps(results))
    options = json.loads((folder / "config.json").read_text())["options"]
    assert (options["objects"], options["edits"], options["seed"]) == (2, 3, 3)
    assert {path.name for path in folder.iterdir()} == {"config.json", "versions.json", "results.json", "flood.csv"}


@pytest.mark.parametrize("name", list(EXPERIMENTS))
def test_the_help_of_an_experiment_fits_the_terminal(name, capsys):
    with pytest.raises(SystemExit):
        main(["experiment", "run", name, "--help"])
    assert all(len(line) <= 80 for line in capsys.readouterr().out.splitlines())


def test_a_run_that_continues_in_another_process_is_not_changed(tmp_path, capsys):
    main(["experiment", "run", "model-throughput", *QUICK, "--runs", str(tmp_path), "--json"])
    folder = Path(json.loads(capsys.readouterr().out)["run"])
    before = (folder / "flood.csv").read_bytes()
    with locked(folder):
        assert main(["experiment", "run", "model-throughput", "--resume", str(folder)]) == 2
    assert "another process works on this run" in capsys.readouterr().err
    assert (folder / "flood.csv").read_bytes() == before


def test_a_figure_is_drawn_of_the_newest_run(tmp_path, capsys):
    pytest.importorskip("matplotlib")
    for _ in range(2):
        assert main(["experiment", "run", "model-throughput", *QUICK, "--runs", str(tmp_path)]) == 0
        folder = Path(capsys.readouterr().out.splitlines()[0].partition(": ")[2])
    assert main(["experiment", "figure", "model-throughput", "--runs", str(tmp_path), "--json"]) == 0
    assert Path(json.loads(capsys.readouterr().out)["figure"]).parent == folder
    assert main(["experiment", "figure", str(folder)]) == 0
    assert Path(capsys.readouterr().out.strip()).parent == folder


def test_a_resumed_run_keeps_its_options(tmp_path, capsys):
    main(["experiment", "run", "model-throughput", *QUICK, "--runs", str(tmp_path), "--json"])
    folder = json.loads(capsys.readouterr().out)["run"]
    assert main(["experiment", "run", "model-throughput", "--resume", folder, "--objects", "3", "--json"]) == 0
    results = json.loads(capsys.readouterr().out)
    assert results["run"] == folder
    assert set(results) == {"run", "complete", "katana"}
    assert results["katana"]["objects_reached"] == 3
    assert json.loads((Path(folder) / "config.json").read_text())["options"]["objects"] == 3


def test_a_short_run_is_not_mixed_with_a_whole_one(tmp_path, capsys):
    folder = tmp_path / "20260101-000000-lattice"
    folder.mkdir()
    (folder / "config.json").write_text(json.dumps({"experiment": "reward-decay", "options": {"seed": 0, "seeds": 1, "quick": False}}))
    assert main(["experiment", "run", "reward-decay", "--resume", str(folder), "--quick"]) == 2
    assert "was started without --quick" in capsys.readouterr().err


def test_a_resumed_run_keeps_its_seed(tmp_path, capsys):
    main(["experiment", "run", "model-throughput", *QUICK, "--seed", "3", "--runs", str(tmp_path), "--json"])
    folder = json.loads(capsys.readouterr().out)["run"]
    assert main(["experiment", "run", "model-throughput", "--resume", folder, "--seed", "4"]) == 2
    assert f"{folder} has seed 3, not 4" in capsys.readouterr().err


def test_a_run_is_not_resumed_with_fewer_seeds(tmp_path, capsys):
    folder = new_run(tmp_path, "hypercube-exploration", {"seed": 0, "seeds": 10})
    assert main(["experiment", "run", "hypercube-exploration", "--resume", str(folder), "--seeds", "6"]) == 2
    assert f"{folder} was started with 10 seeds, not 6: those that are finished would count too." in capsys.readouterr().err


def test_the_run_of_another_experiment_is_not_drawn(tmp_path, capsys):
    folder = new_run(tmp_path, "reward-decay", {"seed": 0})
    assert main(["experiment", "figure", "hypercube-exploration", str(folder)]) == 2
    assert f"{folder} is a run of 'reward-decay', not of 'hypercube-exploration'" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["run", "model-troughput"], "Did you mean 'model-throughput'"),
        (["figure", "model-throughput", "--runs", "nowhere"], "no run of 'model-throughput'"),
        (["figure", "model-throughput", "nope", "--runs", "nowhere"], "nope: there is no such folder"),
        (["run", "model-throughput", "--resume", "nowhere"], "not the folder of a run"),
    ],
)
def test_an_impossible_request_is_refused_in_one_line(arguments, says, capsys):
    assert main(["experiment", *arguments]) == 2
    said = capsys.readouterr().err
    assert says in said
    assert len(said.splitlines()) == 1


@pytest.mark.parametrize("option", ["--objects=0", "--edits=many", "--duration=nan", "--robots=nao", "--objcts=3", "--seed=-1"])
def test_a_wrong_option_of_an_experiment_is_refused_in_one_line(option, capsys):
    with pytest.raises(SystemExit) as ended:
        main(["experiment", "run", "model-throughput", option])
    assert ended.value.code == 2
    said = capsys.readouterr().err
    assert len(said.splitlines()) == 1
    assert said.startswith("mobee experiment run model-throughput")


def set_run(monkeypatch, run):
    """Make this the `run` of the experiment model-throughput."""
    monkeypatch.setattr(
        model_throughput, "EXPERIMENT", replace(model_throughput.EXPERIMENT, method=replace(model_throughput.EXPERIMENT.method, run=run))
    )


def test_a_failed_verdict_fails_the_command(tmp_path, monkeypatch, capsys):
    set_run(monkeypatch, lambda arguments, folder: {"passed": False, "torn": {"rows": 3}})
    assert main(["experiment", "run", "model-throughput", "--runs", str(tmp_path)]) == 1
    assert "torn:\n  rows: 3\n" in capsys.readouterr().out


@pytest.mark.parametrize(("option", "says"), [("--motors=l_elbo", "Did you mean 'l_elbow'"), ("--periods=40", "tick of 0.04 s")])
def test_a_refused_run_leaves_no_folder(option, says, tmp_path, capsys):
    assert main(["experiment", "run", "step-response", option, "--postures", "1", "--runs", str(tmp_path)]) == 2
    assert says in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_a_run_refused_after_its_first_record_keeps_it(tmp_path, monkeypatch):
    def refuse(arguments, folder):
        (folder / "records.csv").write_text("depth\n1.0\n")
        raise InvalidValue("no more")

    set_run(monkeypatch, refuse)
    assert main(["experiment", "run", "model-throughput", "--runs", str(tmp_path)]) == 2
    (folder,) = tmp_path.iterdir()
    assert (folder / "records.csv").read_text() == "depth\n1.0\n"


@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGTERM])
def test_an_interruption_leaves_the_finished_records_and_prints_how_to_continue(tmp_path, how):
    argv = [sys.executable, "-m", "mobee_cli", "experiment", "run", "model-throughput", "--robots", "katana", "--runs", str(tmp_path)]
    with subprocess.Popen(argv, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        give_up = time.monotonic() + 120.0
        while not any(len(path.read_text().splitlines()) > 4 for path in tmp_path.glob("*/flood.csv")):
            assert process.poll() is None
            assert time.monotonic() < give_up
            time.sleep(0.1)
        process.send_signal(how)
        out, err = process.communicate(timeout=30.0)
    assert process.returncode == 130
    (folder,) = tmp_path.iterdir()
    assert f"--resume {folder}" in err
    assert len(err.splitlines()) == 1
    assert "Traceback" not in out + err


def test_a_disk_that_is_full_during_a_run_is_reported_with_how_to_continue(tmp_path, monkeypatch, capsys):
    def fail(arguments, folder):
        raise OSError(28, "No space left on device")

    set_run(monkeypatch, fail)
    assert main(["experiment", "run", "model-throughput", "--runs", str(tmp_path)]) == 3
    (folder,) = tmp_path.iterdir()
    said = capsys.readouterr().err
    assert "No space left on device" in said and f"continue with `mobee experiment run model-throughput --resume {folder}`" in said


def test_ctrl_c_before_there_is_a_run_is_reported_in_one_line(tmp_path, monkeypatch, capsys):
    def interrupted(runs, name, options):
        raise KeyboardInterrupt

    monkeypatch.setattr(experiment, "new_run", interrupted)
    assert main(["experiment", "run", "model-throughput", *QUICK, "--runs", str(tmp_path)]) == 130
    assert capsys.readouterr().err == "mobee experiment: interrupted\n"


def test_an_interrupted_resume_with_more_seeds_leaves_no_results_of_fewer(tmp_path, monkeypatch, capsys):
    assert main(["experiment", "run", "hypercube-exploration", *SHORT, "--seeds", "1", "--runs", str(tmp_path), "--json"]) == 0
    folder = json.loads(capsys.readouterr().out)["run"]

    def interrupted(settings, seed):
        raise KeyboardInterrupt

    stopped = replace(hypercube_exploration.EXPERIMENT, method=replace(hypercube_exploration.EXPERIMENT.method, trial=interrupted))
    monkeypatch.setattr(hypercube_exploration, "EXPERIMENT", stopped)
    assert main(["experiment", "run", "hypercube-exploration", "--resume", folder, "--seeds", "30"]) == 130
    assert main(["experiment", "claims", folder]) == 2
    assert f"{folder} has no results: finish the run" in capsys.readouterr().err


def test_resume_without_a_name_continues_the_newest_run(tmp_path, capsys):
    for _ in range(2):
        main(["experiment", "run", "model-throughput", *QUICK, "--runs", str(tmp_path), "--json"])
        newest = json.loads(capsys.readouterr().out)["run"]
    assert main(["experiment", "run", "model-throughput", "--runs", str(tmp_path), "--resume", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["run"] == newest


def test_claims_are_printed_as_on_the_page(capsys):
    assert main(["experiment", "claims", "--json"]) == 0
    entries = json.loads(capsys.readouterr().out)
    assert {"experiment", "source", "text", "published", "ours", "verdict", "p", "settings"} == set(entries[0])
    assert main(["experiment", "claims"]) == 0
    said = capsys.readouterr().out
    assert all(len(line) <= 80 for line in said.splitlines())
    assert entries[0]["text"] in " ".join(said.split())


def test_cells_that_fail_fail_the_command_and_are_named(tmp_path, capsys, monkeypatch):
    def broken(settings, seed):
        raise ValueError("broken")

    failing = replace(hypercube_exploration.EXPERIMENT, method=replace(hypercube_exploration.EXPERIMENT.method, trial=broken))
    monkeypatch.setattr(hypercube_exploration, "EXPERIMENT", failing)
    assert main(["experiment", "run", "hypercube-exploration", "--seeds", "1", "--jobs", "1", "--runs", str(tmp_path)]) == 1
    said = capsys.readouterr().err
    assert "50-50-0.9-s0: ValueError: broken" in said and "--resume" in said
