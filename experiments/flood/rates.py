"""Rates from the records of a flood."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from experiments.flood.records import Record

NUMBERS = (0, 1, 2, 5, 10, 20, 50, 100, 200, 500, 1000)  # of objects, at which rates are told
NEAR = 0.1  # records of so much more or fewer objects count as well: a flood lasts some 20 ms at a number


def rates(records: Iterable[Record]) -> Iterator[tuple[int, int]]:
    """Evaluations a second near each of NUMBERS that was reached."""
    known = list(records)
    for number in NUMBERS:
        near = [r for r in known if abs(r["objects"] - number) <= NEAR * number]
        if any(r["objects"] == number for r in near):
            yield number, round(sum(r["evaluations"] for r in near) / sum(r["seconds"] for r in near))


def binned(records: Iterable[Record], seconds: float) -> Iterator[tuple[float, float]]:
    """Mean number of objects and evaluations a second of consecutive records that last at least `seconds` together."""
    group: list[Record] = []
    for record in sorted(records, key=lambda r: r["objects"]):
        group.append(record)
        length = sum(r["seconds"] for r in group)
        if length >= seconds:
            yield sum(r["objects"] for r in group) / len(group), sum(r["evaluations"] for r in group) / length
            group = []
