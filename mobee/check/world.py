# SPDX-License-Identifier: Apache-2.0
"""Checks a world: units, thin obstacles, duplicates."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import combinations

import numpy as np

from mobee.check.finding import Finding, length
from mobee.model.world import World, WorldObject

FAR = 10.0  # m from the origin: no robot reaches there
TINY = 1e-3  # m
THIN = 0.02  # m: at 2 m/s and 100 Hz a hand moves this far between two ticks


def check_world(world: World, lines: Mapping[str, str]) -> list[Finding]:
    """Return all findings about a world; `lines`: dict from the name of each object to its place in the file, "file:line"."""
    found = [finding for thing in world.objects.values() for finding in _check_object(thing, lines.get(thing.name, thing.name))]
    return found + list(_duplicates(world, lines))


def _check_object(thing: WorldObject, where: str) -> Iterator[Finding]:
    thinnest = _thinnest(thing)
    if max(np.abs(thing.position).max(), *thing.size) > FAR:
        yield Finding(
            "warning",
            "unit",
            where,
            f"object {thing.name!r} is larger or farther away than {length(FAR)}",
            "lengths are in metres, and no robot reaches there",
            "divide by 1000 if the numbers are millimetres",
        )
    elif max(thing.size) < TINY:
        yield Finding(
            "warning",
            "unit",
            where,
            f"object {thing.name!r} is smaller than {length(TINY)}",
            "lengths are in metres",
            "multiply its sizes if they were written in a larger unit",
        )
    elif thing.role == "obstacle" and thinnest < THIN:
        yield Finding(
            "note",
            "thin",
            where,
            f"obstacle {thing.name!r} is {length(thinnest)} thin",
            "a fast hand can pass through it between two ticks, and is then pushed out on the wrong side",
            "make it thicker on the side that nothing can come from",
        )


def _thinnest(thing: WorldObject) -> float:
    return min(thing.size) if thing.kind == "box" else min(2 * thing.size[0], *thing.size[1:], np.inf)


def _duplicates(world: World, lines: Mapping[str, str]) -> Iterator[Finding]:
    for one, other in combinations(world.objects.values(), 2):
        same = (one.kind, one.size) == (other.kind, other.size) and np.allclose(one.position, other.position, atol=1e-6)
        if same and np.allclose(one.rotation, other.rotation, atol=1e-6):
            yield Finding(
                "warning",
                "duplicate",
                lines.get(other.name, other.name),
                f"object {other.name!r} is a duplicate of {one.name!r}: same kind, size and position",
                "contacts with it push twice as hard",
                "remove one of the two",
            )
        if one.name.lower() == other.name.lower():
            yield Finding(
                "warning",
                "name-case",
                lines.get(other.name, other.name),
                f"object {other.name!r} differs from {one.name!r} in upper and lower case only",
                "names are case-sensitive, and people overlook the difference",
                "rename one of the two",
            )
