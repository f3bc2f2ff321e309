# SPDX-License-Identifier: Apache-2.0
"""The compiled engine of one robot: evaluates poses in the compiled core (C++), in any number of threads, or one after the other.

`Engine` holds the robot and the world in the core. `Neighbours` is a list of the near pairs of volumes (a neighbour list), with which
consecutive poses are evaluated faster. In addition to q, an evaluation needs the world, as an immutable `Snapshot`, and the hands that
reach (`Hands`).

The hand of a marker is the marker's link with all links that it carries. While the marker reaches, contacts of the hand with targets are
ignored. When the robot is at home, the marker may be inside a field (a volume that causes a repulsive force) of a link of the same part
that is nearer to the base. Then contacts of the fields of that link with targets are ignored too; otherwise their forces would keep the
marker away from every target.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from mobee._core import ROW_BYTES
from mobee._core import engine as core
from mobee.arrays import Array
from mobee.errors import UnknownName
from mobee.model.contact import ContactTable
from mobee.model.core_tables import VOLUME, Carried, Volumes, robot_tables, volume_row
from mobee.model.world_object import Role, WorldObject
from mobee.robot.robot import Robot, per_robot

OBSTACLE, TARGET, GHOST, ATTACHED, ATTACHED_GHOST = range(5)
_FREE: dict[Role, int] = {"obstacle": OBSTACLE, "target": TARGET, "ghost": GHOST}
_CARRIED: dict[Role, int] = {"obstacle": ATTACHED, "target": ATTACHED, "ghost": ATTACHED_GHOST}
MAX_HANDS = 2  # hands that may reach at once; as `most_hands` in core/scene.hpp
NO_HANDS: Hands = ()
GRID_MIN_OBJECTS = 100  # with fewer objects a grid costs more than checking one after the other in vector instructions
OBJECTS_PER_CELL = 8  # of the grid, on average


@dataclass(frozen=True, slots=True, eq=False)
class Snapshot:
    """An immutable state of the world; each edit of the world makes the next snapshot.

    `version`: number of edits. `objects`: the objects by name, in the order in which they were added; `names`, `rows` and `roles` have the
    same order. `rows` (N,): the volumes as rows of VOLUME (`mobee.model.core_tables`); those of attached objects are in the frame of their
    link. `roles` (N,): OBSTACLE, TARGET or GHOST (an object that is only drawn); for an attached object ATTACHED, or ATTACHED_GHOST if it
    is a ghost. `attached`: names of the attached objects.
    """

    version: int
    objects: MappingProxyType[str, WorldObject]
    names: tuple[str, ...]
    rows: Volumes  # (N,) VOLUME, contiguous
    roles: NDArray[np.int64]
    attached: tuple[str, ...]


EMPTY = Snapshot(0, MappingProxyType({}), (), np.empty(0, dtype=VOLUME), np.empty(0, dtype=np.int64), ())


def extended(old: Snapshot, new: WorldObject) -> Snapshot:
    """Return the next snapshot: `old` with one more object, `new`, at the end."""
    count, role = len(old.names), _code(new)
    rows, roles = np.empty(count + 1, dtype=VOLUME), np.empty(count + 1, dtype=np.int64)
    rows[:count], rows[count] = old.rows, volume_row(new)
    roles[:count], roles[count] = old.roles, role
    attached = (*old.attached, new.name) if role >= ATTACHED else old.attached
    return Snapshot(old.version + 1, _with(old, new), (*old.names, new.name), rows, roles, attached)


def changed(old: Snapshot, new: WorldObject) -> Snapshot:
    """Return the next snapshot: `old`, in which the object `new` replaces the object with the same name."""
    place, role = old.names.index(new.name), _code(new)
    rows, roles, attached = old.rows.copy(), old.roles, old.attached
    rows[place] = volume_row(new)
    if role != roles[place]:
        roles = roles.copy()
        roles[place] = role
        attached = tuple(old.names[i] for i in np.flatnonzero(roles >= ATTACHED))
    return Snapshot(old.version + 1, _with(old, new), old.names, rows, roles, attached)


def shortened(old: Snapshot, name: str) -> Snapshot:
    """Return the next snapshot: `old` without the object with the given name."""
    place, count = old.names.index(name), len(old.names)
    rows, roles = np.empty(count - 1, dtype=VOLUME), np.empty(count - 1, dtype=np.int64)
    rows[:place], rows[place:] = old.rows[:place], old.rows[place + 1 :]
    roles[:place], roles[place:] = old.roles[:place], old.roles[place + 1 :]
    objects = old.objects.copy()
    del objects[name]
    names = old.names[:place] + old.names[place + 1 :]
    attached = tuple(other for other in old.attached if other != name)
    return Snapshot(old.version + 1, MappingProxyType(objects), names, rows, roles, attached)


def _with(old: Snapshot, new: WorldObject) -> MappingProxyType[str, WorldObject]:
    objects = old.objects.copy()
    objects[new.name] = new
    return MappingProxyType(objects)


def _code(thing: WorldObject) -> int:
    return (_FREE if thing.link is None else _CARRIED)[thing.role]


@dataclass(frozen=True, slots=True)
class Hand:
    """The links of one reaching hand, whose contacts with targets are ignored.

    `link`: index of a link; contacts of its solids and fields, and of those of all links that it carries, are ignored. `fields`: index of a
    link; contacts of its fields only, and of the fields of all links that it carries, are ignored. `fields` is the same link as `link`, or
    an earlier link of the part, nearer to the base. A solid is a volume of the body of a link; a field is a larger volume that causes a
    repulsive force.
    """

    link: int
    fields: int


Hands = tuple[Hand, ...]


@lru_cache(maxsize=64)
def hand_numbers(reaching: Hands) -> tuple[int, ...]:
    """Return four link indices for the compiled core: `link` and `fields` of the first hand, then of the second; -1: no hand.

    The order is that of `Hands` in core/scene.hpp. Raises ValueError for more than two hands.
    """
    found = [number for hand in reaching for number in (hand.link, hand.fields)]
    if len(found) > 2 * MAX_HANDS:
        raise ValueError(f"{len(reaching)} hands reach at once; at most {MAX_HANDS} may")
    return (*found, *[-1] * (2 * MAX_HANDS - len(found)))


@per_robot
def robot_handle(robot: Robot) -> core.Handle:
    """Return the compiled core's handle of a robot; world objects that are attached to its links are not included.

    At the first call for a robot its tables are sent to the core; later calls return the same handle.
    """
    return core.robot(*robot_tables(robot).for_core())


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """A robot and the world in one state, as the compiled core has them; immutable.

    `snapshot`: the state of the world. `handle`: handle of the scene in the core. `nothing`: an empty contact table, for all poses
    without contacts.
    """

    snapshot: Snapshot
    handle: core.Handle
    nothing: ContactTable


class _Room(core.Room):
    """The buffers of one evaluation at a time, and the arguments of the last evaluation of one pose."""

    __slots__ = ("cut", "reaching", "scene")

    def __init__(self, motors: int) -> None:
        super().__init__(motors)
        self.scene: Scene | None = None
        self.reaching: Hands = NO_HANDS
        self.cut = False

    def ask_for(self, scene: Scene, reaching: Hands, cut: bool) -> Scene:
        """Set the scene, the reaching hands and `cut` for the next evaluations of one pose, and return the scene.

        `cut`: whether a contact acts only on the motors of the touching link's own part, as in the MoBeE program of 2014.
        """
        self.ask(scene.handle, hand_numbers(reaching), cut)
        self.scene, self.reaching, self.cut = scene, reaching, cut
        return scene


class Engine:
    """Evaluates poses of one robot in the compiled core; evaluations in several threads do not wait for each other."""

    def __init__(self, robot: Robot) -> None:
        self.robot = robot
        self._motors = len(robot.motor_table)
        self._shapes = tuple(shape.name for shape in robot.shapes)
        self._bare = robot_handle(robot)
        self._laden: tuple[tuple[bytes, ...], core.Handle] = (), self._bare
        self._scene: Scene | None = None
        self._rooms: list[_Room] = []  # buffers that no evaluation uses now

    def transforms(self, q: Array) -> Array:
        """Return the transforms (B, L, 4, 4) of the L links of the robot in the poses q (B, n) rad, in the root frame [m].

        The transform of a link maps a point of the link from its position at zero pose to its position in the pose.
        """
        return core.link_poses(self._bare, q, len(self.robot.links))

    def jacobians(self, q: Array, link: int, point: Array) -> Array:
        """Return the Jacobians (B, 6, n) of a point that is fixed to a link, in the poses q (B, n) rad, root frame.

        The first three rows are linear [m/rad], the last three angular. `link`: index of the link. `point`: (3,) m, position of the point
        in the root frame at zero pose.
        """
        return core.jacobians(self._bare, q, link, point)

    def contacts(self, q: Array, snapshot: Snapshot, reaching: Hands, cut: bool = False, threads: int = 1) -> tuple[ContactTable, Array]:
        """Return all contacts in the poses q (B, n) rad, and their projection to the motors, (B, n) m^2/rad.

        The projection is the sum of J^T (depth * normal) over the contacts of fields. Fields are volumes that cause repulsive forces; J is
        the Jacobian of the contact's point. If `robot.least_lever` is above 0, each depth * normal is multiplied by a factor
        (`mobee.model.kinematics.push_factors`). `snapshot`: the state of the world. `reaching`: the hands that reach for targets; their
        contacts with targets are ignored. `cut`: True: a contact acts only on the motors of the touching link's own part, as in the MoBeE
        program of 2014; False: also on the motors nearer to the base. `threads`: number of threads; the results do not depend on it.
        """
        scene = self.scene_of(snapshot)
        try:
            room = self._rooms.pop()  # atomic: other threads take buffers too
        except IndexError:
            room = _Room(self._motors)
        numbers, reals, torque = room.evaluate(scene.handle, q, hand_numbers(reaching), cut, threads)
        self._rooms.append(room)
        return ContactTable(self._shapes, snapshot.names, (numbers, reals)), torque

    def contacts_of_one(self, q: bytes, snapshot: Snapshot, reaching: Hands, cut: bool = False) -> tuple[ContactTable, Array]:
        """Return the contacts of one pose, and their projection to the motors, (n,) m^2/rad.

        The projection is the sum of J^T (depth * normal) over the contacts of fields. Fields are volumes that cause repulsive forces; J is
        the Jacobian of the contact's point. If `robot.least_lever` is above 0, each depth * normal is multiplied by a factor
        (`mobee.model.kinematics.push_factors`). `q`: the pose (n,) rad as bytes of float64. `snapshot`: the state of the world. `reaching`:
        the hands that reach for targets; their contacts with targets are ignored. `cut`: True: a contact acts only on the motors of the
        touching link's own part, as in the MoBeE program of 2014; False: also on the motors nearer to the base.
        """
        try:
            room = self._rooms.pop()  # atomic: other threads take buffers too
        except IndexError:
            room = _Room(self._motors)
        scene = room.scene
        if scene is None or scene.snapshot is not snapshot or room.reaching is not reaching or room.cut is not cut:
            scene = room.ask_for(self.scene_of(snapshot), reaching, cut)
        count = core.evaluate_one(room.asked, q)
        if count > room.most:
            room.make_space(2 * count)
            core.evaluate_one(room.asked, q)
        table = ContactTable(self._shapes, snapshot.names, room.rows[: count * ROW_BYTES]) if count else scene.nothing
        found = table, room.torque.copy()
        self._rooms.append(room)
        return found

    def table(self, snapshot: Snapshot, numbers: core.Ints, reals: Array) -> ContactTable:
        """Return a contact table of rows that the core has written.

        `snapshot`: the world in which the contacts were computed. `numbers` (c, 6), `reals` (c, 7): the columns of `ContactTable`.
        """
        return ContactTable(self._shapes, snapshot.names, (numbers, reals))

    def scene_of(self, snapshot: Snapshot) -> Scene:
        """Return the scene of the robot in the world of a snapshot (an immutable state of the world).

        A call with the snapshot of the last call returns the same object. Raises UnknownName for an object that is attached to a
        link which the robot does not have.
        """
        known = self._scene
        if known is not None and known.snapshot is snapshot:
            return known
        carried = [k for k, role in enumerate(snapshot.roles) if role == ATTACHED] if snapshot.attached else []
        count = len(snapshot.roles)
        side = 1 if count < GRID_MIN_OBJECTS else max(1, int((count / OBJECTS_PER_CELL) ** (1.0 / 3.0)))
        robot = self._robot_with(snapshot, carried)
        handle = core.scene(robot, snapshot.rows, snapshot.roles, np.array(carried, dtype=np.int64), side)
        new = Scene(snapshot, handle, ContactTable(self._shapes, snapshot.names, (core.NO_NUMBERS, core.NO_REALS)))
        self._scene = new
        return new

    def _robot_with(self, snapshot: Snapshot, carried: list[int]) -> core.Handle:
        """Return the robot with the objects that it carries; built again only when these have changed."""
        if not carried:
            return self._bare
        links = [snapshot.objects[snapshot.names[k]].link or "" for k in carried]
        key = tuple(link.encode() + snapshot.rows[k].tobytes() for link, k in zip(links, carried, strict=True))
        known = self._laden
        if known[0] == key:
            return known[1]
        for link in links:
            if link not in self.robot.links:
                raise UnknownName("link", link, self.robot.links)
        things = [Carried(self.robot.links.index(link), snapshot.rows[k]) for link, k in zip(links, carried, strict=True)]
        new = core.robot(*robot_tables(self.robot, things).for_core())
        self._laden = key, new
        return new


class Neighbours:
    """Computes the contacts of a robot in consecutive poses, with a list of the pairs of volumes that are near each other.

    An object is for one thread at a time. `skin`: m; pairs nearer than this are in the list. `cut`: True: a contact acts only on the motors
    of the touching link's own part, as in the MoBeE program of 2014; False: also on the motors nearer to the base.
    """

    def __init__(self, engine: Engine, skin: float, cut: bool = False) -> None:
        self._engine = engine
        self._core = core.Following(skin, cut)
        self._known: tuple[Scene, Hands] | None = None

    def contacts(self, q: Array, snapshot: Snapshot, reaching: Hands) -> tuple[ContactTable, Array]:
        """Return all contacts in the consecutive poses q (B, n) rad, and their projection to the motors, (B, n) m^2/rad.

        The projection is the sum of J^T (depth * normal) over the contacts of fields. Fields are volumes that cause repulsive forces; J is
        the Jacobian of the contact's point. If `robot.least_lever` is above 0, each depth * normal is multiplied by a factor
        (`mobee.model.kinematics.push_factors`). `snapshot`: the state of the world. `reaching`: the hands that reach for targets; their
        contacts with targets are ignored.
        """
        self.enter(snapshot, reaching)
        numbers, reals, torque = self._core.follow(q)
        return self._engine.table(snapshot, numbers, reals), torque

    def enter(self, snapshot: Snapshot, reaching: Hands) -> int:
        """Set the world and the reaching hands for later computations; return the memory address of the core's object `Neighbours`.

        If the world or the hands have changed, the list of near pairs is discarded; the core makes a new one when this saves time.
        """
        scene = self._engine.scene_of(snapshot)
        known = self._known
        if known is None or known[0] is not scene or known[1] != reaching:
            self._core.enter(scene.handle, hand_numbers(reaching))
            self._known = scene, reaching
        return self._core.at
