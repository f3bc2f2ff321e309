"""What least squares can aim at, and how it changes with the motors.  Compiled.

An aim binds a first link to a second one, which is the base (link 0) for aims in the root frame; each has a point and a frame, or a
direction in the first three numbers of the frame, all in the root frame at zero pose.
"""

from __future__ import annotations

import math

import numpy as np

from mobee.engine.aim_kinds import ALONG, AT_MOST, COORDINATE, FACING, HOLD, MOTOR, PLACE, TURNED
from mobee.engine.compiled import inner
from mobee.engine.pack import DRIVES, F_AXIS, F_POINT, F_SCALE, I_KIND, I_MOTOR, I_PARENT, JOINTS, UInts
from mobee.robot.robot import Array, Ints

KIND, A_LINK, B_LINK, OF_MOTOR = range(4)
NUMBERS = 4
A_POINT, A_FRAME, B_POINT, B_FRAME, LENGTH, TOLERANCE = 0, 3, 12, 15, 24, 25
REALS = 26

_A, _B, _N, _M = 0, 3, 6, 9  # of what was seen of an aim: its points, and the directions to be made one


@inner
def _carried(frames: Array, link: int, reals: Array, at: int, shift: float, out: Array, to: int) -> None:
    """Where a link carries a point (shift 1) or turns a direction (shift 0)."""
    f = 12 * link
    for row in range(3):
        r = f + 4 * row
        out[to + row] = frames[r] * reals[at] + frames[r + 1] * reals[at + 1] + frames[r + 2] * reals[at + 2] + shift * frames[r + 3]


@inner
def _turn_between(seen: Array, n: int, m: int, errors: Array, e: int) -> float:
    """Fill the shortest turn [rad] from a unit vector to another; returns its angle."""
    x = seen[n + 1] * seen[m + 2] - seen[n + 2] * seen[m + 1]
    y = seen[n + 2] * seen[m] - seen[n] * seen[m + 2]
    z = seen[n] * seen[m + 1] - seen[n + 1] * seen[m]
    sine = math.sqrt(x * x + y * y + z * z)
    angle = math.atan2(sine, seen[n] * seen[m] + seen[n + 1] * seen[m + 1] + seen[n + 2] * seen[m + 2])
    if sine < 1e-9 and angle > 1.0:  # opposite: any axis across will do
        flat = abs(seen[n]) < 0.7
        x, y, z = (0.0, seen[n + 2], -seen[n + 1]) if flat else (-seen[n + 2], 0.0, seen[n])
        sine = math.sqrt(x * x + y * y + z * z)
    scale = angle / sine if sine > 1e-12 else 1.0
    errors[e], errors[e + 1], errors[e + 2] = scale * x, scale * y, scale * z
    return angle


@inner
def _turn_of_frames(frames: Array, numbers: Ints, reals: Array, k: int, errors: Array) -> float:
    """Fill the turn [rad] from the first frame to the second; returns its angle."""
    a, b, at, e = 12 * numbers[NUMBERS * k + A_LINK], 12 * numbers[NUMBERS * k + B_LINK], REALS * k, 3 * k
    # The turn is B A^T, summed column by column of the frames.
    xx = xy = xz = yx = yy = yz = zx = zy = zz = 0.0
    for c in range(3):
        p, q = at + A_FRAME + c, at + B_FRAME + c
        u = frames[a] * reals[p] + frames[a + 1] * reals[p + 3] + frames[a + 2] * reals[p + 6]
        v = frames[a + 4] * reals[p] + frames[a + 5] * reals[p + 3] + frames[a + 6] * reals[p + 6]
        w = frames[a + 8] * reals[p] + frames[a + 9] * reals[p + 3] + frames[a + 10] * reals[p + 6]
        f = frames[b] * reals[q] + frames[b + 1] * reals[q + 3] + frames[b + 2] * reals[q + 6]
        g = frames[b + 4] * reals[q] + frames[b + 5] * reals[q + 3] + frames[b + 6] * reals[q + 6]
        h = frames[b + 8] * reals[q] + frames[b + 9] * reals[q + 3] + frames[b + 10] * reals[q + 6]
        xx, xy, xz = xx + f * u, xy + f * v, xz + f * w
        yx, yy, yz = yx + g * u, yy + g * v, yz + g * w
        zx, zy, zz = zx + h * u, zy + h * v, zz + h * w
    x, y, z = zy - yz, xz - zx, yx - xy
    sine, cosine = 0.5 * math.sqrt(x * x + y * y + z * z), 0.5 * (xx + yy + zz - 1.0)
    angle = math.atan2(sine, cosine)
    if sine < 1e-7 and cosine < 0.0:  # half a turn: the axis is the longest column of R + I
        if xx >= yy and xx >= zz:
            x, y, z = xx + 1.0, yx, zx
        elif yy >= zz:
            x, y, z = xy, yy + 1.0, zy
        else:
            x, y, z = xz, yz, zz + 1.0
    length = math.sqrt(x * x + y * y + z * z)
    scale = angle / length if length > 1e-12 else 0.5
    errors[e], errors[e + 1], errors[e + 2] = scale * x, scale * y, scale * z
    return angle


