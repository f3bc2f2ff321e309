"""The result of an evaluation: positions and rotations, contacts, projected contact forces, for one pose or a batch."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Protocol

import numpy as np

from mobee.arrays import Array, Ints
from mobee.errors import InvalidValue
from mobee.model.contact import Contact, ContactTable
from mobee.model.kinematics import point_jacobian
from mobee.model.snapshot import Hands, Snapshot
from mobee.model.world import link_pose
from mobee.model.world_object import WorldObject, placed
from mobee.robot.robot import Robot


class Finder(Protocol):
    """What finds contacts."""

    def contacts(self, q: Array, snapshot: Snapshot, reaching: Hands) -> tuple[ContactTable, Array]:
        """All contacts in the poses q (B, n), and the projected depths of those of fields, (B, n)."""


class Engine(Protocol):
    """What evaluates poses: the compiled engine, or python-fcl as its exact reference."""

    def transforms(self, q: Array) -> Array:
        """Every link in the poses q (B, n), (B, L, 4, 4)."""

    def jacobians(self, q: Array, link: int, point: Array) -> Array:
        """How a link's point (3,), root frame at zero pose, moves with each motor in the poses q (B, n), (B, 6, n)."""

    def contacts(self, q: Array, snapshot: Snapshot, reaching: Hands, cut: bool = False, threads: int = 1) -> tuple[ContactTable, Array]:
        """All contacts in the poses q (B, n), and the projected depths of those of fields, (B, n)."""

    def contacts_of_one(self, q: bytes, snapshot: Snapshot, reaching: Hands, cut: bool = False) -> tuple[ContactTable, Array]:
        """The same for one pose, of which `q` are the bytes."""


class Pose:
    """The robot at one q or at a batch of them, in the world as it was when `Model.evaluate` was called.

    What is asked for is computed when it is first asked for, and kept.
    """

    __slots__ = ("_contacts", "_engine", "_felt", "_given", "_reaching", "_snapshot", "_threads", "_transforms", "robot")

    # Kept by hand: functools.cached_property takes one lock for all poses before Python 3.12, and no evaluation may wait for another.

    def __init__(self, robot: Robot, engine: Engine, q: Array | bytes, snapshot: Snapshot, reaching: Hands, threads: int = 1) -> None:
        """`q`: (..., n) rad; or the bytes of one (n,), which is sooner."""
        self.robot = robot
        self._given = q
        self._engine = engine
        self._snapshot = snapshot
        self._reaching = reaching
        self._threads = threads
        self._transforms: Array | None = None
        self._felt: tuple[ContactTable, Array] | None = None
        self._contacts: tuple[Contact, ...] | None = None

    @property
    def q(self) -> Array:
        """The motor positions, (..., n) rad."""
        given = self._given
        if isinstance(given, bytes):
            given = self._given = np.frombuffer(given).copy()
        return given

    @property
    def transforms(self) -> Array:
        """Where every link has gone: (..., L, 4, 4), from the root frame at zero pose to now."""
        if self._transforms is None:
            found = self._engine.transforms(self._flat)
            self._transforms = found.reshape(*self.q.shape[:-1], *found.shape[1:])
        return self._transforms

    def position(self, marker: str) -> Array:
        """Where a marker is, (..., 3) m in the root frame; raises UnknownName."""
        m = self.robot.marker(marker)
        link = self.transforms[..., m.link, :3, :]
        return link[..., :3] @ m.position + link[..., 3]

    def rotation(self, marker: str) -> Array:
        """How a marker is turned, (..., 3, 3) in the root frame; raises UnknownName."""
        m = self.robot.marker(marker)
        return self.transforms[..., m.link, :3, :3] @ m.rotation

    def normal(self, marker: str) -> Array:
        """Where a marker's normal points, (..., 3) unit vector in the root frame; raises UnknownName."""
        m = self.robot.marker(marker)
        return self.transforms[..., m.link, :3, :3] @ m.normal

    def point_jacobian(self, link: int, point: Array) -> Array:
        """How a point (..., 3) m, root frame now, fixed to a link moves per motor: (..., 6, n), linear rows then angular."""
        return point_jacobian(self.robot, self.transforms, link, point)

    @property
    def table(self) -> ContactTable:
        """Every overlap of the tested pairs in every pose, as columns."""
        felt = self._felt
        if felt is None:
            felt = self._felt = self._found(False)
        return felt[0]

    @property
    def projection(self) -> Array:
        """The contacts of fields as the motors see them: sum of J^T (depth * normal), (..., n) in [m^2/rad] (thesis eq. 5.11).

        Both sides of a self contact get opposite vectors, and all motors down to the base feel it.
        """
        felt = self._felt
        if felt is None:
            felt = self._felt = self._found(False)
        return felt[1]

    @property
    def projection_of_part(self) -> Array:
        """The projection, cut where a part ends, as in the original program: an arm's contact does not reach the torso."""
        return self._found(True)[1]

    @property
    def contacts(self) -> tuple[Contact, ...]:
        """Every overlap of the tested pairs, solids before fields; one pose only (InvalidValue for a batch)."""
        if self.q.ndim != 1:
            raise InvalidValue(f"contacts belong to one pose, and this is a batch of shape {self.q.shape}; use table, or evaluate one q.")
        if self._contacts is None:
            self._contacts = self.table.contacts()
        return self._contacts

    @property
    def count(self) -> int | Ints:
        """How many solid contacts: an int for one pose, (...,) integers for a batch."""
        table = self.table
        counted = np.bincount(table.pose[table.kind == 0], minlength=len(self._flat))
        return int(counted[0]) if self.q.ndim == 1 else counted.reshape(self.q.shape[:-1])

    @property
    def objects(self) -> dict[str, WorldObject]:
        """The world's objects as this evaluation saw them; one pose only: attached ones are where their link carries them.

        Raises UnknownName if one is attached to no link of the robot.
        """
        return {
            name: thing if thing.link is None else placed(thing, link_pose(self, thing.link))
            for name, thing in self._snapshot.objects.items()
        }

    def each(self) -> Iterator[Pose]:
        """The poses of a batch one by one; their contacts are found anew when they are asked for."""
        transforms = self.transforms.reshape(-1, *self.transforms.shape[-3:])
        for q, placed_links in zip(self._flat, transforms, strict=True):
            one = Pose(self.robot, self._engine, q, self._snapshot, self._reaching)
            one._transforms = placed_links
            yield one

    def feel(self, finder: Finder) -> None:
        """Have the contacts found now, and by other means than the model's own."""
        table, torque = finder.contacts(self._flat, self._snapshot, self._reaching)
        self._felt = table, torque.reshape(self.q.shape)

    @property
    def _flat(self) -> Array:
        return self.q.reshape(-1, self.q.shape[-1])

    def _found(self, cut: bool) -> tuple[ContactTable, Array]:
        given = self._given
        if not isinstance(given, bytes):
            if given.ndim > 1:
                table, torque = self._engine.contacts(self._flat, self._snapshot, self._reaching, cut, self._threads)
                return table, torque.reshape(given.shape)
            given = given.tobytes()
        return self._engine.contacts_of_one(given, self._snapshot, self._reaching, cut)
