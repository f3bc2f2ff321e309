"""Which solid contacts count: those of the committed list by which the simulator judges as well."""

from __future__ import annotations

from functools import cache

from services.robot_sim.pairs import load_solid_pairs


@cache
def is_listed(first: str, second: str) -> bool:
    """Whether a contact of two shapes of the iCub counts; of a shape with an object of the world it always does.

    Not counted is what overlaps in some of all legal poses, as upper arms and pelvis: fields are not felt there either.
    """
    links = _links()
    one, other = (_link(name, links) for name in (first, second))
    return one is None or other is None or frozenset((one, other)) in _pairs()


@cache
def _pairs() -> set[frozenset[str]]:
    return load_solid_pairs().links()


@cache
def _links() -> tuple[str, ...]:
    """All names in the list, the longest first."""
    names = {name for pair in _pairs() for name in pair}
    return tuple(sorted(names, key=len, reverse=True))


def _link(shape: str, links: tuple[str, ...]) -> str | None:
    """The link that a shape's name begins with, None for an object of the world."""
    return next((link for link in links if shape == link or shape.startswith(f"{link}_")), None)
