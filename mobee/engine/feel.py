"""What every evaluation of a pose begins and ends with: shapes are placed, contacts become forces on the motors."""

from __future__ import annotations

import numpy as np

from mobee.engine.compiled import inlined, inner
from mobee.engine.forces import project
from mobee.engine.kinematics import place_links, sines_cosines
from mobee.engine.memory import Memory
from mobee.engine.pack import UInts
from mobee.engine.place import place_shapes
from mobee.engine.rows import push_links, sort_rows
from mobee.robot.robot import Array


@inlined
def place(integers: UInts, floats: Array, slots: Array, memory: Memory) -> None:
    """Place the links and shapes that have moved, at the angles of the memory."""
    sines_cosines(memory.angles, memory.sines, memory.cosines)
    place_links(integers, floats, memory.angles, memory.sines, memory.cosines, memory.moved, memory.frames)
    place_shapes(integers, floats, memory.frames, memory.moved, slots, memory.x, memory.y, memory.z)


@inner
def feel(integers: UInts, floats: Array, count: np.uint64, cut: bool, memory: Memory, torque: Array) -> None:
    """Put the contacts found in order, and add what they do to the motors to `torque` (n,); `cut`: see `project`."""
    sort_rows(memory.found_numbers, count, memory.keys, memory.order)
    push_links(memory.found_numbers, memory.found_reals, memory.order, count, memory.wrench)
    project(integers, floats, memory.frames, memory.wrench, cut, torque, 0)
