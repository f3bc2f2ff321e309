# SPDX-License-Identifier: Apache-2.0
"""`mobee bench` on given numbers: nothing is measured here."""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mobee_cli.__main__ import main
from mobee_cli.bench import BENCHES


def model_result(ours: float = 100.0, passed: bool = True) -> dict[str, Any]:
    """Return the result of the model's benchmark if a batch of ours were that many times as fast as MuJoCo, and one call half of it."""
    from experiments.bench.agreement import Agreement
    from experiments.bench.model import BATCH, CALL, CALL_OBJECTS, KINEMATICS, MUJOCO, PAIRS, TREES, summarized
    from experiments.bench.scenes import ICUB, MAKERS

    names = {BATCH: ours, CALL: ours / 2, CALL_OBJECTS: 3.0, KINEMATICS: 9.0, MUJOCO: 1.0, PAIRS: 0.01, TREES: 0.02}
    rates = {name: 1000.0 * times * np.array([0.9, 1.0, 1.2]) for name, times in names.items()}
    others = {name: rates[name] for name in (BATCH, CALL, MUJOCO)}
    measured = {ICUB: {0: rates, 100: rates}} | {maker.name: {0: others, 100: others} for maker in MAKERS}
    one = Agreement("coal", ICUB, 100, 500, 14_076, 3, 1e-7, {"box-capsule": 1e-12}, 0.98, 1e-12, passed)
    about = {"motors": 41, "joints": 61, "primitives": 129, "pairs": 7451, "poses": 2000, "rounds": 3}
    threads = {"gain": 1.9, "processes": 1.95}
    return summarized(measured, threads, 1e-12, [one]) | {"workload": about, "core": 1, "versions": {}, "coal": True}


def test_every_benchmark_has_help(capsys: pytest.CaptureFixture[str]) -> None:
    for name in BENCHES:
        with pytest.raises(SystemExit, match="0"):
            main(["bench", name, "--help"])
        assert "Exit code: 0 every requirement is met" in capsys.readouterr().out


@pytest.mark.parametrize(("ours", "agree", "code"), [(100.0, True, 0), (5.0, True, 1), (100.0, False, 1)])
def test_the_exit_code_says_whether_all_requirements_are_met(
    ours: float, agree: bool, code: int, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("experiments.bench.model.measure", lambda settings: model_result(ours, agree))
    assert main(["bench", "model", "--json"]) == code
    result = json.loads(capsys.readouterr().out)
    assert result["passed"] == (code == 0)


def test_the_model_is_judged_by_ratios_of_the_same_round() -> None:
    result = model_result(ours=6.0)
    assert result["times_mujoco"][0]["batch"] == pytest.approx(6.0)
    assert result["others"]["hulls"]["times_mujoco"][100]["one call"] == pytest.approx(3.0)
    passed = {one["name"]: one["passed"] for one in result["requirements"]}
    assert not passed["iCub, batch, 100: x MuJoCo"]  # 8 are required
    assert passed["boxes, cylinders, batch, 0: x MuJoCo"] and passed["iCub, batch, 0: x python-fcl"]
    assert "iCub, batch, 1000: x MuJoCo" not in passed  # not measured
    assert not any(name.startswith("hulls") for name in passed)  # printed beside them


def test_the_report_fits_80_columns_and_marks_failed_requirements() -> None:
    from experiments.bench.model import report

    lines = report(model_result(ours=5.0, passed=False)).splitlines()
    assert max(map(len, lines)) <= 80
    assert sum(line.endswith("SHORT") for line in lines) == 4  # batch and one call of the iCub, 0 and 100 boxes
    assert sum(line.endswith("DIFFERS") for line in lines) == 1


def test_without_mujoco_it_names_the_extra(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setitem(sys.modules, "mujoco", None)
    assert main(["bench", "model", "--quick"]) == 3
    output = capsys.readouterr()
    assert output.out == ""
    assert output.err == 'mobee bench: MuJoCo is not installed: pip install "mobee[bench]"\n'


@pytest.mark.parametrize("given", ["1001", "-1", "many"])
def test_a_number_of_objects_out_of_range_is_refused(given: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit, match="2"):
        main(["bench", "model", "--objects", given])
    assert "1000" in capsys.readouterr().err


@pytest.mark.parametrize("bench", ["agree", "faults", "network", "fuzz"])
def test_a_seed_below_0_is_refused_before_a_system_starts(bench: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit, match="2"):
        main(["bench", bench, "--seed", "-1"])
    assert "argument --seed: '-1' is not a whole number of 0 or more" in capsys.readouterr().err


def test_a_figure_is_drawn(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("matplotlib")
    from experiments.bench.model import BATCH, CALL, MUJOCO, TREES

    costs = {name: 10.0 for name in (BATCH, CALL, MUJOCO, TREES)}
    curves = {"boxes": {0: costs, 10: costs}, "primitives": {8: costs, 16: costs}}
    cost_figures = pytest.importorskip("experiments.bench.cost_figures")
    made = replace(cost_figures.FIGURES["model"], measure=lambda quick, rounds: curves)
    monkeypatch.setitem(cost_figures.FIGURES, "model", made)
    path = tmp_path / "cost.png"
    assert main(["bench", "model", "--figure", str(path)]) == 0
    assert path.read_bytes().startswith(b"\x89PNG")
    assert capsys.readouterr().out.strip() == str(path)


@pytest.mark.parametrize("given", ["cost.txt", "no/such/folder/cost.png"])
def test_a_figure_that_cannot_be_written_is_refused_before_anything_is_measured(given: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit, match="2"):
        main(["bench", "model", "--figure", given])
    assert given in capsys.readouterr().err


@pytest.mark.parametrize(("old", "said"), [("no-such-commit", "git worktree: "), ("", "git worktree: ")])
def test_a_checkout_that_does_not_exist_is_reported(old: str, said: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["bench", "against", old, "--cases", "edges"]) == 3
    assert capsys.readouterr().err.startswith(f"mobee bench: {said}")


def test_an_unknown_case_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit, match="2"):
        main(["bench", "against", "HEAD", "--cases", "everything"])
    assert "'three agents'" in capsys.readouterr().err
