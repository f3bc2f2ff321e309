# SPDX-License-Identifier: Apache-2.0
"""The result of an evaluation, for one pose or a batch: positions and rotations, contacts, projected contact forces."""

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
    """An object that computes contacts."""

    def contacts(self, q: Array, snapshot: Snapshot, reaching: Hands) -> tuple[ContactTable, Array]:
        """Return all contacts in the poses q (B, n), and the projection of those of fields to the motors, (B, n), see `Pose.projection`."""


class Engine(Protocol):
    """An engine that evaluates poses: the compiled one, or python-fcl as its independent reference."""

    def transforms(self, q: Array) -> Array:
        """Return the transforms of every link in the poses q (B, n), (B, L, 4, 4)."""

    def jacobians(self, q: Array, link: int, point: Array) -> Array:
        """Return the Jacobians (B, 6, n) of a link's point (3,), root frame at zero pose, in the poses q (B, n)."""

    def contacts(self, q: Array, snapshot: Snapshot, reaching: Hands, cut: bool = False, threads: int = 1) -> tuple[ContactTable, Array]:
        """Return all contacts in the poses q (B, n), and the projection of the contacts of fields to the motors, (B, n)."""

    def contacts_of_one(self, q: bytes, snapshot: Snapshot, reaching: Hands, cut: bool = False) -> tuple[ContactTable, Array]:
        """Return the contacts of one pose and their projection to the motors (n,); `q`: the bytes of the pose (n,)."""


class Pose:
    """The robot at one q or at a batch of them, in the world as it was when `Model.evaluate` was called.

    Every result is computed when it is first read, and kept.
    """

    __slots__ = ("_contacts", "_engine", "_evaluated", "_given", "_reaching", "_snapshot", "_threads", "_transforms", "robot")

    # Not functools.cached_property: before Python 3.12 it takes one lock for all poses, and no evaluation may wait for another.

    def __init__(self, robot: Robot, engine: Engine, q: Array | bytes, snapshot: Snapshot, reaching: Hands, threads: int = 1) -> None:
        """`q`: (..., n) rad, or the bytes of one pose (n,), which is faster."""
        self.robot = robot
        self._given = q
        self._engine = engine
        self._snapshot = snapshot
        self._reaching = reaching
        self._threads = threads
        self._transforms: Array | None = None
        self._evaluated: tuple[ContactTable, Array] | None = None
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
        """The transform of every link, (..., L, 4, 4), from its place at zero pose to its place at q, root frame."""
        if self._transforms is None:
            found = self._engine.transforms(self._flat)
            self._transforms = found.reshape(*self.q.shape[:-1], *found.shape[1:])
        return self._transforms

    def position(self, marker: str) -> Array:
        """Return the position of a marker, (..., 3) m in the root frame; raises UnknownName."""
        m = self.robot.marker(marker)
        link = self.transforms[..., m.link, :3, :]
        return link[..., :3] @ m.position + link[..., 3]

    def rotation(self, marker: str) -> Array:
        """Return the rotation of a marker, (..., 3, 3) in the root frame; raises UnknownName."""
        m = self.robot.marker(marker)
        return self.transforms[..., m.link, :3, :3] @ m.rotation

    def normal(self, marker: str) -> Array:
        """Return the normal of a marker, (..., 3) unit vectors in the root frame; raises UnknownName."""
        m = self.robot.marker(marker)
        return self.transforms[..., m.link, :3, :3] @ m.normal

    def point_jacobian(self, link: int, point: Array) -> Array:
        """Return the Jacobian of a point (..., 3) m, root frame at q, that is fixed to a link: (..., 6, n), linear rows, then angular."""
        return point_jacobian(self.robot, self.transforms, link, point)

    @property
    def table(self) -> ContactTable:
        """Every overlap of the tested pairs in every pose, as columns."""
        evaluated = self._evaluated
        if evaluated is None:
            evaluated = self._evaluated = self._computed(False)
        return evaluated[0]

    @property
    def projection(self) -> Array:
        """The contacts of fields projected to the motors: sum of J^T (depth * normal), (..., n) in [m^2/rad] (the sum in thesis eq. 5.11).

        The two links of a self-contact get opposite vectors. A contact acts on all motors from its link down to the base.
        """
        evaluated = self._evaluated
        if evaluated is None:
            evaluated = self._evaluated = self._computed(False)
        return evaluated[1]

    @property
    def projection_of_part(self) -> Array:
        """The same as `projection`, but each contact acts only on the motors of its own part: a contact of an arm not on the torso's.

        The original program of 2014 projected contacts like this.
        """
        return self._computed(True)[1]

    @property
    def contacts(self) -> tuple[Contact, ...]:
        """Every overlap of the tested pairs, solids before fields; for one pose only (InvalidValue for a batch)."""
        if self.q.ndim != 1:
            raise InvalidValue(f"contacts belong to one pose, and this is a batch of shape {self.q.shape}; use table, or evaluate one q.")
        if self._contacts is None:
            self._contacts = self.table.contacts()
        return self._contacts

    @property
    def count(self) -> int | Ints:
        """The number of solid contacts: an int for one pose, (...,) integers for a batch."""
        table = self.table
        counted = np.bincount(table.pose[table.kind == 0], minlength=len(self._flat))
        return int(counted[0]) if self.q.ndim == 1 else counted.reshape(self.q.shape[:-1])

    @property
    def objects(self) -> dict[str, WorldObject]:
        """The world's objects at the time of this evaluation; for one pose only. Attached objects are at their position in this pose.

        Raises UnknownName if an object is attached to a link that the robot does not have.
        """
        return {
            name: thing if thing.link is None else placed(thing, link_pose(self, thing.link))
            for name, thing in self._snapshot.objects.items()
        }

    def each(self) -> Iterator[Pose]:
        """Yield the poses of a batch one by one; contacts are computed again when they are read."""
        transforms = self.transforms.reshape(-1, *self.transforms.shape[-3:])
        for q, placed_links in zip(self._flat, transforms, strict=True):
            one = Pose(self.robot, self._engine, q, self._snapshot, self._reaching)
            one._transforms = placed_links
            yield one

    def compute_contacts(self, finder: Finder) -> None:
        """Compute the contacts now, with the given finder instead of the model's engine."""
        table, torque = finder.contacts(self._flat, self._snapshot, self._reaching)
        self._evaluated = table, torque.reshape(self.q.shape)

    @property
    def _flat(self) -> Array:
        return self.q.reshape(-1, self.q.shape[-1])

    def _computed(self, cut: bool) -> tuple[ContactTable, Array]:
        given = self._given
        if not isinstance(given, bytes):
            if given.ndim > 1:
                table, torque = self._engine.contacts(self._flat, self._snapshot, self._reaching, cut, self._threads)
                return table, torque.reshape(given.shape)
            given = given.tobytes()
        return self._engine.contacts_of_one(given, self._snapshot, self._reaching, cut)
