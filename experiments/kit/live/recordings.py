"""Recordings of robot_sim: the positions of all ticks, and the solid contacts as events with their depths."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np
from msgspec import Struct

from experiments.kit.records import read_records
from mobee.arrays import Array
from mobee.robot.robot import Robot

POSITIONS, CONTACTS = "q.f64", "contacts.csv"  # as services.robot_sim.watch writes them
APART = 0.2  # s for which a pair must be apart, so that its next contact is another event
COLUMNS = ("k", "pair", "depth")


class Touch(Struct, frozen=True):
    """One event: a pair came into contact, and apart again."""

    pair: str
    begin: int  # tick
    end: int  # tick
    depth: float  # m, at its deepest


def read_positions(folder: Path, robot: Robot) -> Array:
    """The joints at the ends of the ticks (T, n) rad; the first is tick 1."""
    q: Array = np.fromfile(folder / POSITIONS).reshape(-1, len(robot.motors))
    return q


def read_touches(path: Path, dt: float) -> list[Touch]:
    """The events of a record of contacts, in order of their beginning; `dt` s a tick."""
    rows = ((int(row["k"]), row["pair"], float(row["depth"])) for row in read_records(path, COLUMNS))
    return touches(rows, round(APART / dt))


def touches(rows: Iterable[tuple[int, str, float]], apart: int) -> list[Touch]:
    """Events of (tick, pair, depth [m]) rows in order of the ticks; `apart`: ticks that separate two events of a pair."""
    open_: dict[str, Touch] = {}
    found: list[Touch] = []
    for k, pair, depth in rows:
        current = open_.get(pair)
        if current is not None and k - current.end > apart:
            found.append(open_.pop(pair))
            current = None
        open_[pair] = Touch(pair, k, k, depth) if current is None else Touch(pair, current.begin, k, max(current.depth, depth))
    return sorted([*found, *open_.values()], key=lambda touch: (touch.begin, touch.pair))
