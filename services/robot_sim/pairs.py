"""Which pairs of links count as solid contact: the committed list, made by experiments/robots/solid_pairs.py."""

from __future__ import annotations

from pathlib import Path

import msgspec
from msgspec import Struct

SOLID_PAIRS = Path(__file__).with_name("solid_pairs.json")
TABLE = "table"  # in the list it stands for every obstacle of the world


class SolidPairs(Struct, frozen=True, forbid_unknown_fields=True):
    """The list, and how it came about."""

    model: str  # of icub-models
    distance: float  # m, at which hulls count as apart
    poses: int  # random legal ones, in all of which the hulls of a pair were apart
    seed: int
    always: list[list[str]]  # listed whatever the poses say: hands and forearms against torso, head, other arm, table
    apart: list[list[str]]  # the others

    def links(self) -> set[frozenset[str]]:
        """Pairs of two links of the robot."""
        return {frozenset(pair) for pair in self.always + self.apart if TABLE not in pair}

    def against_table(self) -> list[str]:
        """Links that are listed with the table, sorted."""
        return sorted(first if second == TABLE else second for first, second in self.always + self.apart if TABLE in (first, second))


def load_solid_pairs() -> SolidPairs:
    """The committed list."""
    return msgspec.json.decode(SOLID_PAIRS.read_bytes(), type=SolidPairs)
