# SPDX-License-Identifier: Apache-2.0
"""Two checkouts: the arithmetic on their times, and the control of their processes, with toy checkouts."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from experiments.bench import against
from experiments.bench.against import (
    NO_SLOWER,
    REPOSITORY,
    AgainstFailed,
    Checkout,
    build_core,
    checkout,
    compared,
    measure_checkouts,
    report,
)


def one_round(old: float, new: float, poses: int = 10) -> against.Pair:
    return {"old": {"seconds": old, "work": {"poses": 10}}, "new": {"seconds": new, "work": {"poses": poses}}}


def test_the_median_of_the_rounds_ratios_counts() -> None:
    found = compared([one_round(2.0, 1.0), one_round(9.0, 3.0), one_round(40.0, 10.0), one_round(1.0, 10.0), one_round(5.0, 1.0)])
    assert found["ratio"] == 3.0 and found["quartiles"] == [2.0, 4.0] and found["range"] == [0.1, 5.0]
    assert found["old_s"] == 5.0 and found["new_s"] == 3.0
    assert found["same_work"]


def test_counts_are_printed_where_the_work_differs() -> None:
    found = {"edges": compared([one_round(2.0, 1.0, poses=11)])}
    assert not found["edges"]["same_work"]
    lines = report({"rounds": 1, "cases": found, "requirements": []}).splitlines()
    assert [line.strip() for line in lines if "poses" in line] == ["old: poses 10", "new: poses 11"]


@pytest.fixture
def toys(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> tuple[Checkout, Checkout]:
    """Two checkouts whose library holds the seconds of its work, and cases that report them."""
    for name, seconds in (("old", 3.0), ("new", 1.0)):
        folder = tmp_path / name / "mobee"
        folder.mkdir(parents=True)
        (folder / "__init__.py").write_text(f"SECONDS = {seconds}\n")
    cases = tmp_path / "cases.py"
    cases.write_text(
        "import json, sys, mobee\n"
        "if sys.argv[1] == 'lockstep': raise SystemExit('this checkout has none')\n"
        "print(json.dumps({'library': mobee.__file__}), flush=True)\n"
        "for _ in sys.stdin: print(json.dumps({'seconds': mobee.SECONDS, 'work': {'poses': 7}}), flush=True)\n"
    )
    monkeypatch.setattr(against, "_CASES", cases)
    return Checkout(tmp_path / "old"), Checkout(tmp_path / "new")


def test_each_checkout_works_with_its_own_library(toys: tuple[Checkout, Checkout]) -> None:
    result = measure_checkouts(*toys, ["edges", "one arm"], rounds=2)
    assert [result["cases"][case]["ratio"] for case in ("edges", "one arm")] == [3.0, 3.0]
    assert result["passed"] and result["rounds"] == 2
    back = measure_checkouts(toys[1], toys[0], ["edges"], rounds=1)
    assert not back["passed"] and back["requirements"][0]["at_least"] == NO_SLOWER


def test_a_failing_case_is_reported_with_its_last_line(toys: tuple[Checkout, Checkout]) -> None:
    with pytest.raises(AgainstFailed, match="lockstep in .*: this checkout has none"):
        measure_checkouts(*toys, ["lockstep"], rounds=1)


def test_a_library_from_another_folder_is_refused(toys: tuple[Checkout, Checkout]) -> None:
    (toys[0].folder / "mobee" / "__init__.py").unlink()
    (toys[0].folder / "mobee").rmdir()
    with pytest.raises(AgainstFailed, match="library was taken from|No module named"):
        measure_checkouts(*toys, ["edges"], rounds=1)


def test_the_folder_above_a_checkout_is_refused(toys: tuple[Checkout, Checkout], monkeypatch: pytest.MonkeyPatch) -> None:
    """An installed MoBeE can lie below it; here the path of Python's modules stands for the installation."""
    start = subprocess.Popen
    environment = {"PYTHONPATH": str(toys[0].folder)}
    monkeypatch.setattr(subprocess, "Popen", lambda argv, **given: start(argv, **given | {"env": given["env"] | environment}))
    with pytest.raises(AgainstFailed, match=r"library was taken from .*old/mobee/__init__\.py, not from"):
        measure_checkouts(Checkout(toys[0].folder.parent), toys[0], ["edges"], rounds=1)


def test_a_commit_is_checked_out_temporarily_and_a_folder_is_used_as_it_is(tmp_path: Path) -> None:
    with checkout(str(tmp_path)) as found:
        assert found == Checkout(tmp_path.resolve(), sys.executable)
    if subprocess.run(["git", "-C", str(REPOSITORY), "rev-parse", "HEAD"], capture_output=True, check=False).returncode:
        pytest.skip("not a clone")
    with checkout("HEAD") as found:
        assert (found.folder / "mobee" / "__init__.py").exists()
    assert not found.folder.exists()


def test_a_commit_whose_core_cannot_be_built_is_refused_with_the_reason(tmp_path: Path) -> None:
    build_core(Checkout(tmp_path))  # a commit without a core
    (tmp_path / "core").mkdir()
    (tmp_path / "core" / "build.py").write_text("raise SystemExit('no compiler')\n")
    with pytest.raises(AgainstFailed, match="core/build.py in .*: no compiler"):
        build_core(Checkout(tmp_path))
