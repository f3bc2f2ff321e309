"""The engine of one robot: keeps what compiled code works on, for any number of threads."""

from __future__ import annotations

import numpy as np

from mobee.collision.contact import ContactTable
from mobee.collision.snapshot import ATTACHED, Snapshot
from mobee.engine import evaluate
from mobee.engine.pack import Carried, Packed, pack
from mobee.engine.room import Room
from mobee.engine.rows import NUMBERS, REALS
from mobee.engine.scene import Scene, scene
from mobee.errors import UnknownName
from mobee.robot.robot import Array, Ints, Robot


class Engine:
    """Evaluates poses of one robot; evaluations in several threads do not wait for each other."""

    def __init__(self, robot: Robot) -> None:
        self.robot = robot
        self._shapes = tuple(shape.name for shape in robot.shapes)
        self._packed: tuple[tuple[bytes, ...], Packed] = (), pack(robot)
        self._scene: Scene | None = None
        self._rooms: list[Room] = []  # of evaluations that have ended

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

        `reaching`: links that spare the targets, see `hands`; `cut`: see `project`.
        """
        here = self.scene_of(snapshot)
        packed, own = here.packed, len(self.robot.shapes)
        try:
            room = self._rooms.pop()  # as one step: other threads take rooms too
        except IndexError:
            room = Room()
        room.settle(here)
        torque = np.zeros(q.shape)
        written: list[tuple[Ints, Array]] = []
        done, used = 0, 0
        while done < len(q):
            if used:
                written.append((room.numbers[: used * NUMBERS].copy(), room.reals[: used * REALS].copy()))
            done, used = evaluate.contacts(
                packed.integers, packed.floats, packed.vertices, here.integers, here.floats, here.carried, own, reaching, cut, q, done,
                room.slots, room.work, room.lists, room.spare, room.flags, room.numbers, room.reals, torque,
            )  # fmt: skip
        numbers, reals = room.numbers[: used * NUMBERS].copy(), room.reals[: used * REALS].copy()
        self._rooms.append(room)
        if written:
            numbers = np.concatenate([*(one for one, _ in written), numbers])
            reals = np.concatenate([*(one for _, one in written), reals])
        return self.table(snapshot, numbers, reals), torque

    def table(self, snapshot: Snapshot, numbers: Ints, reals: Array) -> ContactTable:
        """The table of what compiled code has written."""
        return ContactTable(self._shapes, snapshot.names, numbers.reshape(-1, NUMBERS), reals.reshape(-1, REALS))

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
        things = []
        for link, k in zip(links, carried, strict=True):
            row = snapshot.rows[k]
            flat = np.array([row["kind"], *row["position"], *row["rotation"].ravel(), *row["half"], row["bound"]])
            things.append(Carried(self.robot.links.index(link), flat))
        new = pack(self.robot, things)
        self._packed = key, new
        return new


def engine_of(robot: Robot) -> Engine:
    """The engine of a robot."""
    from mobee.engine.load import load

    load()
    return Engine(robot)
