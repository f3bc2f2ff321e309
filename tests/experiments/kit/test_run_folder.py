# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import json

import pytest

import mobee
from experiments.kit.run_folder import given_run, locked, new_run, newest_run, options_of


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
