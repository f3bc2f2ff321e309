"""The engine of one robot: keeps what compiled code works on, for any number of threads."""

from __future__ import annotations

import numpy as np

from mobee.collision.contact import ContactTable
from mobee.collision.snapshot import ATTACHED, Snapshot
from mobee.engine import evaluate
from mobee.engine.layout import SLOT
from mobee.engine.pack import Carried, Packed, pack
from mobee.engine.rows import NUMBERS, REALS
from mobee.engine.scene import COUNT, Scene, scene
from mobee.errors import UnknownName
from mobee.robot.robot import Array, Ints, Robot


class Engine:
    """Evaluates poses of one robot; evaluations in several threads do not wait for each other."""

    def __init__(self, robot: Robot) -> None:
        self.robot = robot
        self._shapes = tuple(shape.name for shape in robot.shapes)
        self._packed: tuple[tuple[bytes, ...], Packed] = (), pack(robot)
        self._scene: Scene | None = None
        self._rooms: list[tuple[Scene | None, Array]] = []  # slots of evaluations that have ended, with the scene they are settled for

    def transforms(self, q: Array) -> Array:
        """Every link in every pose, (B, L, 4, 4) from q (B, n)."""
        packed = self._packed[1]
        return evaluate.link_poses(packed.integers, packed.floats, q)

    def jacobians(self, q: Array, link: int, point: Array) -> Array:
        """How the point (3,) of a link, root frame at zero pose, moves with each motor in the poses q (B, n): (B, 6, n)."""
        packed = self._packed[1]
        return evaluate.jacobians(packed.integers, packed.floats, q, link, np.tile(point, (len(q), 1)))

    def contacts(self, q: Array, snapshot: Snapshot, reaching: int, cut: bool = False) -> tuple[ContactTable, Array]:
        """All contacts in the poses q (B, n), and the sum of J^T (depth * normal) over those of fields, (B, n).

        `reaching`: link that spares the targets, -1 for none; `cut`: see `project`.
        """
        here = self.scene_of(snapshot)
        packed = here.packed
        room = self._take_room(here)
        own = len(self.robot.shapes)
        numbers, reals, torque = evaluate.contacts(
            packed.integers, packed.floats, packed.vertices, here.integers, here.floats, here.carried, own, reaching, cut, q, room
        )
        self._rooms.append((here, room))
        return self.table(snapshot, numbers, reals), torque

    def table(self, snapshot: Snapshot, numbers: Ints, reals: Array) -> ContactTable:
        """The table of what compiled code has written."""
        return ContactTable(self._shapes, snapshot.names, numbers.reshape(-1, NUMBERS), reals.reshape(-1, REALS))

    def _take_room(self, here: Scene) -> Array:
        packed, size = here.packed, (len(here.packed.order) + int(here.integers[COUNT])) * SLOT
        try:
            settled_for, room = self._rooms.pop()
        except IndexError:
            settled_for, room = None, np.empty(0)
        if settled_for is here:
            return room
        if len(room) < size:
            room = np.zeros(2 * size)
        evaluate.settle(packed.integers, packed.floats, here.integers, here.snapshot.rows.reshape(-1), room)
        return room

    def scene_of(self, snapshot: Snapshot) -> Scene:
        """The robot among the free objects of a snapshot; the same as before for the same snapshot."""
        known = self._scene
        if known is not None and known.snapshot is snapshot:
            return known
        carried = [k for k, role in enumerate(snapshot.roles) if role == ATTACHED] if snapshot.attached else []
        new = scene(self._packed_with(snapshot, carried), snapshot, np.array(carried, dtype=np.int64))
        self._scene = new
        return new

    def _packed_with(self, snapshot: Snapshot, carried: list[int]) -> Packed:
        """The robot with what it carries; packed anew only when that has changed."""
        links = [snapshot.objects[snapshot.names[k]].link or "" for k in carried]
        key = tuple(link.encode() + snapshot.rows[k].tobytes() for link, k in zip(links, carried, strict=True))
        known = self._packed
        if known[0] == key:
            return known[1]
        for link in links:
            if link not in self.robot.links:
                raise UnknownName("link", link, self.robot.links)
        things = [Carried(self.robot.links.index(link), snapshot.rows[k]) for link, k in zip(links, carried, strict=True)]
        new = pack(self.robot, things)
        self._packed = key, new
        return new
