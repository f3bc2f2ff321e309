# SPDX-License-Identifier: Apache-2.0
"""The compiled engine of one robot: holds the robot and the world in the compiled core (C++), for evaluations in any number of threads."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mobee._core import engine as core
from mobee._core.tables import ROW_BYTES
from mobee.arrays import Array
from mobee.errors import UnknownName
from mobee.model.contact import ContactTable
from mobee.model.robot_tables import Carried, robot_tables
from mobee.model.snapshot import ATTACHED, NO_HANDS, Hands, Snapshot, hand_numbers
from mobee.robot.robot import Robot, per_robot

GRID_MIN_OBJECTS = 100  # with fewer objects a grid costs more than checking one after the other in vector instructions
OBJECTS_PER_CELL = 8  # of the grid, on average


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
        """Set the scene, the reaching hands and `cut` for the next evaluations of one pose, and return the scene."""
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
        the Jacobian of the contact's point. `snapshot`: the state of the world. `reaching`: the hands that reach for targets; their
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
        the Jacobian of the contact's point. `q`: the pose (n,) rad as bytes of float64. `snapshot`: the state of the world. `reaching`: the
        hands that reach for targets; their contacts with targets are ignored. `cut`: True: a contact acts only on the motors of the
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
