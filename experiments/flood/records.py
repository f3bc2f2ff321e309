"""What is kept of a flood."""

from __future__ import annotations

from pathlib import Path
from typing import TypedDict

from experiments.kit.records import read_records


class Record(TypedDict):
    """What happened while there were so many objects."""

    robot: str
    objects: int
    edits: int  # 0: the world stood still
    seconds: float
    evaluations: int


COLUMNS = tuple(Record.__annotations__)


def read_flood(path: Path) -> list[Record]:
    """The records of a run so far."""
    return [
        Record(
            robot=row["robot"],
            objects=int(row["objects"]),
            edits=int(row["edits"]),
            seconds=float(row["seconds"]),
            evaluations=int(row["evaluations"]),
        )
        for row in read_records(path, COLUMNS)
    ]
