"""Hands that are reaching: links and fields whose contacts with targets are ignored.

A hand is the link of its marker with all that this carries; and the fields of the links before it whose fields the marker is in, for
they would keep it from everything.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

MOST = 2


@dataclass(frozen=True, slots=True)
class Hand:
    """A link of which no volume feels the targets, the same or one before it of which no field does, and what both carry."""

    link: int
    fields: int


Hands = tuple[Hand, ...]
NOBODY: Hands = ()


@lru_cache(maxsize=64)
def hand_numbers(reaching: Hands) -> tuple[int, ...]:
    """`Hands` of core/scene.hpp: the two links of each, -1 where there is none."""
    found = [number for hand in reaching for number in (hand.link, hand.fields)]
    if len(found) > 2 * MOST:
        raise ValueError(f"{len(reaching)} hands reach at once; at most {MOST} may")
    return (*found, *[-1] * (2 * MOST - len(found)))