@inner
def see(numbers: Ints, reals: Array, k: int, q: Array, first: int, frames: Array, seen: Array, errors: Array) -> float:
    """What is missing of aim k: fills its three errors [m or rad], what `slopes` needs of it, and returns the residual.

    q[first], q[first + 1], ...: where the motors are.
    """
    kind, a, b = numbers[NUMBERS * k + KIND], numbers[NUMBERS * k + A_LINK], numbers[NUMBERS * k + B_LINK]
    at, s, e = REALS * k, 12 * k, 3 * k
    if kind == MOTOR:
        errors[e], errors[e + 1], errors[e + 2] = reals[at + LENGTH] - q[first + numbers[NUMBERS * k + OF_MOTOR]], 0.0, 0.0
        return abs(errors[e])
    _carried(frames, a, reals, at + A_POINT, 1.0, seen, s + _A)
    _carried(frames, b, reals, at + B_POINT, 1.0, seen, s + _B)
    if kind == TURNED:
        return _turn_of_frames(frames, numbers, reals, k, errors)
    x, y, z = (seen[s + _B] - seen[s + _A], seen[s + _B + 1] - seen[s + _A + 1], seen[s + _B + 2] - seen[s + _A + 2])
    far = math.sqrt(x * x + y * y + z * z)
    if kind == PLACE:
        errors[e], errors[e + 1], errors[e + 2] = x, y, z
        return far
    if kind == HOLD:
        longer = far - reals[at + LENGTH]
        errors[e], errors[e + 1], errors[e + 2] = longer, 0.0, 0.0
        return abs(longer)
    if kind == COORDINATE or kind == AT_MOST:
        missing = reals[at + LENGTH] + reals[at + B_FRAME] * x + reals[at + B_FRAME + 1] * y + reals[at + B_FRAME + 2] * z
        counts = 1.0 if kind == COORDINATE or missing < 0.0 else 0.0
        missing *= counts
        for row in range(3):
            seen[s + _N + row] = counts * reals[at + B_FRAME + row]
        errors[e], errors[e + 1], errors[e + 2] = missing, 0.0, 0.0
        return abs(missing)
    _carried(frames, a, reals, at + A_FRAME, 0.0, seen, s + _N)
    if kind == ALONG:
        _carried(frames, b, reals, at + B_FRAME, 0.0, seen, s + _M)
    else:
        scale = 1.0 / max(far, 1e-9)
        seen[s + _M], seen[s + _M + 1], seen[s + _M + 2] = scale * x, scale * y, scale * z
    return _turn_between(seen, s + _N, s + _M, errors, e)


