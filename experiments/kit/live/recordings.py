# SPDX-License-Identifier: Apache-2.0
"""Reads what robot_sim, the robot simulator, recorded: joint positions of all ticks, and contacts of links with links or obstacles."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np
from msgspec import Struct

from experiments.kit.records import read_records
from mobee.arrays import Array
from mobee.robot.robot import Robot

POSITIONS, CONTACTS = "q.f64", "contacts.csv"  # as services.robot_sim.watch writes them
MIN_GAP = 0.2  # s without contact of a pair after which its next contact is a new event
COLUMNS = ("k", "pair", "depth")


class Touch(Struct, frozen=True):
    """A contact event: the time during which two shapes touched, with short interruptions.

    `pair`: names of the shapes.  `begin`, `end`: first and last tick.  `depth`: largest depth, m.
    """

    pair: str
    begin: int  # tick
    end: int  # tick
    depth: float  # m, at its deepest


def read_positions(folder: Path, robot: Robot) -> Array:
    """Read the recorded joint positions at the ends of all ticks, (T, n) rad, from the folder of a recording; row 0 is tick 1."""
    q: Array = np.fromfile(folder / POSITIONS).reshape(-1, len(robot.motors))
    return q


def read_touches(path: Path, dt: float) -> list[Touch]:
    """Read the contact events from the file contacts.csv of a recording, in order of their beginning; `dt`: duration of a tick [s]."""
    rows = ((int(row["k"]), row["pair"], float(row["depth"])) for row in read_records(path, COLUMNS))
    return touches(rows, round(MIN_GAP / dt))


def touches(rows: Iterable[tuple[int, str, float]], gap: int) -> list[Touch]:
    """Group contacts of single ticks into events, and return the events in order of their beginning.

    `rows`: tick, pair of shapes and depth [m] of each contact, in order of the ticks.  `gap`: number of ticks; a contact that comes more
    than `gap` ticks after the last contact of the same pair begins a new event.
    """
    open_: dict[str, Touch] = {}
    found: list[Touch] = []
    for k, pair, depth in rows:
        current = open_.get(pair)
        if current is not None and k - current.end > gap:
            found.append(open_.pop(pair))
            current = None
        open_[pair] = Touch(pair, k, k, depth) if current is None else Touch(pair, current.begin, k, max(current.depth, depth))
    return sorted([*found, *open_.values()], key=lambda touch: (touch.begin, touch.pair))
