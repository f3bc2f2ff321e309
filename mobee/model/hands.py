"""Hands that reach: the links and fields whose contacts with targets are ignored.

The hand of a marker is the marker's link with everything that this link carries. The fields of the links before it in the same part
belong to the hand too if the marker is inside one of them: otherwise they would keep the marker away from every target.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

MAX_HANDS = 2  # that reach at once; as in core/scene.hpp


@dataclass(frozen=True, slots=True)
class Hand:
    """The links of one hand, by index. Contacts with targets are ignored for both links and for all links that they carry."""

    link: int  # all of its volumes are exempt
    fields: int  # its fields are exempt; the same link, or one before it


Hands = tuple[Hand, ...]
NO_HANDS: Hands = ()


@lru_cache(maxsize=64)
def hand_numbers(reaching: Hands) -> tuple[int, ...]:
    """Return the hands as the core takes them (`Hands` in core/scene.hpp): two links for each, -1 where there is no hand."""
    found = [number for hand in reaching for number in (hand.link, hand.fields)]
    if len(found) > 2 * MAX_HANDS:
        raise ValueError(f"{len(reaching)} hands reach at once; at most {MAX_HANDS} may")
    return (*found, *[-1] * (2 * MAX_HANDS - len(found)))
