"""What a performer of a live experiment is given to do, and what it says of it: files in the folder of a launch."""

from __future__ import annotations

from pathlib import Path
from typing import TypeVar

import msgspec
from msgspec import Struct

T = TypeVar("T", bound=Struct)
JOB, DONE = "job.json", "done.jsonl"


def write_job(folder: Path, job: Struct) -> None:
    """Into a folder that it makes; what a launch that was broken off has left there goes."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / DONE).unlink(missing_ok=True)
    (folder / JOB).write_bytes(msgspec.json.encode(job))


def read_job(folder: Path, kind: type[T]) -> T:
    """What `write_job` wrote."""
    return msgspec.json.decode((folder / JOB).read_bytes(), type=kind)


def append_done(folder: Path, record: Struct) -> None:
    """It is in the file when this returns."""
    with (folder / DONE).open("ab") as file:
        file.write(msgspec.json.encode(record) + b"\n")


def read_done(folder: Path, kind: type[T]) -> list[T]:
    """All of a launch; none if there is no file."""
    path = folder / DONE
    return [msgspec.json.decode(line, type=kind) for line in path.read_bytes().splitlines()] if path.exists() else []
