# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import argparse
import io
import os
import signal
import subprocess
import sys
import time
import zipfile
from pathlib import Path

import numpy as np
import pytest

from experiments.kit.cells import Cell, load_cells
from experiments.kit.sweep import CellsFailed, Condition, Sweep, TimeLeft, grouped, grouped_by, run_cells, runs_by
from mobee.errors import InvalidValue
from mobee.roadmap.ompl import OmplMissing
from tests.experiments.finished_cells import finished
from tests.experiments.kit.toy_sweep import cells, forgetful, options, signals_of_a_child, useless, work


def conditions(arguments):
    return [Condition("walk", {"how": "walk"}, 8.0, seeds=(9001,)), Condition("run", {"how": "run", "where": "here"})]


def trial(settings, seed):
    return {"seed": seed}


SWEEP = Sweep(conditions, trial, findings=lambda found: {"cells": len(found)}, plot=lambda found: None)


def arguments(*given: str) -> argparse.Namespace:
    parser = argparse.ArgumentParser()
    SWEEP.add_arguments(parser)
    return argparse.Namespace(seed=3, **vars(parser.parse_args(given)))


def test_a_condition_may_have_seeds_of_its_own():
    cells = SWEEP.cells(arguments("--seeds", "2"))
    assert [(cell.name, cell.seed, cell.cost) for cell in cells] == [("walk-s9001", 9001, 8.0), ("run-s3", 3, 1.0), ("run-s4", 4, 1.0)]


def test_a_sweep_runs_all_its_cells_and_refuses_to_draw_none(tmp_path):
    assert SWEEP.run(arguments("--seeds", "2", "--jobs", "1"), tmp_path) == {"cells": 3}
    with pytest.raises(InvalidValue, match="no finished cells"):
        SWEEP.figure(tmp_path / "empty")


def test_cells_are_grouped_by_one_setting_or_by_several_in_the_order_of_their_seeds():
    cells = [Cell(f"{a}-{b}-s{seed}", seed, {"a": a, "b": b}) for a in (1, 2) for b in (3, 4) for seed in (10, 9)]
    found = finished(lambda cell: {"seed": cell.seed}, cells)
    assert grouped(found, "a", (2, 1, 0))[2] == [{"seed": 9}, {"seed": 9}, {"seed": 10}, {"seed": 10}]
    everything = {(a, b): [9, 10] for a in (1, 2) for b in (3, 4)}
    assert runs_by(found, lambda result: result.cell.seed, "a", "b") == everything
    assert grouped_by(found, "a", "b") == {key: [{"seed": seed} for seed in seeds] for key, seeds in everything.items()}


def test_a_missing_package_is_named_before_anything_is_begun(tmp_path):
    def missing():
        raise OmplMissing("not installed")

    sweep = Sweep(conditions, trial, findings=dict, plot=dict, require=missing)
    with pytest.raises(OmplMissing, match="not installed"):
        sweep.run(arguments("--seeds", "1"), tmp_path)
    assert not list(tmp_path.iterdir())


ROOT = Path(__file__).parents[3]


def inline(folder: Path):
    return options(str(folder), "--jobs", "1")


@pytest.mark.parametrize("jobs", ["1", "2"])
def test_every_cell_is_run_and_read_back(tmp_path, jobs):
    run_cells(work, cells(3), tmp_path, options(str(tmp_path), "--jobs", jobs))
    found = load_cells(tmp_path)
    assert list(found) == ["toy-s0", "toy-s1", "toy-s2"]
    assert found["toy-s2"].cell == Cell("toy-s2", 2, {})
    values = found["toy-s2"].values
    assert values["square"] == 4 and values["nested"] == {"pi": 3.5}
    assert np.array_equal(values["row"], [0, 1])


def test_a_process_that_a_cell_starts_can_be_interrupted(tmp_path):
    run_cells(signals_of_a_child, cells(2), tmp_path, options(str(tmp_path), "--jobs", "2"))
    assert [one.values["said"] for one in load_cells(tmp_path).values()] == ["True 0", "True 0"]


def test_finished_cells_are_not_repeated(tmp_path):
    log = tmp_path / "log"
    for count in (2, 4):
        run_cells(work, cells(count, log=str(log)), tmp_path, inline(tmp_path))
    assert [line.split()[0] for line in log.read_text().splitlines()] == ["toy-s0", "toy-s1", "toy-s2", "toy-s3"]


