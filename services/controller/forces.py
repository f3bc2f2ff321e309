# SPDX-License-Identifier: Apache-2.0
"""Inputs of the control law from outside: user-defined terms, and the constraint forces that the service `model` publishes.

Constraint forces push the robot away from motor limits and contacts. They are checked when they arrive, before the law uses them.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from bus_schema.messages import ContactItem
from bus_schema.messages import Forces as ForcesMessage
from mobee.arrays import Array
from mobee.control import Forces
from mobee.control.forces import LARGEST_FORCE, Term, published_terms, valid_terms
from mobee.model.contact import KINDS, ContactTable
from mobee.model.engine import Hands, Snapshot
from mobee.model.kinematics import push_factors
from mobee.model.pose import Pose
from mobee.robot.robot import Robot
from mobee.settings import imported

MAX_TICKS = 3  # largest age of forces, beyond which the robot holds; largest number of ticks in one step of the law
MAX_STATE_AGE = 100_000_000  # ns; a part whose state is older is not under control


class ModelForces:
    """The newest valid constraint forces that the service `model` has published; they push away from motor limits and contacts.

    `message`: the newest valid `Forces` message; None: there is none in this run. `vectors`: the forces in this message, (n,) rad/s^2 each.
    """

    def __init__(self, robot: Robot, needs_contacts: bool) -> None:
        """`needs_contacts`: True if messages without contacts must be refused, because terms of the control law may depend on contacts."""
        self._robot, self._needs_contacts = robot, needs_contacts
        self.message: ForcesMessage | None = None
        self.vectors: Forces  # each term (n,) rad/s^2, of `message`

    def take(self, message: ForcesMessage) -> str:
        """Store the forces of a message of the service `model` if it is valid; return the reason of a refusal, else an empty text."""
        why = self._refusal(message)
        if not why:
            self.message, self.vectors = message, Forces(**{name: np.array(row) for name, row in message.terms.items()})
        return why

    def forget(self) -> None:
        """Drop the forces, at the start of a new run or when the model has ended."""
        self.message = None

    def answer(self, k: int) -> bool:
        """Return whether the stored forces are those of tick k or of a later one."""
        return self.message is not None and self.message.re_k >= k

    def are_fresh(self, k: int) -> bool:
        """Return whether the stored forces may be used in tick k.

        They must be of a tick at most MAX_TICKS (3) from k, and computed from states of all parts that were at most 100 ms old
        (MAX_STATE_AGE). All parts count, because a contact can involve several.
        """
        if self.message is None:
            return False
        ages = (self.message.part_age.get(part, MAX_STATE_AGE + 1) for part in self._robot.parts)
        return abs(k - self.message.re_k) <= MAX_TICKS and all(age <= MAX_STATE_AGE for age in ages)

    def touched(self, part: str) -> list[str]:
        """Return the names of the world objects in contact with a part, as the newest message of the service `model` states them."""
        return self.message.touched.get(part, []) if self.message is not None else []

    @property
    def contacts(self) -> Sequence[ContactItem]:
        """All contacts of the robot, with itself and with objects, in `message`; empty if there is no message or it has no contacts."""
        return self.message.contacts or () if self.message is not None else ()

    def _refusal(self, message: ForcesMessage) -> str:
        terms = message.terms
        if terms.keys() != set(published_terms()):
            return f"the terms are {', '.join(terms) or 'none'}; this law has {', '.join(published_terms())}"
        largest = LARGEST_FORCE / len(terms)
        if any(max(row, default=0.0) > largest or min(row, default=0.0) < -largest for row in terms.values()):
            return f"a force is larger than {largest:.3g} rad/s^2, the largest that the law accepts"
        if self._needs_contacts and message.contacts is None:
            return "contacts are missing, on which terms of this controller may depend: set shared.terms, so that the model publishes them"
        return _unknown_link(message.contacts or (), len(self._robot.links))


def _unknown_link(contacts: Iterable[ContactItem], links: int) -> str:
    largest = max((max(contact.first_link, contact.second_link) for contact in contacts), default=-1)
    return f"a contact has link {largest}, the robot has {links} links" if largest >= links else ""


def load_terms(names: Sequence[str]) -> tuple[Term, ...]:
    """Import user-defined terms (forces of the control law), each given as `module:name`; a function becomes a term of the same name.

    Raises InvalidValue for a name that cannot be imported or is no term.
    """
    return valid_terms([_term(name) for name in names])


def _term(path: str) -> Term:
    found = imported("term", path)
    return found if isinstance(found, Term) else Term(path.partition(":")[2], found)


class PublishedContacts:
    """Gives a pose the contacts that the model service has published, so that they are not computed again.

    Use it as the `finder` of `mobee.model.pose.Pose.compute_contacts`.
    """

    def __init__(self, pose: Pose, contacts: Sequence[ContactItem]) -> None:
        self._pose, self._contacts = pose, contacts

    def contacts(self, q: Array, snapshot: Snapshot, reaching: Hands) -> tuple[ContactTable, Array]:
        """Return the published contacts for one pose q (1, n) rad, and the projection of field contacts to the motors, (1, n) m^2/rad.

        A field is a volume around a link, larger than the link; its contacts cause repulsive forces. The projection is the sum of
        J^T (factor * depth * normal) over these contacts and their two links, with the opposite normal for the second link. J (3, n) is the
        Jacobian of the contact point on the link. The factors scale the forces (`mobee.model.kinematics.push_factors`); they are 1 if
        `robot.least_lever` is 0. `snapshot` (the world) and `reaching` (the hands that reach) are not used, because the model service has
        already used its own when it computed the contacts.
        """
        projection, numbers, reals = np.zeros_like(q), list[tuple[int, ...]](), list[list[float]]()
        for at, contact in enumerate(self._contacts):
            numbers.append((0, KINDS.index(contact.kind), 2 * at, 2 * at + 1, contact.first_link, contact.second_link))
            reals.append([contact.depth, *contact.normal, *contact.point])
        fields = [contact for contact in self._contacts if contact.kind == "field"]
        links = np.array([(contact.first_link, contact.second_link) for contact in fields], dtype=np.intp).reshape(-1, 2)
        depths = np.array([contact.depth for contact in fields])
        points, normals = (np.array([getattr(contact, what) for contact in fields]).reshape(-1, 3) for what in ("point", "normal"))
        pushes = (push_factors(self._pose.robot, self._pose.transforms, links, depths, points, normals) * depths)[:, None] * normals
        for pair, push, point in zip(links.tolist(), pushes, points, strict=True):
            for link, sign in zip(pair, (1.0, -1.0), strict=True):
                if link >= 0:
                    projection[0] += sign * push @ self._pose.point_jacobian(link, point)[:3]
        names = tuple(name for contact in self._contacts for name in (contact.first, contact.second))
        return ContactTable(names, (), (np.array(numbers, dtype=np.int64).reshape(-1, 6), np.array(reals).reshape(-1, 7))), projection
