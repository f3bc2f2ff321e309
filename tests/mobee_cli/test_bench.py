from __future__ import annotations

import contextlib
import io
import json
import sys
from pathlib import Path

import pytest

from mobee_cli.__main__ import main

SHORT = ("--quick", "--objects", "0", "--rounds", "1")


@pytest.fixture(scope="module")
def told() -> tuple[int, dict]:
    """What one short run prints as JSON, and its exit code."""
    pytest.importorskip("mujoco")
    with contextlib.redirect_stdout(io.StringIO()) as said:
        code = main(["bench", "model", *SHORT, "--json"])
    return code, json.loads(said.getvalue())


def test_json_tells_rates_ratios_requirements_and_agreement(told: tuple[int, dict]) -> None:
    _, result = told
    rates, ratios = result["poses_per_second"]["0"], result["times_mujoco"]["0"]
    assert {"batch", "one call", "one call, Contact objects", "MuJoCo", "python-fcl, pair by pair", "python-fcl, trees of boxes"} <= set(
        rates
    )
    assert all(rate > 0.0 for rate in rates.values())
    assert ratios["batch"] == pytest.approx(rates["batch"] / rates["MuJoCo"])
    assert [(one["name"], one["boxes"], one["least"]) for one in result["requirements"]][:2] == [("batch", 0, 2.2), ("one call", 0, 1.7)]
    assert {one["peer"] for one in result["agreement"]} >= {"MuJoCo", "python-fcl"}
    assert all(one["passed"] for one in result["agreement"])


def test_the_exit_code_says_whether_all_is_met(told: tuple[int, dict]) -> None:
    code, result = told
    assert code == (0 if all(one["passed"] for one in result["requirements"] + result["agreement"]) else 1)


def test_the_report_fits_80_columns_and_marks_what_falls_short(told: tuple[int, dict]) -> None:
    from experiments.bench.model_report import report

    result = told[1]
    result["requirements"][0] |= {"passed": False, "ratio": 0.5}
    lines = report(result).splitlines()
    assert max(map(len, lines)) <= 80
    assert [line.split()[-2:] for line in lines if line.endswith("SHORT")] == [["0.5", "SHORT"]]


def test_without_mujoco_it_names_the_extra(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setitem(sys.modules, "mujoco", None)
    assert main(["bench", "model", "--quick"]) == 3
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err == "mobee bench: MuJoCo is not installed: pip install '.[bench]' in MoBeE's folder\n"


@pytest.mark.parametrize("given", ["1001", "-1", "many"])
def test_a_number_of_objects_that_there_are_not_is_refused(given: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit, match="2"):
        main(["bench", "model", "--objects", given])
    assert "1000" in capsys.readouterr().err


def test_a_figure_is_drawn(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    for module in ("mujoco", "matplotlib"):
        pytest.importorskip(module)
    monkeypatch.setattr("experiments.bench.model_cost.BOXES", (0, 10))
    monkeypatch.setattr("experiments.bench.model_cost.PRIMITIVES", (8, 16))
    path = tmp_path / "cost.png"
    assert main(["bench", "model", "--figure", str(path), "--rounds", "1"]) == 0
    assert path.read_bytes().startswith(b"\x89PNG")
    assert capsys.readouterr().out.strip() == str(path)


@pytest.mark.parametrize("given", ["cost.txt", "no/such/folder/cost.png"])
def test_a_figure_that_cannot_be_written_is_refused_before_anything_is_measured(given: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit, match="2"):
        main(["bench", "model", "--figure", given])
    assert given in capsys.readouterr().err


def test_the_plant_is_timed_beside_mujoco_and_repeats_itself() -> None:
    pytest.importorskip("mujoco")
    with contextlib.redirect_stdout(io.StringIO()) as said:
        code = main(["bench", "plant", "--quick", "--json"])
    result = json.loads(said.getvalue())
    assert result["same_hash"]
    assert [(one["name"], one["least"]) for one in result["requirements"]] == [
        ("one arm, times real time", 2000.0),
        ("one arm, actions/s", 700.0),
        ("one arm reaching, times real time", 2000.0),
        ("three agents at the table, transitions/s", 1500.0),
    ]
    assert result["one_arm"]["seconds_per_action"] == pytest.approx(6.4, abs=1.0)
    assert result["times_mujoco"] == pytest.approx(result["mujoco_us_per_tick"] / result["one_arm"]["us_per_tick"])
    assert code == (0 if all(one["passed"] for one in result["requirements"]) else 1)
