"""Damped least squares from many starts, for what has a derivative: places, directions and distances of points on links.  Compiled.

Levenberg and Marquardt: the damping falls after a step that helped and grows after one that did not; a motor at its limit that would be
pushed beyond it is left out.
"""

from __future__ import annotations

import math

import numpy as np

from mobee.engine.aim_kinds import AT_MOST, COORDINATE, HOLD, PLACE
from mobee.engine.aims import A_LINK, B_LINK, KIND, NUMBERS, REALS, TOLERANCE, see, slopes
from mobee.engine.compiled import entry, inner
from mobee.engine.kinematics import joint_angles, place_links, sines_cosines
from mobee.engine.pack import I_PARENT, JOINTS, LINKS, MOTORS, Flags, UInts
from mobee.robot.robot import Array, Ints

TURN = 0.2  # m/rad: what an error of direction counts beside one of place
LONGEST = 0.3  # of a motor's range, in one step
CLOSE = 0.1  # of every tolerance: there is no need to come nearer
_GROW, _FALL, _LEAST, _MOST = 6.0, 0.25, 1e-9, 1e6  # of the damping


@inner
def _look(
    integers: UInts, floats: Array, numbers: Ints, reals: Array, q: Array, first: int,
    angles: Array, sines: Array, cosines: Array, moved: Flags, frames: Array, seen: Array, errors: Array, residuals: Array, at: int,
) -> float:  # fmt: skip
    """Place the links at q[first], q[first + 1], ...; fill the errors (3 K,) and the residuals from `at` on; half the squared sum."""
    joint_angles(integers, floats, q, first, angles)
    sines_cosines(angles, sines, cosines)
    place_links(integers, floats, angles, sines, cosines, moved, frames)
    total = 0.0
    for k in range(len(numbers) // NUMBERS):
        residuals[at + k] = see(numbers, reals, k, q, first, frames, seen, errors)
        kind = numbers[NUMBERS * k + KIND]
        weight = 1.0 if kind == PLACE or kind == HOLD or kind == COORDINATE or kind == AT_MOST else TURN
        for row in range(3 * k, 3 * k + 3):
            errors[row] *= weight
            total += 0.5 * errors[row] * errors[row]
    return total


@inner
def _solve(matrix: Array, right: Array, rows: int) -> None:
    """Solve a symmetric positive definite system (rows, rows) in place by Cholesky's method."""
    for i in range(rows):
        for j in range(i + 1):
            total = matrix[i * rows + j]
            for k in range(j):
                total -= matrix[i * rows + k] * matrix[j * rows + k]
            matrix[i * rows + j] = math.sqrt(max(total, 1e-300)) if i == j else total / matrix[j * rows + j]
    for i in range(rows):
        for k in range(i):
            right[i] -= matrix[i * rows + k] * right[k]
        right[i] /= matrix[i * rows + i]
    for i in range(rows - 1, -1, -1):
        for k in range(i + 1, rows):
            right[i] -= matrix[k * rows + i] * right[k]
        right[i] /= matrix[i * rows + i]


@inner
def _step(
    jacobian: Array, errors: Array, damping: float, low: Array, high: Array, q: Array, first: int, free: Ints,
    held: Flags, matrix: Array, right: Array, step: Array,
) -> None:  # fmt: skip
    """Fill the step (d,): what the damped system says, without motors that it would push beyond a limit at which they are."""
    rows, d = len(errors), len(free)
    for c in range(d):
        held[c] = False
    for _ in range(4):
        for i in range(rows):
            right[i] = errors[i]
            for j in range(i + 1):
                total = damping if i == j else 0.0
                for c in range(d):
                    if not held[c]:
                        total += jacobian[i * d + c] * jacobian[j * d + c]
                matrix[i * rows + j] = total
        _solve(matrix, right, rows)
        again = False
        for c in range(d):
            step[c] = 0.0
            if held[c]:
                continue
            for i in range(rows):
                step[c] += jacobian[i * d + c] * right[i]
            here = q[first + free[c]]
            if (here <= low[c] and step[c] < 0.0) or (here >= high[c] and step[c] > 0.0):
                held[c] = again = True
        if not again:
            break
    longest = 0.0
    for c in range(d):
        longest = max(longest, abs(step[c]) / (high[c] - low[c]))
    if longest > LONGEST:
        for c in range(d):
            step[c] *= LONGEST / longest


@inner
def _arrived(numbers: Ints, reals: Array, residuals: Array, at: int) -> bool:
    """Whether every aim is met, and closer than its tolerance asks."""
    for k in range(len(numbers) // NUMBERS):
        if not residuals[at + k] <= CLOSE * reals[REALS * k + TOLERANCE]:
            return False
    return True


@entry(
    "Tuple((int64, float64[:,::1]))("
    "uint64[::1], float64[::1], int64[::1], float64[:,::1], int64[::1], float64[::1], float64[::1], int64, float64[:,::1])"
)
def descend(
    integers: UInts, floats: Array, numbers: Ints, reals: Array, free: Ints, low: Array, high: Array, most: int, starts: Array
) -> tuple[int, Array]:
    """Move the free motors (d,) of every start (B, n), in place, to meet the aims; returns evaluations and residuals (B, K).

    `numbers`, `reals`: of K aims, see `aims`; of the reals one row for all starts, or one for each; low, high: (d,) rad; `most`: steps of
    one start.
    """
    joints, links, motors = np.int64(integers[JOINTS]), np.int64(integers[LINKS]), np.int64(integers[MOTORS])
    aims, d = len(numbers) // NUMBERS, len(free)
    rows = 3 * aims
    angles, sines, cosines, frames = np.empty(joints), np.empty(joints), np.empty(joints), np.empty(12 * links)
    column, moved = np.full(motors, -1), np.zeros(links, dtype=np.bool_)
    for c in range(d):
        column[free[c]] = c
    for k in range(aims):
        for link in (numbers[NUMBERS * k + A_LINK], numbers[NUMBERS * k + B_LINK]):
            while link > 0:
                moved[link] = True
                link = np.int64(integers[np.int64(integers[I_PARENT]) + link - 1])
    seen, errors, fresh, jacobian = np.empty(12 * aims), np.empty(rows), np.empty(rows), np.empty(rows * d)
    held, matrix, right, step, trial = np.empty(d, dtype=np.bool_), np.empty(rows * rows), np.empty(rows), np.empty(d), np.empty(motors)
    residuals, tried = np.empty((len(starts), aims)), np.empty(aims)
    found, flat = residuals.ravel(), starts.ravel()
    evaluations = 0
    for b in range(len(starts)):
        goals = reals[b if len(reals) > 1 else 0]
        first, at, damping, stale = b * motors, b * aims, 1e-3, True
        cost = _look(integers, floats, numbers, goals, flat, first, angles, sines, cosines, moved, frames, seen, errors, found, at)
        evaluations += 1
        for _ in range(most):
            if _arrived(numbers, goals, found, at) or damping > _MOST:
                break
            if stale:
                slopes(integers, floats, numbers, frames, seen, column, TURN, jacobian, d)
            _step(jacobian, errors, damping, low, high, flat, first, free, held, matrix, right, step)
            trial[:] = starts[b]
            for c in range(d):
                trial[free[c]] = min(max(trial[free[c]] + step[c], low[c]), high[c])
            new = _look(integers, floats, numbers, goals, trial, 0, angles, sines, cosines, moved, frames, seen, fresh, tried, 0)
            evaluations += 1
            stale = new < cost
            if not stale:
                damping *= _GROW
                continue
            slow = new > (1.0 - 1e-6) * cost
            damping, cost = max(_LEAST, damping * _FALL), new
            starts[b] = trial
            errors[:] = fresh
            residuals[b] = tried
            if slow:
                break
    return evaluations, residuals
