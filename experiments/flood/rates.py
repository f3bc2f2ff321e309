"""Rates from the records of a flood."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

from experiments.flood.records import Record

NUMBERS = (0, 1, 2, 5, 10, 20, 50, 100, 200, 500, 1000)  # of objects, at which rates are told
NEAR = 0.1  # records of so much more or fewer objects count as well: a flood lasts some 20 ms at a number
SHORTEST = 0.2  # s; in less the threads take turns so seldom that a rate is chance


def rates(records: Iterable[Record]) -> Iterator[tuple[int, int]]:
    """Evaluations a second near each of NUMBERS that was reached; none where all records together are shorter than SHORTEST.

    Where the records near a number are too short, the next nearest are pooled with them; the number told is then their mean.
    """
    known = list(records)
    for number in NUMBERS:
        if not any(r["objects"] == number for r in known):
            continue
        nearest = sorted(known, key=lambda r: abs(r["objects"] - number))
        count = sum(abs(r["objects"] - number) <= NEAR * number for r in nearest)
        while count < len(nearest) and _seconds(nearest[:count]) < SHORTEST:
            count += 1
        pool = nearest[:count]
        if _seconds(pool) >= SHORTEST:
            objects, rate = _point(pool)
            yield number if abs(objects - number) <= NEAR * number else round(objects), round(rate)


def binned(records: Iterable[Record], seconds: float) -> Iterator[tuple[float, float]]:
    """Mean number of objects and evaluations a second of consecutive records that last at least `seconds` together.

    What is left over at the end is dropped.  Where all together are shorter they are one; none if they are below SHORTEST.
    """
    groups: list[list[Record]] = []
    for record in sorted(records, key=lambda r: r["objects"]):
        if not groups or _seconds(groups[-1]) >= seconds:
            groups.append([])
        groups[-1].append(record)
    if len(groups) > 1 and _seconds(groups[-1]) < seconds:
        groups.pop()
    for group in groups:
        if _seconds(group) >= SHORTEST:
            yield _point(group)


def _seconds(records: Iterable[Record]) -> float:
    return sum(r["seconds"] for r in records)


def _point(group: Sequence[Record]) -> tuple[float, float]:
    """Mean number of objects, evaluations a second."""
    return sum(r["objects"] for r in group) / len(group), sum(r["evaluations"] for r in group) / _seconds(group)
