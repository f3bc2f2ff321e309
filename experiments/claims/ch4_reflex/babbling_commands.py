"""Commands of `babbling`: random postures of 23 motors, position moves to them, and the log of how they ended."""

from __future__ import annotations

from pathlib import Path
from typing import Literal, TextIO

import msgspec
import numpy as np
from msgspec import Struct

from mobee.arrays import Array
from mobee.robot.robot import Robot

ROBOT = "icub"
HANDS = ("hand", "thumb", "index", "middle", "pinky")  # in the names of the motors that are left alone
COUNT = 23  # thesis 4.1.1: "all joints on the iCub upper-body except those in the hands"
PEAK = 1.875  # peak over mean speed of a minimum-jerk motion
COMMANDS = "commands.jsonl"
Ending = Literal["over", "settled", "timeout", "refused"]  # over: its time is over; refused: the safety layer ended it


def moved_motors(robot: Robot) -> Array:
    """Indices of the 23 motors: torso 3, head with eyes 6, and 7 of each arm."""
    return np.array([i for i, name in enumerate(robot.motors) if not any(word in name for word in HANDS)])


class Targets:
    """Random postures, the same sequence for the same seed: uniform in the whole ranges of the 23 motors; hands stay at home."""

    def __init__(self, robot: Robot, seed: int) -> None:
        self._rng = np.random.default_rng([seed, 0xBABB1E])
        self._moved = moved_motors(robot)
        self._home, self._limits = robot.home, robot.limits[self._moved]

    def next(self) -> Array:
        """A posture of the whole robot, (n,) rad."""
        q = self._home.copy()
        q[self._moved] = self._rng.uniform(self._limits[:, 0], self._limits[:, 1])
        return q


class PositionMove:
    """From rest to rest; arrays (n,) rad."""

    def __init__(self, start: Array, target: Array, speed: Array) -> None:
        """`speed` (n,) rad/s: the peak that no motor exceeds."""
        self._start, self._distance = start, target - start
        self._durations = PEAK * np.abs(self._distance) / speed
        self.duration = float(self._durations.max())  # s

    def at(self, t: float) -> Array:
        """The reference position t [s] after the start."""
        share = np.divide(t, self._durations, out=np.ones_like(self._durations), where=self._durations > 0.0).clip(0.0, 1.0)
        smooth = share**3 * (10.0 - 15.0 * share + 6.0 * share**2)
        position: Array = self._start + smooth * self._distance
        return position


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
        """Append a command that has ended."""
        self._file.write(msgspec.json.encode(commanded).decode() + "\n")


def read_commands(path: Path) -> list[Commanded]:
    """All commands that have ended; a last line that a kill has cut is dropped."""
    *whole, _ = path.read_text().split("\n")
    return [msgspec.json.decode(line, type=Commanded) for line in whole]
