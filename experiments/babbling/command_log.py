"""What was commanded, and how it ended: a line of JSON a command."""

from __future__ import annotations

from pathlib import Path
from typing import Literal, TextIO

import msgspec
from msgspec import Struct

COMMANDS = "commands.jsonl"
Ending = Literal["over", "settled", "timeout", "refused"]  # over: its time is; refused: what guards the robot ended it


class Commanded(Struct, frozen=True, forbid_unknown_fields=True):
    """A posture that was commanded to all parts at once."""

    begin: int  # tick
    end: int  # tick at which the robot is judged
    target: list[float]  # rad, all motors
    endings: dict[str, Ending]  # by part


class CommandLog:
    """Every command is in the file when `note` returns."""

    def __init__(self, path: Path) -> None:
        path.parent.mkdir(parents=True, exist_ok=True)
        self._file: TextIO = path.open("w", buffering=1)

    def note(self, commanded: Commanded) -> None:
        """A command has ended."""
        self._file.write(msgspec.json.encode(commanded).decode() + "\n")


def read_commands(path: Path) -> list[Commanded]:
    """All commands that have ended; a last line that a kill has cut is dropped."""
    *whole, _ = path.read_text().split("\n")
    return [msgspec.json.decode(line, type=Commanded) for line in whole]
