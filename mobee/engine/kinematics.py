"""Forward kinematics of one pose: the product of exponentials over the tree (Gupta's zero reference position, thesis 2.3.1)."""

from __future__ import annotations

import math

import numpy as np

from mobee.engine.compiled import inner, inner_as_written
from mobee.engine.pack import (
    DRIVES,
    F_OFFSET,
    F_ROTATION,
    F_SCALE,
    F_SHIFT,
    I_KIND,
    I_MOTOR,
    I_PARENT,
    JOINTS,
    Flags,
    UInts,
)
from mobee.robot.robot import Array

LINK = 12  # floats of a link: its rotation and shift, three rows of four

_LARGE = 1e5  # rad: beyond it the reduction below loses digits
_PI_2_HIGH, _PI_2_MIDDLE, _PI_2_LOW = 1.5707963267341256, 6.077100506303966e-11, 2.0222662487959506e-21
_U1, _U2, _U3, _U9, _U12 = np.uint64(1), np.uint64(2), np.uint64(3), np.uint64(9), np.uint64(12)


@inner
def joint_angles(integers: UInts, floats: Array, q: Array, first: int, angles: Array) -> None:
    """Fill `angles` (J,) from the motors at q[first], q[first + 1], ..."""
    joints, start = integers[JOINTS], np.uint64(first)
    offset, scale, motor = integers[F_OFFSET], integers[F_SCALE], integers[I_MOTOR]
    for j in range(joints):
        angles[j] = floats[offset + j]
    for slot in range(integers[DRIVES]):
        for j in range(joints):
            angles[j] += floats[scale + slot * joints + j] * q[start + integers[motor + slot * joints + j]]


@inner_as_written
def sines_cosines(angles: Array, sines: Array, cosines: Array) -> None:
    """Fill sin and 1 - cos of every angle, to the last bits: reduction to a quarter turn (Cody and Waite), then Taylor to 1e-17."""
    largest = 0.0
    count = np.uint64(len(angles))
    for j in range(count):
        largest = max(largest, abs(angles[j]))
    if not largest < _LARGE:
        for j in range(count):
            sines[j], cosines[j] = math.sin(angles[j]), 1.0 - math.cos(angles[j])
        return
    for j in range(count):
        quarter = math.floor(angles[j] * 0.6366197723675814 + 0.5)
        x = ((angles[j] - quarter * _PI_2_HIGH) - quarter * _PI_2_MIDDLE) - quarter * _PI_2_LOW
        z = x * x
        s = z * (1.6059043836821613e-10 - z * 7.647163731819816e-13)
        s = z * (-1.984126984126984e-04 + z * (2.7557319223985893e-06 - z * 2.505210838544172e-08 + z * s))
        s = x + x * z * (-1.6666666666666666e-01 + z * 8.333333333333333e-03 + z * s)
        c = z * (2.08767569878681e-09 - z * (1.1470745597729725e-11 - z * 4.779477332387385e-14))
        c = z * (-1.3888888888888889e-03 + z * (2.48015873015873e-05 - z * 2.755731922398589e-07 + z * c))
        c = z * (0.5 - z * (4.1666666666666664e-02 + c))
        turn = quarter - 4.0 * math.floor(quarter * 0.25)
        odd = turn == 1.0 or turn == 3.0
        big, small = (1.0 - c if odd else s), (s if odd else 1.0 - c)
        sines[j] = -big if turn >= 2.0 else big
        cosines[j] = c if turn == 0.0 else 1.0 - (-small if turn == 1.0 or turn == 2.0 else small)


@inner
def place_links(integers: UInts, floats: Array, angles: Array, sines: Array, cosines: Array, moved: Flags, links: Array) -> None:
    """Fill `links` (12 L,), three rows of (rotation, shift) a link, where `moved` (L,) says so; the base stands still."""
    for k in range(_U12):
        links[k] = 0.0
    links[0], links[5], links[10] = 1.0, 1.0, 1.0
    parent, kind, turn, shift = integers[I_PARENT], integers[I_KIND], integers[F_ROTATION], integers[F_SHIFT]
    u3 = np.uint64(3)
    u4, u5, u6, u7, u8, u10, u11 = np.uint64(4), np.uint64(5), np.uint64(6), np.uint64(7), np.uint64(8), np.uint64(10), np.uint64(11)
    for j in range(integers[JOINTS]):
        if not moved[j + _U1]:
            continue
        p, o, f, g = integers[parent + j] * _U12, (j + _U1) * _U12, turn + _U9 * j, shift + u6 * j
        s, c = sines[j], cosines[j]
        r00, r01, r02, t0 = links[p], links[p + _U1], links[p + _U2], links[p + u3]
        r10, r11, r12, t1 = links[p + u4], links[p + u5], links[p + u6], links[p + u7]
        r20, r21, r22, t2 = links[p + u8], links[p + _U9], links[p + u10], links[p + u11]
        if integers[kind + j] == _U1:
            x, y, z = angles[j] * floats[g], angles[j] * floats[g + _U1], angles[j] * floats[g + _U2]
            links[o], links[o + _U1], links[o + _U2] = r00, r01, r02
            links[o + u4], links[o + u5], links[o + u6] = r10, r11, r12
            links[o + u8], links[o + _U9], links[o + u10] = r20, r21, r22
        else:
            ux, uy, uz = s * floats[f], s * floats[f + _U1], s * floats[f + _U2]
            xx, yy, zz = 1.0 + c * floats[f + _U3], 1.0 + c * floats[f + u4], 1.0 + c * floats[f + u5]
            xy, xz, yz = c * floats[f + u6], c * floats[f + u7], c * floats[f + u8]
            x = s * floats[g] + c * floats[g + u3]
            y = s * floats[g + _U1] + c * floats[g + u4]
            z = s * floats[g + _U2] + c * floats[g + u5]
            links[o] = r00 * xx + r01 * (xy + uz) + r02 * (xz - uy)
            links[o + _U1] = r00 * (xy - uz) + r01 * yy + r02 * (yz + ux)
            links[o + _U2] = r00 * (xz + uy) + r01 * (yz - ux) + r02 * zz
            links[o + u4] = r10 * xx + r11 * (xy + uz) + r12 * (xz - uy)
            links[o + u5] = r10 * (xy - uz) + r11 * yy + r12 * (yz + ux)
            links[o + u6] = r10 * (xz + uy) + r11 * (yz - ux) + r12 * zz
            links[o + u8] = r20 * xx + r21 * (xy + uz) + r22 * (xz - uy)
            links[o + _U9] = r20 * (xy - uz) + r21 * yy + r22 * (yz + ux)
            links[o + u10] = r20 * (xz + uy) + r21 * (yz - ux) + r22 * zz
        links[o + u3] = r00 * x + r01 * y + r02 * z + t0
        links[o + u7] = r10 * x + r11 * y + r12 * z + t1
        links[o + u11] = r20 * x + r21 * y + r22 * z + t2
