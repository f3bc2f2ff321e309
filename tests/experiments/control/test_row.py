from __future__ import annotations

from dataclasses import dataclass

from experiments.control.row import Row
from experiments.kit.records import Records, read_records


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
