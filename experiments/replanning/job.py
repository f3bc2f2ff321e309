"""What the performer is given to do, and what it says of it: files in the folder of a launch."""

from __future__ import annotations

from pathlib import Path

import msgspec
from msgspec import Struct

JOB, DONE = "job.json", "crossings.jsonl"


class Job(Struct, frozen=True):
    """Crossings to make: after how many seconds of each the ball turns solid."""

    after: list[float]


class Acted(Struct, frozen=True):
    """A motion; ticks are robot_sim's."""

    vertex: int  # to which it was sent
    asked: int  # tick at which it was asked for
    commanded: int  # tick in which a command that knows of it was first in force
    bump: int  # tick at which the model first said that the arm touches the ball, -1: never
    ended: int  # tick at which its end was known
    thinking: float  # s of processor time between the end of the motion before and the request


class Crossing(Struct, frozen=True):
    """From the right of the ball to its left."""

    solid: int  # tick at which the ball was made solid
    motions: list[Acted]


def write_job(folder: Path, job: Job) -> None:
    """Into a folder that it makes; what a launch that was broken off has left there goes."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / DONE).unlink(missing_ok=True)
    (folder / JOB).write_bytes(msgspec.json.encode(job))


def read_job(folder: Path) -> Job:
    """What `write_job` wrote."""
    return msgspec.json.decode((folder / JOB).read_bytes(), type=Job)


def append_crossing(folder: Path, crossing: Crossing) -> None:
    """It is in the file when this returns."""
    with (folder / DONE).open("ab") as file:
        file.write(msgspec.json.encode(crossing) + b"\n")


def read_crossings(folder: Path) -> list[Crossing]:
    """All of a launch; none if there is no file."""
    path = folder / DONE
    return [msgspec.json.decode(line, type=Crossing) for line in path.read_bytes().splitlines()] if path.exists() else []