@inner
def _add_column(
    kind: int, sign: float, slides: bool, ux: float, uy: float, uz: float, vx: float, vy: float, vz: float,
    seen: Array, s: int, jacobian: Array, at: int, d: int, turn: float,
) -> None:  # fmt: skip
    """Add what a motor does through one joint: its point moves by v, its frame turns by u; sign -1: the second side of an aim."""
    if kind == PLACE:
        jacobian[at] += sign * vx
        jacobian[at + d] += sign * vy
        jacobian[at + 2 * d] += sign * vz
        return
    if kind == HOLD:
        x, y, z = (seen[s + _B] - seen[s + _A], seen[s + _B + 1] - seen[s + _A + 1], seen[s + _B + 2] - seen[s + _A + 2])
        jacobian[at] += sign * (x * vx + y * vy + z * vz) / max(math.sqrt(x * x + y * y + z * z), 1e-9)
        return
    if kind == COORDINATE or kind == AT_MOST:
        jacobian[at] += sign * (seen[s + _N] * vx + seen[s + _N + 1] * vy + seen[s + _N + 2] * vz)
        return
    wx, wy, wz = (0.0, 0.0, 0.0) if slides else (ux, uy, uz)
    if kind == FACING:
        x, y, z = (seen[s + _B] - seen[s + _A], seen[s + _B + 1] - seen[s + _A + 1], seen[s + _B + 2] - seen[s + _A + 2])
        nearer = 1.0 / max(x * x + y * y + z * z, 1e-12)
        if sign < 0.0:
            wx, wy, wz = 0.0, 0.0, 0.0
        # The direction to the second point turns by (point to point) x (velocity of the second) / distance^2.
        wx += sign * nearer * (y * vz - z * vy)
        wy += sign * nearer * (z * vx - x * vz)
        wz += sign * nearer * (x * vy - y * vx)
        sign = 1.0
    if kind != TURNED:  # what turns about the direction itself does not move it
        along = wx * seen[s + _N] + wy * seen[s + _N + 1] + wz * seen[s + _N + 2]
        wx, wy, wz = wx - along * seen[s + _N], wy - along * seen[s + _N + 1], wz - along * seen[s + _N + 2]
    jacobian[at] += sign * turn * wx
    jacobian[at + d] += sign * turn * wy
    jacobian[at + 2 * d] += sign * turn * wz


@inner
def slopes(
    integers: UInts,
    floats: Array,
    numbers: Ints,
    frames: Array,
    seen: Array,
    column: Ints,
    turn: float,
    jacobian: Array,
    d: int,
) -> None:
    """Fill how the aims come nearer with the motors, (3 K d,), where they were seen last; `column` (n,): of a motor, -1: none."""
    joints = np.int64(integers[JOINTS])
    for k in range(len(jacobian)):
        jacobian[k] = 0.0
    for k in range(len(numbers) // NUMBERS):
        kind = numbers[NUMBERS * k + KIND]
        if kind == MOTOR:
            moves = column[numbers[NUMBERS * k + OF_MOTOR]]
            if moves >= 0:
                jacobian[3 * k * d + moves] = turn
            continue
        for side in range(2):
            here = numbers[NUMBERS * k + A_LINK + side]
            p, sign = 12 * k + 3 * side, 1.0 - 2.0 * side
            while here > 0:
                j, t = here - 1, 12 * here
                a, o = np.int64(integers[F_AXIS]) + 3 * j, np.int64(integers[F_POINT]) + 3 * j
                ux = frames[t] * floats[a] + frames[t + 1] * floats[a + 1] + frames[t + 2] * floats[a + 2]
                uy = frames[t + 4] * floats[a] + frames[t + 5] * floats[a + 1] + frames[t + 6] * floats[a + 2]
                uz = frames[t + 8] * floats[a] + frames[t + 9] * floats[a + 1] + frames[t + 10] * floats[a + 2]
                ox, oy, oz = floats[o], floats[o + 1], floats[o + 2]
                x = seen[p] - (frames[t] * ox + frames[t + 1] * oy + frames[t + 2] * oz + frames[t + 3])
                y = seen[p + 1] - (frames[t + 4] * ox + frames[t + 5] * oy + frames[t + 6] * oz + frames[t + 7])
                z = seen[p + 2] - (frames[t + 8] * ox + frames[t + 9] * oy + frames[t + 10] * oz + frames[t + 11])
                slides = integers[np.int64(integers[I_KIND]) + j] == np.uint64(1)
                vx, vy, vz = (ux, uy, uz) if slides else (uy * z - uz * y, uz * x - ux * z, ux * y - uy * x)
                for slot in range(np.int64(integers[DRIVES])):
                    c = column[np.int64(integers[np.int64(integers[I_MOTOR]) + slot * joints + j])]
                    scale = floats[np.int64(integers[F_SCALE]) + slot * joints + j]
                    if c >= 0 and scale != 0.0:
                        _add_column(
                            kind, sign, slides, scale * ux, scale * uy, scale * uz, scale * vx, scale * vy, scale * vz,
                            seen, 12 * k, jacobian, 3 * k * d + c, d, turn,
                        )  # fmt: skip
                here = np.int64(integers[np.int64(integers[I_PARENT]) + j])
