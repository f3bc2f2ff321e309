"""What contacts do to the motors: J^T f, gathered link by link from the tips to the base (thesis eq. 5.11)."""

from __future__ import annotations

import numpy as np

from mobee.engine.compiled import inner
from mobee.engine.kinematics import LINK
from mobee.engine.pack import (
    DRIVES,
    F_AXIS,
    F_POINT,
    F_SCALE,
    I_BORDER,
    I_KIND,
    I_MOTOR,
    I_PARENT,
    JOINTS,
    UInts,
)
from mobee.robot.robot import Array

_1, _2, _3, _4, _5, _6 = (np.uint64(k) for k in range(1, 7))
_LINK = np.uint64(LINK)


@inner
def push(wrench: Array, link: np.uint64, fx: float, fy: float, fz: float, x: float, y: float, z: float) -> None:
    """Add a force at a point, both in the root frame, to a link's six sums: force, then moment about the origin."""
    o = link * _6
    wrench[o] += fx
    wrench[o + _1] += fy
    wrench[o + _2] += fz
    wrench[o + _3] += y * fz - z * fy
    wrench[o + _4] += z * fx - x * fz
    wrench[o + _5] += x * fy - y * fx


@inner
def project(integers: UInts, floats: Array, links: Array, wrench: Array, cut: bool, torque: Array, row: int) -> None:
    """Add J^T f to torque[row], torque[row + 1], ... of the motors, and use up the wrenches.

    `cut`: a part's motors feel only what happens to its own links, as in the original program.
    """
    joints, parent, kind, motor, scale = integers[JOINTS], integers[I_PARENT], integers[I_KIND], integers[I_MOTOR], integers[F_SCALE]
    axis, point, border = integers[F_AXIS], integers[F_POINT], integers[I_BORDER]
    base = np.uint64(row)
    for back in range(joints):
        j = joints - _1 - back
        o = (j + _1) * _6
        fx, fy, fz, mx, my, mz = wrench[o], wrench[o + _1], wrench[o + _2], wrench[o + _3], wrench[o + _4], wrench[o + _5]
        if fx == 0.0 and fy == 0.0 and fz == 0.0 and mx == 0.0 and my == 0.0 and mz == 0.0:
            continue
        for k in range(_6):
            wrench[o + k] = 0.0
        # A joint leaves its own axis where it is, so the link it moves carries the axis too.
        t, a = (j + _1) * _LINK, axis + _3 * j
        a0, a1, a2 = floats[a], floats[a + _1], floats[a + _2]
        u = links[t] * a0 + links[t + _1] * a1 + links[t + _2] * a2
        v = links[t + _4] * a0 + links[t + _5] * a1 + links[t + _6] * a2
        w = links[t + np.uint64(8)] * a0 + links[t + np.uint64(9)] * a1 + links[t + np.uint64(10)] * a2
        if integers[kind + j] == _1:
            turn = u * fx + v * fy + w * fz
        else:
            p = point + _3 * j
            p0, p1, p2 = floats[p], floats[p + _1], floats[p + _2]
            x = links[t] * p0 + links[t + _1] * p1 + links[t + _2] * p2 + links[t + _3]
            y = links[t + _4] * p0 + links[t + _5] * p1 + links[t + _6] * p2 + links[t + np.uint64(7)]
            z = links[t + np.uint64(8)] * p0 + links[t + np.uint64(9)] * p1 + links[t + np.uint64(10)] * p2 + links[t + np.uint64(11)]
            turn = u * (mx - y * fz + z * fy) + v * (my - z * fx + x * fz) + w * (mz - x * fy + y * fx)
        for slot in range(integers[DRIVES]):
            torque[base + integers[motor + slot * joints + j]] += floats[scale + slot * joints + j] * turn
        if cut and integers[border + j] == _1:
            continue
        o = integers[parent + j] * _6
        wrench[o] += fx
        wrench[o + _1] += fy
        wrench[o + _2] += fz
        wrench[o + _3] += mx
        wrench[o + _4] += my
        wrench[o + _5] += mz
    for k in range(_6):
        wrench[k] = 0.0
