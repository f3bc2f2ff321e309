"""The memory that evaluations work in, kept for the next one: fresh memory costs more than the arithmetic of a pose."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from mobee.engine.evaluate import settle
from mobee.engine.layout import SLOT
from mobee.engine.memory import most_pairs, sizes
from mobee.engine.pack import CLUSTERS, JOINTS, LINKS, Flags, UInts
from mobee.engine.rows import NUMBERS, REALS
from mobee.engine.scene import COUNT, Scene
from mobee.robot.robot import Array, Ints

ROWS = 8192  # contacts; what a batch finds beyond is handed over and written anew, so that this stays in the cache


class Room:
    """Arrays for one evaluation at a time, large enough for one scene, settled for it."""

    def __init__(self) -> None:
        self.scene: Scene | None = None
        self.slots: Array = np.empty(0)
        self.work: Array = np.empty(0)
        self.lists: UInts = np.empty(0, dtype=np.uint64)
        self.spare: Ints = np.empty(0, dtype=np.int64)
        self.flags: Flags = np.empty(0, dtype=np.bool_)
        self.numbers: Ints = np.empty(0, dtype=np.int64)
        self.reals: Array = np.empty(0)

    def settle(self, scene: Scene) -> None:
        """Make it fit a scene; costs nothing if it is the last one."""
        if self.scene is scene:
            return
        packed, header = scene.packed, scene.packed.integers
        shapes, objects = len(packed.order), int(scene.integers[COUNT])
        most = most_pairs(shapes, objects)
        floats, lists, spare, flags = sizes(int(header[JOINTS]), int(header[LINKS]), shapes, int(header[CLUSTERS]), objects)
        self.slots = at_least(self.slots, (shapes + objects) * SLOT)
        self.work = at_least(self.work, floats)
        self.lists = at_least(self.lists, lists)
        self.spare = at_least(self.spare, spare)
        self.flags = at_least(self.flags, flags)
        self.numbers = at_least(self.numbers, NUMBERS * max(ROWS, most))
        self.reals = at_least(self.reals, REALS * max(ROWS, most))
        settle(header, packed.floats, scene.integers, scene.rows, self.slots)
        self.scene = scene


def at_least(room: NDArray[Any], length: int) -> NDArray[Any]:
    """The array if it is long enough, else a new one with some to spare; what is never touched takes no memory."""
    return room if len(room) >= length else np.empty(length + length // 4, dtype=room.dtype)
