# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest

from experiments.kit.cells import Cell, write_cell
from mobee.learning.reaching.reaches import REACH
from mobee.learning.reaching.store import ReachStore, Step
from mobee.reach import ReachTarget
from mobee.store import STORE, Transition, TransitionStore
from mobee_cli.__main__ import main

MADE = [Transition(n, n, n % 3, n + 1, 0.1 / n, n % 2 > 0, 4.0 + n, (0.25 * n, -1.0), ("table",) * (n % 2)) for n in range(1, 6)]
SEEN = np.array([[0, 1, 2], [2, 0, 0]], dtype=np.uint16)


@pytest.fixture
def run(tmp_path: Path) -> Path:
    """The store of two agents, and two cells of a sweep, one of which kept no transitions."""
    folder = tmp_path / "run"
    folder.mkdir()
    for agent in ("torso", "left_arm"):
        with TransitionStore(folder / STORE, agent) as store:
            store.bind({"seed": 3})
            for one in MADE:
                store.append(one)
    write_cell(folder, Cell("curious-s4", 4, {"explorer": "curious"}), {"seen": SEEN, "seen_left_arm": SEEN[:1]}, 1.0)
    write_cell(folder, Cell("summary", 0), {"tries": 3}, 1.0)
    return folder


def test_csv_has_every_transition_of_every_agent(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["export", str(run)]) == 0
    assert capsys.readouterr().out == f"{run / 'transitions.csv'}: 13 transitions\n"
    with (run / "transitions.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    arm = [row for row in rows if (row["source"], row["agent"]) == (STORE, "left_arm")]
    for row, one in zip(arm, MADE, strict=True):
        assert [int(row[name]) for name in ("n", "s", "a", "s_next")] == [one.n, one.s, one.a, one.s_next]
        assert (float(row["reward"]), float(row["duration"])) == (one.reward, one.duration)
        assert [json.loads(row[name]) for name in ("settled", "q", "touched")] == [one.settled, list(one.q), list(one.touched)]
        assert float(row["time"]) > 1e9
    cells = [(row["source"], row["agent"], row["n"], row["s"], row["a"], row["s_next"], row["reward"]) for row in rows[10:]]
    assert cells == [
        ("cells/curious-s4.npz", "", "1", "0", "1", "2", ""),
        ("cells/curious-s4.npz", "", "2", "2", "0", "0", ""),
        ("cells/curious-s4.npz", "left_arm", "1", "0", "1", "2", ""),
    ]


def test_a_run_of_several_experiments_is_one_table(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for name in ("coverage", "lattice"):
        write_cell(tmp_path / name, Cell("curious", 4), {"seen": SEEN}, 1.0)
    assert main(["export", str(tmp_path)]) == 0
    with (tmp_path / "transitions.csv").open(newline="") as file:
        sources = [row["source"] for row in csv.DictReader(file)]
    assert sources == ["coverage/cells/curious.npz"] * 2 + ["lattice/cells/curious.npz"] * 2


def test_parquet_has_the_same_with_types_and_settings(run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    parquet = pytest.importorskip("pyarrow.parquet")
    file = tmp_path / "all.parquet"
    assert main(["export", str(run), "--parquet", str(file), "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == {"file": str(file), "transitions": 13}
    rows = parquet.read_table(file).to_pylist()
    torso = [row for row in rows if row["agent"] == "torso"]
    for row, one in zip(torso, MADE, strict=True):
        names = ("n", "s", "a", "s_next", "reward", "settled", "duration")
        assert [row[name] for name in names] == [getattr(one, name) for name in names]
        assert (tuple(row["q"]), tuple(row["touched"])) == (one.q, one.touched)
    assert [row["reward"] for row in rows[10:]] == [None] * 3
    kept = json.loads(parquet.ParquetFile(file).metadata.metadata[b"mobee"])
    assert kept[0] == {"source": STORE, "agent": "left_arm", "settings": {"seed": 3}}
    assert kept[2]["settings"] == {"explorer": "curious", "seed": 4}


def test_a_file_that_cannot_be_exported_is_refused_in_one_line(run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "empty").mkdir()
    for words, code, says in (
        ([str(tmp_path / "nothing")], 2, "nothing: there is no such folder"),
        ([str(tmp_path / "empty")], 2, "empty: no transitions are kept there"),
        ([str(run), "--csv", str(tmp_path / "nothing" / "x.csv")], 3, "x.csv cannot be written: No such file or directory"),
    ):
        assert main(["export", *words]) == code
        error = capsys.readouterr().err
        assert says in error and error.count("\n") == 1


def test_a_failure_leaves_no_file_and_the_old_one_as_it_was(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["export", str(run)]) == 0
    before = (run / "transitions.csv").read_bytes()
    write_cell(run, Cell("wrong", 0), {"seen": np.zeros(5)}, 1.0)
    assert main(["export", str(run)]) == 2
    assert "seen of cells/wrong.npz is not an array of transitions" in capsys.readouterr().err
    assert (run / "transitions.csv").read_bytes() == before
    assert not list(run.glob("*.unfinished"))


def test_without_pyarrow_the_extra_is_named(run: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setitem(__import__("sys").modules, "pyarrow", None)
    assert main(["export", str(run), "--parquet"]) == 3
    assert 'pip install "mobee[parquet]"' in capsys.readouterr().err


def test_what_was_learned_of_reaching_is_a_table_of_its_own(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    target = ReachTarget(np.array([-0.25, 0.1, 0.05]))
    steps = [
        Step(1, 1, 0, 4, 2, 5, True, -10.0, 0.0, 0.0, False, 20.0, (0.5,), ("reach_target",)),
        Step(2, 1, 0, 5, REACH, 5, False, 0.5, 0.9, 0.01, True, 3.0, (0.25,)),
    ]
    with ReachStore(tmp_path / STORE, "torso") as store:
        for step in steps:
            store.append(step, [target])
    assert main(["export", str(tmp_path), "--reaches", "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == {"file": str(tmp_path / "reaches.csv"), "steps": 2}
    with (tmp_path / "reaches.csv").open(newline="") as file:
        moved, reached = csv.DictReader(file)
    assert [moved[name] for name in ("part", "x", "a", "failed", "reward", "touched")] == [
        "torso",
        "-0.25",
        "2",
        "true",
        "-10.0",
        '["reach_target"]',
    ]
    assert [reached[name] for name in ("source", "a", "reward", "expected", "missing")] == [STORE, "-1", "0.5", "0.9", "0.01"]


def test_a_run_without_reaches_has_no_table_of_them(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["export", str(run), "--reaches"]) == 2
    assert "no agent has learned to reach" in capsys.readouterr().err
    assert not (run / "reaches.csv").exists()


def test_a_table_never_replaces_the_data_it_is_made_of(run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    store = run / STORE
    (tmp_path / "named.db").write_bytes(store.read_bytes())
    before = store.read_bytes()
    for words in (
        [str(run), "--csv", str(store)],
        [str(store), "--csv", str(store)],
        [str(store), "--parquet", str(store)],
        [str(run), "--reaches", str(store)],
        [str(run), "--csv", str(run / "cells" / "curious-s4.npz")],
        [str(tmp_path / "named.db"), "--csv", str(tmp_path / "named.db")],
    ):
        assert main(["export", *words]) == 2
        assert "must not replace the data of a run" in capsys.readouterr().err
    assert store.read_bytes() == before == (tmp_path / "named.db").read_bytes()