def test_the_costly_cells_come_first(tmp_path):
    log = tmp_path / "log"
    mixed = [Cell(f"toy-s{seed}", seed, {"log": str(log)}, cost) for seed, cost in enumerate((1.0, 5.0, 2.0))]
    run_cells(work, mixed, tmp_path, inline(tmp_path))
    assert [line.split()[0] for line in log.read_text().splitlines()] == ["toy-s1", "toy-s2", "toy-s0"]


@pytest.mark.parametrize("jobs", ["1", "2"])
def test_a_cell_that_fails_is_named_and_the_others_are_finished(tmp_path, jobs):
    with pytest.raises(CellsFailed, match=r"1 of 4 cells failed[\s\S]*toy-s1: ValueError: the toy is broken"):
        run_cells(work, cells(4, fails=1), tmp_path, options(str(tmp_path), "--jobs", jobs))
    assert set(load_cells(tmp_path)) == {"toy-s0", "toy-s2", "toy-s3"}
    assert "the toy is broken" in (tmp_path / "cells" / "toy-s1.failed.txt").read_text()


def test_a_cell_whose_process_ends_is_named_and_the_others_are_finished(tmp_path):
    with pytest.raises(CellsFailed, match=r"toy-s0: its process died: killed by signal 9"):
        run_cells(work, cells(4, dies=0), tmp_path, options(str(tmp_path), "--jobs", "2"))
    assert set(load_cells(tmp_path)) == {"toy-s1", "toy-s2", "toy-s3"}


@pytest.mark.parametrize("jobs", ["1", "2"])
@pytest.mark.parametrize(("trial", "says"), [(useless, "no JSON value"), (forgetful, "returned None: return a dict of values by name")])
def test_values_that_cannot_be_kept_fail_their_cell(tmp_path, jobs, trial, says):
    with pytest.raises(CellsFailed, match=f"2 of 2 cells failed[\\s\\S]*{says}"):
        run_cells(trial, cells(2), tmp_path, options(str(tmp_path), "--jobs", jobs))
    assert not load_cells(tmp_path)


def test_other_settings_under_a_finished_name_are_refused(tmp_path):
    run_cells(work, cells(1, levels=(0.2, 0.4)), tmp_path, inline(tmp_path))
    run_cells(work, cells(1, levels=(0.2, 0.4)), tmp_path, inline(tmp_path))
    with pytest.raises(InvalidValue, match="toy-s0 with other settings"):
        run_cells(work, cells(1, levels=(0.2, 0.5)), tmp_path, inline(tmp_path))


def test_two_cells_of_one_name_are_refused(tmp_path):
    with pytest.raises(InvalidValue, match="several cells are named 'toy-s0'"):
        run_cells(work, [*cells(1), *cells(1)], tmp_path, inline(tmp_path))


@pytest.mark.parametrize("name", ["", "../up", "a/b", ".hidden", "with space"])
def test_a_name_that_is_not_a_file_name_is_refused(name):
    with pytest.raises(InvalidValue, match="a name has"):
        Cell(name, 0)


def test_a_half_written_file_is_not_a_cell(tmp_path):
    run_cells(work, cells(1), tmp_path, inline(tmp_path))
    (tmp_path / "cells" / "toy-s1.unfinished").write_bytes((tmp_path / "cells" / "toy-s0.npz").read_bytes()[:100])
    assert set(load_cells(tmp_path)) == {"toy-s0"}


def damaged_archive(content: bytes) -> bytes:
    """Overwrite the data of all arrays, but neither the headers nor the table of contents."""
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        entries = archive.infolist()
    damaged = bytearray(content)
    for entry in entries:
        begin = entry.header_offset + 30 + len(entry.filename) + 20  # np.savez writes 20 bytes of extra data
        damaged[begin : begin + entry.compress_size] = b"\xff" * entry.compress_size
    return bytes(damaged)


def without_a_seed(content: bytes) -> bytes:
    file = io.BytesIO()
    np.savez(file, record=np.frombuffer(b'{"cell": {"name": "toy-s0"}, "seconds": 1.0, "values": {}}', dtype=np.uint8))
    return file.getvalue()


