# SPDX-License-Identifier: Apache-2.0
"""The result of an evaluation, for one pose or a batch: positions and rotations, contacts, projected contact forces."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Protocol

import numpy as np

from mobee.arrays import Array, Ints
from mobee.errors import InvalidValue
from mobee.model.contact import Contact, ContactTable, links_moved, touched_in
from mobee.model.engine import Hands, Snapshot
from mobee.model.kinematics import point_jacobian
from mobee.model.world import link_pose
from mobee.model.world_object import WorldObject, placed
from mobee.robot.robot import Robot


class Finder(Protocol):
    """An object that computes the contacts of poses, for example an `Engine` or `mobee.model.engine.Neighbours`."""

    def contacts(self, q: Array, snapshot: Snapshot, reaching: Hands) -> tuple[ContactTable, Array]:
        """Return all contacts in the poses q (B, n) rad, and their projection to the motors, (B, n) m^2/rad.

        The projection is the sum of J^T (depth * normal) over the contacts of fields. Fields are volumes that cause repulsive forces; J is
        the Jacobian of the contact's point. If `robot.least_lever` is above 0, each depth * normal is multiplied by a factor
        (`mobee.model.kinematics.push_factors`). `snapshot`: the state of the world. `reaching`: the hands that reach for targets; their
        contacts with targets are ignored.
        """


class Engine(Protocol):
    """An engine that evaluates poses: the compiled one, or python-fcl as its independent reference."""

    def transforms(self, q: Array) -> Array:
        """Return the transforms (B, L, 4, 4) of the L links of the robot in the poses q (B, n) rad, in the root frame [m].

        The transform of a link maps a point of the link from its position at zero pose to its position in the pose.
        """

    def jacobians(self, q: Array, link: int, point: Array) -> Array:
        """Return the Jacobians (B, 6, n) of a point that is fixed to a link, in the poses q (B, n) rad, root frame.

        The first three rows are linear [m/rad], the last three angular. `link`: index of the link. `point`: (3,) m, position of the point
        in the root frame at zero pose.
        """

    def contacts(self, q: Array, snapshot: Snapshot, reaching: Hands, cut: bool = False, threads: int = 1) -> tuple[ContactTable, Array]:
        """Return all contacts in the poses q (B, n) rad, and their projection to the motors, (B, n) m^2/rad.

        The projection is the sum of J^T (depth * normal) over the contacts of fields. Fields are volumes that cause repulsive forces; J is
        the Jacobian of the contact's point. If `robot.least_lever` is above 0, each depth * normal is multiplied by a factor
        (`mobee.model.kinematics.push_factors`). `snapshot`: the state of the world. `reaching`: the hands that reach for targets; their
        contacts with targets are ignored. `cut`: True: a contact acts only on the motors of the touching link's own part, as in the MoBeE
        program of 2014; False: also on the motors nearer to the base. `threads`: number of threads; the results do not depend on it.
        """

    def contacts_of_one(self, q: bytes, snapshot: Snapshot, reaching: Hands, cut: bool = False) -> tuple[ContactTable, Array]:
        """Return the contacts of one pose, and their projection to the motors, (n,) m^2/rad.

        The projection is the sum of J^T (depth * normal) over the contacts of fields. Fields are volumes that cause repulsive forces; J is
        the Jacobian of the contact's point. If `robot.least_lever` is above 0, each depth * normal is multiplied by a factor
        (`mobee.model.kinematics.push_factors`). `q`: the pose (n,) rad as bytes of float64. `snapshot`: the state of the world. `reaching`:
        the hands that reach for targets; their contacts with targets are ignored. `cut`: True: a contact acts only on the motors of the
        touching link's own part, as in the MoBeE program of 2014; False: also on the motors nearer to the base.
        """


class Pose:
    """The robot at one q, or at a batch of several q, in the world at the time of the call of `Model.evaluate`.

    Link transforms and contacts (`table`, `projection`) are computed when they are first read, and kept. `projection_of_part` is computed
    at every read.
    """

    __slots__ = ("_contacts", "_engine", "_evaluated", "_given", "_reaching", "_snapshot", "_threads", "_transforms", "robot")

    # Not functools.cached_property: before Python 3.12 it takes one lock for all poses, and no evaluation may wait for another.

    def __init__(self, robot: Robot, engine: Engine, q: Array | bytes, snapshot: Snapshot, reaching: Hands, threads: int = 1) -> None:
        """Make a pose without computing anything; users call `Model.evaluate`.

        `q`: (..., n) rad, or one pose (n,) as bytes of float64, which is faster. `snapshot`: of the world. `reaching`: the hands whose
        contacts with targets are ignored. `threads`: number of threads for a batch.
        """
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
        """The transform of every link, (..., L, 4, 4), which maps a point's position at zero pose to its position at q, root frame."""
        if self._transforms is None:
            found = self._engine.transforms(self._flat)
            self._transforms = found.reshape(*self.q.shape[:-1], *found.shape[1:])
        return self._transforms

    def position(self, marker: str) -> Array:
        """Return the position of a marker, (..., 3) m in the root frame; raises UnknownName if there is no such marker."""
        m = self.robot.marker(marker)
        link = self.transforms[..., m.link, :3, :]
        return link[..., :3] @ m.position + link[..., 3]

    def rotation(self, marker: str) -> Array:
        """Return the orientation of a marker, (..., 3, 3): the columns are the axes of the marker in the root frame.

        Raises UnknownName if there is no such marker.
        """
        m = self.robot.marker(marker)
        return self.transforms[..., m.link, :3, :3] @ m.rotation

    def normal(self, marker: str) -> Array:
        """Return the normal of a marker, (..., 3) unit vectors in the root frame; raises UnknownName if there is no such marker."""
        m = self.robot.marker(marker)
        return self.transforms[..., m.link, :3, :3] @ m.normal

    def point_jacobian(self, link: int, point: Array) -> Array:
        """Return the Jacobian of a point that is fixed to a link, (..., 6, n), root frame: three linear rows [m/rad], then three angular.

        `link`: index of the link. `point`: (..., 3) m, position of the point in the root frame at q.
        """
        return point_jacobian(self.robot, self.transforms, link, point)

    @property
    def table(self) -> ContactTable:
        """All contacts in every pose, as a table with columns.

        Some pairs of volumes are not tested, see `mobee.model.fcl_engine.tested_pairs`.
        """
        evaluated = self._evaluated
        if evaluated is None:
            evaluated = self._evaluated = self._computed(False)
        return evaluated[0]

    @property
    def projection(self) -> Array:
        """The projection of the contacts to the motors: the sum of J^T (depth * normal), (..., n) m^2/rad (the sum in thesis eq. 5.11).

        The sum is over the contacts of fields. Fields are volumes that cause repulsive forces; J is the Jacobian of the contact's point. In
        a contact of two links, the push acts on the first link, and the opposite push on the second. A push acts on all motors from its
        link down to the base. If `robot.least_lever` is above 0, each push is multiplied by a factor
        (`mobee.model.kinematics.push_factors`).
        """
        evaluated = self._evaluated
        if evaluated is None:
            evaluated = self._evaluated = self._computed(False)
        return evaluated[1]

    @property
    def projection_of_part(self) -> Array:
        """The projection of the contacts to the motors, (..., n) m^2/rad, in which a push acts only on the motors of its link's own part.

        It is the sum of J^T (depth * normal) over the contacts of fields (volumes that cause repulsive forces), as `projection`, but a
        contact of an arm, for example, does not act on the motors of the torso. The original MoBeE program of 2014 projected contacts like
        this.
        """
        return self._computed(True)[1]

    @property
    def contacts(self) -> tuple[Contact, ...]:
        """All contacts in this pose, solids before fields; raises InvalidValue for a batch of poses.

        Some pairs of volumes are not tested, see `mobee.model.fcl_engine.tested_pairs`.
        """
        if self.q.ndim != 1:
            raise InvalidValue(f"contacts belong to one pose, and this is a batch of shape {self.q.shape}; use table, or evaluate one q.")
        if self._contacts is None:
            self._contacts = self.table.contacts()
        return self._contacts

    @property
    def count(self) -> int | Ints:
        """The number of contacts between two solids: an int for one pose, (...,) integers for a batch."""
        table = self.table
        counted = np.bincount(table.pose[table.kind == 0], minlength=len(self._flat))
        return int(counted[0]) if self.q.ndim == 1 else counted.reshape(self.q.shape[:-1])

    @property
    def objects(self) -> dict[str, WorldObject]:
        """The world's objects at the time of this evaluation, by name; for one pose, not a batch.

        Attached objects are given as free objects at their place in this pose. Raises UnknownName if an object is attached to a link that
        the robot does not have, and InvalidValue for a batch if an object is attached.
        """
        return {
            name: thing if thing.link is None else placed(thing, link_pose(self, thing.link))
            for name, thing in self._snapshot.objects.items()
        }

    def each(self) -> Iterator[Pose]:
        """Yield the poses of a batch one by one; link transforms are kept, contacts are computed again when they are read."""
        transforms = self.transforms.reshape(-1, *self.transforms.shape[-3:])
        for q, placed_links in zip(self._flat, transforms, strict=True):
            one = Pose(self.robot, self._engine, q, self._snapshot, self._reaching)
            one._transforms = placed_links
            yield one

    def compute_contacts(self, finder: Finder) -> None:
        """Compute and keep the contacts now, with `finder` instead of the model's engine."""
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


def touched(pose: Pose) -> dict[str, tuple[str, ...]]:
    """Return, for each part by name, the sorted names of the free world objects that touch the part in a pose.

    An object touches a part if it overlaps a volume of a link that the part's motors move: a solid, a field (a larger volume that causes a
    repulsive force), or an object that is attached to the link. `pose`: one pose; raises InvalidValue for a batch.
    """
    return {part: touched_by(pose, part) for part in pose.robot.parts}


def touched_by(pose: Pose, part: str) -> tuple[str, ...]:
    """Return the sorted names of the free world objects that touch a part in a pose.

    An object touches a part if it overlaps a volume of a link that the part's motors move: a solid, a field (a larger volume that causes a
    repulsive force), or an object that is attached to the link. `pose`: one pose; raises InvalidValue for a batch. `part`: name of the
    part.
    """
    if pose.q.ndim != 1:
        raise InvalidValue(f"a batch of poses, of shape {pose.q.shape}: objects touch a part in one pose; evaluate one q.")
    return touched_in(pose.table, links_moved(pose.robot)[part])
