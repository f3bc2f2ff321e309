"""Solid contacts as the simulator saw them: from ticks to events, and how deep they were."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from msgspec import Struct

from experiments.kit.records import read_records

APART = 0.2  # s for which a pair must be apart, so that its next contact is another event
COLUMNS = ("k", "pair", "depth")
EDGES = (0.1, 0.2, 0.5, 1.0, 2.0)  # mm, of the depth histogram


class Touch(Struct, frozen=True):
    """One event: a pair came into contact, and apart again."""

    pair: str
    begin: int  # tick
    end: int  # tick
    depth: float  # m, at its deepest


def read_touches(path: Path, dt: float) -> list[Touch]:
    """The events of a record, in order of their beginning; `dt` s a tick."""
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


def depth_histogram(events: Iterable[Touch]) -> dict[str, int]:
    """How many events were how deep, by range in mm."""
    depths = [1e3 * event.depth for event in events]
    bounds = (0.0, *EDGES, float("inf"))
    labels = [f"<{EDGES[0]:g}", *(f"{low:g}-{high:g}" for low, high in zip(EDGES, EDGES[1:], strict=False)), f">{EDGES[-1]:g}"]
    return {label: sum(low <= depth < high for depth in depths) for label, low, high in zip(labels, bounds[:-1], bounds[1:], strict=True)}