DAMAGES = [lambda content: b"", lambda content: content[:100], damaged_archive, without_a_seed]


@pytest.mark.parametrize("damage", DAMAGES)
def test_a_damaged_file_is_named(tmp_path, damage):
    run_cells(work, cells(1), tmp_path, inline(tmp_path))
    path = tmp_path / "cells" / "toy-s0.npz"
    path.write_bytes(damage(path.read_bytes()))
    with pytest.raises(InvalidValue, match=r"toy-s0\.npz is not a finished cell"):
        load_cells(tmp_path)


def test_a_copied_file_is_not_a_second_cell(tmp_path):
    run_cells(work, cells(1), tmp_path, inline(tmp_path))
    path = tmp_path / "cells" / "toy-s0.npz"
    path.with_name("toy-s0 (copy).npz").write_bytes(path.read_bytes())
    with pytest.raises(InvalidValue, match=r"\(copy\)\.npz is not a finished cell \(it holds the cell toy-s0\)"):
        load_cells(tmp_path)


def sweep(folder: Path, seconds: float, *more: str) -> subprocess.Popen[str]:
    command = [sys.executable, "-m", "tests.experiments.kit.toy_sweep", str(folder), "--seeds", "6", "--jobs", "2", *more]
    return subprocess.Popen(
        [*command, "--seconds", str(seconds)], cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True
    )


@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGTERM, signal.SIGINT])
def test_a_killed_sweep_continues_after_its_finished_cells(tmp_path, how):
    process = sweep(tmp_path, 0.3)
    wait_until(lambda: len(list(tmp_path.glob("cells/*.npz"))) >= 2)
    os.killpg(process.pid, how) if how == signal.SIGINT else process.send_signal(how)  # a terminal's Ctrl-C goes to the whole group
    out, err = process.communicate(timeout=20)  # its workers hold the pipe: this returns when they are gone too
    assert process.returncode == -how or how == signal.SIGINT
    finished = {path.name: path.stat().st_mtime_ns for path in tmp_path.glob("cells/*.npz")}
    assert 2 <= len(finished) < 6
    done_before = (tmp_path / "log").read_text().split()[::2]

    out, err = sweep(tmp_path, 0.3).communicate(timeout=60) if how == signal.SIGKILL else resume_here(tmp_path)
    assert (out, err) == ("", "")  # nothing is drawn in a pipe
    assert len(load_cells(tmp_path)) == 6
    done_after = (tmp_path / "log").read_text().split()[::2][len(done_before) :]
    assert not {f"{name}.npz" for name in done_after} & set(finished)
    assert all((tmp_path / "cells" / name).stat().st_mtime_ns == when for name, when in finished.items())


@pytest.mark.parametrize(
    ("how", "group"), [(signal.SIGKILL, False), (signal.SIGTERM, False), (signal.SIGTERM, True), (signal.SIGINT, True)]
)
def test_the_cells_of_a_killed_sweep_give_back_what_they_hold(tmp_path, how, group):
    """As a cell that has started a live system.  If the whole group is killed, workers get a second signal when their parent ends."""
    process = sweep(tmp_path, 0.0, "--holds", str(tmp_path / "held"))
    wait_until(lambda: len(list(tmp_path.glob("held-*"))) == 2)
    os.killpg(process.pid, how) if group else process.send_signal(how)
    process.communicate(timeout=30)
    assert not list(tmp_path.glob("held-*"))


def resume_here(folder: Path) -> tuple[str, str]:
    run_cells(work, cells(6, seconds=0.3, log=str(folder / "log")), folder, inline(folder))
    return "", ""


def wait_until(holds, timeout: float = 30.0) -> None:
    end = time.monotonic() + timeout
    while not holds():
        assert time.monotonic() < end
        time.sleep(0.02)


def test_the_remaining_time_follows_the_costs_of_finished_cells():
    time_left = TimeLeft([1.0, 1.0, 4.0, 4.0], [1.0, 4.0, 4.0], start=100.0)
    assert time_left.fraction == pytest.approx(0.1)
    time_left.finished(4.0, 140.0)
    assert time_left.fraction == 0.5 and time_left.seconds == 50.0
    assert str(time_left) == "50 s left"


def test_a_sweep_without_work_is_over():
    assert TimeLeft([1.0], [], 0.0).fraction == 1.0
