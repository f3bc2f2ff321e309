"""The memory that evaluations work in, kept for the next one: fresh memory costs more than the arithmetic of a pose."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from mobee.engine.evaluate import settle
from mobee.engine.layout import SLOT
from mobee.engine.pack import CLUSTERS, JOINTS, LINKS, UInts
from mobee.engine.rows import NUMBERS, REALS
from mobee.engine.scene import COUNT, Scene
from mobee.robot.robot import Array, Ints

ROWS = 8192  # contacts; what a batch finds beyond is handed over and written anew, so that this stays in the cache


class Room:
    """Arrays for one evaluation at a time, large enough for one scene, settled for it."""

    def __init__(self) -> None:
        self.scene: Scene | None = None
        self.most = 0  # pairs, and so contacts, of a pose
        self.slots: Array = np.empty(0)
        self.work: Array = np.empty(0)
        self.lists: UInts = np.empty(0, dtype=np.uint64)
        self.spare: Ints = np.empty(0, dtype=np.int64)
        self.numbers: Ints = np.empty(0, dtype=np.int64)
        self.reals: Array = np.empty(0)

    def settle(self, scene: Scene) -> None:
        """Make it fit a scene; costs nothing if it is the last one."""
        if self.scene is scene:
            return
        packed, header = scene.packed, scene.packed.integers
        joints, links, groups = int(header[JOINTS]), int(header[LINKS]), int(header[CLUSTERS])
        shapes, objects = len(packed.order), int(scene.integers[COUNT])
        most = self.most = shapes * (shapes + 1) // 2 + shapes * objects
        self.slots = at_least(self.slots, (shapes + objects) * SLOT)
        self.work = at_least(self.work, 3 * joints + 18 * links + 3 * shapes + 4 * groups + 6 + 4 * objects + REALS * most)
        self.lists = at_least(self.lists, 2 * most + objects)
        self.spare = at_least(self.spare, (NUMBERS + 2) * most)
        self.numbers = at_least(self.numbers, NUMBERS * max(ROWS, most))
        self.reals = at_least(self.reals, REALS * max(ROWS, most))
        settle(header, packed.floats, scene.integers, scene.snapshot.rows.reshape(-1), self.slots)
        self.scene = scene


def at_least(room: NDArray[Any], length: int) -> NDArray[Any]:
    """The array if it is long enough, else a new one with some to spare; what is never touched takes no memory."""
    return room if len(room) >= length else np.empty(length + length // 4, dtype=room.dtype)
