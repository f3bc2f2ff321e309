# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import errno
import json
from pathlib import Path

import pytest

import mobee
from experiments.kit import run_folder
from experiments.kit.run_folder import given_run, keep_options, locked, new_run, newest_run, options_of, read, write


def test_a_run_says_what_was_asked_for_and_with_what(tmp_path):
    folder = new_run(tmp_path / "runs", "model-throughput", {"objects": 3, "seed": 7})
    assert options_of(folder, "model-throughput") == {"objects": 3, "seed": 7}
    versions = json.loads((folder / "versions.json").read_text())
    assert {"mobee", "numpy"} <= set(versions["packages"])
    assert {"python", "platform", "commit", "sources", "begun"} <= set(versions)


def test_two_runs_in_one_second_get_two_folders_and_the_newest_is_found(tmp_path):
    folders = [new_run(tmp_path, "model-throughput", {}) for _ in range(12)]
    assert len(set(folders)) == 12
    new_run(tmp_path, "floods", {})
    assert newest_run(tmp_path, "model-throughput") == folders[-1]


def test_a_folder_that_is_no_run_is_refused(tmp_path):
    with pytest.raises(mobee.InvalidValue, match="no run of 'model-throughput'.*mobee experiment run model-throughput"):
        newest_run(tmp_path, "model-throughput")
    with pytest.raises(mobee.InvalidValue, match="not the folder of a run"):
        options_of(tmp_path, "model-throughput")
    with pytest.raises(mobee.InvalidValue, match="run of 'model-throughput', not of 'press'"):
        options_of(new_run(tmp_path, "model-throughput", {}), "press")


def test_a_folder_that_is_not_there_is_answered_with_the_newest(tmp_path):
    with pytest.raises(mobee.InvalidValue, match="nope: there is no such folder; no run of 'model-throughput'"):
        given_run(tmp_path / "nope", tmp_path, "model-throughput")
    folder = new_run(tmp_path, "model-throughput", {})
    assert given_run(folder, tmp_path, "model-throughput") == folder
    with pytest.raises(mobee.InvalidValue, match=f"there is no such folder. The newest run of 'model-throughput' is {folder}"):
        given_run(tmp_path / "nope", tmp_path, "model-throughput")


def test_a_run_belongs_to_one_process_at_a_time(tmp_path):
    folder = new_run(tmp_path, "model-throughput", {})
    with locked(folder), pytest.raises(mobee.InvalidValue, match="another process works on this run. Wait until it ends"), locked(folder):
        pytest.fail("two hold one run")
    with locked(folder):
        assert options_of(folder, "model-throughput") == {}


def test_a_run_is_found_under_the_former_name_of_its_experiment(tmp_path):
    folder = new_run(tmp_path, "flood", {"seed": 7})
    assert newest_run(tmp_path, "model-throughput") == newest_run(tmp_path, "flood") == folder
    assert options_of(folder, "model-throughput") == {"seed": 7}


@pytest.fixture
def full_disk(monkeypatch):
    """Let nothing be written, as on a full disk: a file that is opened for writing becomes empty."""
    opened = Path.open

    def refuse(text):
        raise OSError(errno.ENOSPC, "No space left on device")

    def on_full_disk(path, mode="r", *given, **more):
        file = opened(path, mode, *given, **more)
        if "r" not in mode or "+" in mode:
            file.write = refuse
        return file

    monkeypatch.setattr(Path, "open", on_full_disk)
    monkeypatch.setattr(Path, "write_text", lambda path, text: on_full_disk(path, "w").write(text))


def test_a_full_disk_leaves_the_options_of_a_run_as_they_are(tmp_path, request):
    folder = new_run(tmp_path, "model-throughput", {"objects": 3})
    request.getfixturevalue("full_disk")
    with pytest.raises(OSError, match="No space left"):
        keep_options(folder, "model-throughput", {"objects": 4})
    with pytest.raises(OSError, match="No space left"):
        write(folder / "versions.json", {})
    assert options_of(folder, "model-throughput") == {"objects": 3}
    assert read(folder / "versions.json")["packages"]


@pytest.mark.parametrize("error", [OSError(errno.ENOSPC, "No space left on device"), KeyboardInterrupt()])
def test_a_run_whose_options_cannot_be_written_leaves_no_folder(tmp_path, monkeypatch, error):
    def fail():
        raise error

    monkeypatch.setattr(run_folder, "_versions", fail)
    with pytest.raises(type(error)):
        new_run(tmp_path, "model-throughput", {})
    assert not list(tmp_path.iterdir())


def test_new_options_of_a_run_remove_the_results_of_the_former_ones(tmp_path):
    folder = new_run(tmp_path, "model-throughput", {"objects": 3, "robots": ["katana"]})
    write(folder / "results.json", {"complete": True})
    keep_options(folder, "model-throughput", {"objects": 3, "robots": ["katana"]})
    assert read(folder / "results.json") == {"complete": True}
    keep_options(folder, "model-throughput", {"objects": 3, "robots": []})
    assert not (folder / "results.json").exists() and options_of(folder, "model-throughput") == {"objects": 3, "robots": []}
