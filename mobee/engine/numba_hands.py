"""The hands that reach, as one number for compiled code: they do not feel the targets.

A hand is the link of its marker with all that this carries; and the fields of the links before it whose fields the marker is in, for
they would keep it from everything.
"""

from __future__ import annotations

from dataclasses import dataclass

BITS = 15  # for each link
MOST = 2
_ALL = (1 << BITS) - 1


@dataclass(frozen=True, slots=True)
class Hand:
    """A link of which no volume feels the targets, the same or one before it of which no field does, and what both carry."""

    link: int
    fields: int


def hands(*given: Hand) -> int:
    """At most MOST hands as one number, 0 for none."""
    return sum((one.link + 1 | one.fields + 1 << BITS) << 2 * BITS * place for place, one in enumerate(given))


def hands_of(number: int) -> tuple[Hand, ...]:
    """Those that `hands` made the number of."""
    shifted = [number >> 2 * BITS * place for place in range(MOST)]
    return tuple(Hand((one & _ALL) - 1, (one >> BITS & _ALL) - 1) for one in shifted if one)
