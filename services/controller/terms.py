"""Imports user-defined forces of the law, and gives them the contacts that the model publishes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from bus_schema.messages import ContactItem
from mobee.arrays import Array
from mobee.control.terms import Term, valid_terms
from mobee.learning.named import imported
from mobee.model.contact import KINDS, ContactTable
from mobee.model.hands import Hands
from mobee.model.pose import Pose
from mobee.model.snapshot import Snapshot


def load_terms(names: Sequence[str]) -> tuple[Term, ...]:
    """The terms that these importable `module:name` stand for; a function is a term of its own name.  Raises InvalidValue."""
    return valid_terms([_term(name) for name in names])


def _term(path: str) -> Term:
    found = imported("term", path)
    return found if isinstance(found, Term) else Term(path.partition(":")[2], found)


class ToldContacts:
    """The contacts that the model told, as what a pose takes in place of its own (`Pose.feel`)."""

    def __init__(self, pose: Pose, told: Sequence[ContactItem]) -> None:
        self._pose, self._told = pose, told

    def contacts(self, q: Array, snapshot: Snapshot, reaching: Hands) -> tuple[ContactTable, Array]:
        """The table, and the sum of J^T (depth * normal) over those of fields, (1, n)."""
        felt, numbers, reals = np.zeros_like(q), list[tuple[int, ...]](), list[list[float]]()
        for at, contact in enumerate(self._told):
            numbers.append((0, KINDS.index(contact.kind), 2 * at, 2 * at + 1, contact.first_link, contact.second_link))
            reals.append([contact.depth, *contact.normal, *contact.point])
            if contact.kind == "field":
                push, point = contact.depth * np.array(contact.normal), np.array(contact.point)
                for link, sign in ((contact.first_link, 1.0), (contact.second_link, -1.0)):
                    if link >= 0:
                        felt[0] += sign * push @ self._pose.point_jacobian(link, point)[:3]
        names = tuple(name for contact in self._told for name in (contact.first, contact.second))
        return ContactTable(names, (), (np.array(numbers, dtype=np.int64).reshape(-1, 6), np.array(reals).reshape(-1, 7))), felt
