"""The links that reach, as one number for compiled code: they, and all that they carry, do not feel the targets."""

from __future__ import annotations

BITS = 16  # for each link
MOST = 3


def hands(*links: int) -> int:
    """At most MOST links as one number, 0 for none."""
    return sum(link + 1 << BITS * place for place, link in enumerate(links))


def links_of(number: int) -> tuple[int, ...]:
    """The links that `hands` made the number of."""
    shifted = (number >> BITS * place & (1 << BITS) - 1 for place in range(MOST))
    return tuple(one - 1 for one in shifted if one)
