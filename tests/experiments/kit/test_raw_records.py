# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import json

import pytest

from experiments import claims_table
from experiments.kit import raw_records
from experiments.kit.cells import CELL_FILES, Cell, load_cells, write_cell
from experiments.kit.raw_records import TooLarge, keep_record, opened_record, record_path
from experiments.kit.run_folder import new_run
from experiments.kit.sweep import Sweep
from mobee.errors import InvalidValue


@pytest.fixture
def run(tmp_path, monkeypatch):
    monkeypatch.setattr(raw_records, "RECORDS", tmp_path / "records")
    folder = new_run(tmp_path / "runs", "reward-decay", {"seeds": 2})
    for seed in range(2):
        write_cell(folder, Cell(f"curious-s{seed}", seed, {"explorer": "curious"}), {"tries": seed}, 1.0)
    (folder / "figure.png").write_bytes(b"a picture")
    return folder


def test_a_record_holds_settings_commit_and_the_values_of_every_seed_and_is_the_same_when_written_again(run):
    path = keep_record("reward-decay", run, run / "versions.json", CELL_FILES)
    first = path.read_bytes()
    assert keep_record("reward-decay", run, run / "versions.json", CELL_FILES).read_bytes() == first
    with opened_record("reward-decay") as folder:
        assert [cell.values["tries"] for cell in load_cells(folder).values()] == [0, 1]
        assert json.loads((folder / "config.json").read_text())["options"] == {"seeds": 2}
        assert "commit" in json.loads((folder / "versions.json").read_text())
        assert not (folder / "figure.png").exists()
    assert not folder.exists()


def test_a_record_that_is_empty_too_large_absent_or_damaged_is_refused(run, monkeypatch):
    with pytest.raises(InvalidValue, match="has none of the files"):
        keep_record("reward-decay", run, run / "versions.json", ("*.sqlite",))
    with pytest.raises(InvalidValue, match="there is no record of 'reward-decay'"), opened_record("reward-decay"):
        pass
    monkeypatch.setattr(raw_records, "MAX_BYTES", 100)
    with pytest.raises(TooLarge, match="give its sweep a summary"):
        keep_record("reward-decay", run, run / "versions.json", CELL_FILES)
    assert not raw_records.RECORDS.exists()
    raw_records.RECORDS.mkdir()
    record_path("reward-decay").write_bytes(b"no archive")
    with pytest.raises(InvalidValue, match="is damaged"), opened_record("reward-decay"):
        pass


def test_the_table_follows_from_the_raw_records():
    assert claims_table.all_differences(claims_table.recorded()) == []


def test_all_raw_records_together_are_small_enough_for_the_repository():
    assert sum(path.stat().st_size for path in raw_records.all_records()) <= raw_records.MAX_ALL


def test_a_record_without_an_entry_in_the_table_is_a_difference(run):
    keep_record("reward-decay", run, run / "versions.json", CELL_FILES)
    assert claims_table.all_differences({}) == ["reward-decay.tar.xz: a raw record without an entry in the table"]


def test_the_record_of_a_sweep_with_a_summary_holds_the_reduced_cells_and_gives_the_same_results(run):
    def findings(found):
        return {name: one.values["twice"] for name, one in found.items()}

    def twice(values):
        return {"twice": 2 * values["tries"]}

    sweep = Sweep(lambda arguments: [], lambda settings, seed: {}, findings, lambda found: None, summary=twice)
    expected = {"curious-s0": 0, "curious-s1": 2}
    with sweep.recorded(run) as folder:
        keep_record("reward-decay", run, run / "versions.json", sweep.kept, folder=folder)
    with opened_record("reward-decay") as record:
        assert sweep.results(record) == sweep.results(run) == expected
        assert all("tries" not in cell.values for cell in load_cells(record).values())
