# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from dataclasses import dataclass

import pytest

from experiments.kit.run_folder import Records, Row, read_records
from mobee.errors import InvalidValue

COLUMNS = ("robot", "objects")


def test_records_are_on_disk_at_once_and_appended_to_old_ones(tmp_path):
    path = tmp_path / "records.csv"
    assert read_records(path, COLUMNS) == []
    for objects in (1, 2):
        with Records(path, COLUMNS) as records:
            records.append({"robot": "icub", "objects": objects})
            assert read_records(path, COLUMNS)[-1] == {"robot": "icub", "objects": str(objects)}
    assert path.read_text().splitlines() == ["robot,objects", "icub,1", "icub,2"]


@pytest.mark.parametrize("cut", range(1, 7))
def test_a_record_that_a_kill_has_cut_is_dropped_and_the_next_is_whole(tmp_path, cut):
    path = tmp_path / "records.csv"
    with Records(path, COLUMNS) as records:
        records.append({"robot": "icub", "objects": 10})
        records.append({"robot": "icub", "objects": 20})
    path.write_bytes(path.read_bytes()[:-cut])
    assert read_records(path, COLUMNS) == [{"robot": "icub", "objects": "10"}]
    with Records(path, COLUMNS) as records:
        records.append({"robot": "icub", "objects": 30})
    assert [record["objects"] for record in read_records(path, COLUMNS)] == ["10", "30"]


def test_records_with_any_characters_stay_whole(tmp_path):
    path, texts = tmp_path / "records.csv", ["größer als 5 °", "two\nlines", '"quoted", and more']
    for text in texts:
        with Records(path, COLUMNS) as records:
            records.append({"robot": "é", "objects": text})
    assert read_records(path, COLUMNS) == [{"robot": "é", "objects": text} for text in texts]


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (b"robot,objects\nicub,10\ngarbage\nicub,30\n", r"records\.csv, line 3: no record with the columns robot, objects"),
        (b"robot,objects\nicub,10,20\n", r"records\.csv, line 2: no record"),
        (b"robot,things\nicub,10\n", "has no column objects: it is damaged, or of another version"),
        (b"robot,objects\n\xff\xfe,10\n", "is damaged"),
    ],
)
def test_a_damaged_file_of_records_is_named(tmp_path, content, says):
    path = tmp_path / "records.csv"
    path.write_bytes(content)
    with pytest.raises(InvalidValue, match=says):
        read_records(path, COLUMNS)


@dataclass(frozen=True, slots=True)
class Sample(Row):
    name: str
    depth: float
    is_good: bool


def test_rows_come_back_from_their_file(tmp_path) -> None:
    rows = [Sample("a, b", 0.125, True), Sample("c", -3.0, False)]
    with Records(tmp_path / "rows.csv", Sample.columns()) as records:
        for row in rows:
            records.append(row.record())
    assert [Sample.of_record(row) for row in read_records(tmp_path / "rows.csv", Sample.columns())] == rows
