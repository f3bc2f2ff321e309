"""A path of poses as a motion in time: corners rounded, no motor faster or harder accelerated than it may be."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from mobee.errors import InvalidValue
from mobee.real_array import real_array
from mobee.robot.robot import Array

ROUNDING = 0.1  # rad
STEP = 0.002  # rad along the path, between two places at which its speed is limited
_SAME = 1e-9  # rad


@dataclass(frozen=True, slots=True, eq=False)
class Reference:
    """Where the motors are to be: q, velocity and acceleration (T, n) rad, rad/s, rad/s^2 at times (T,) s; at rest at both ends."""

    times: Array
    q: Array
    velocity: Array
    acceleration: Array


def reference(path: ArrayLike, speeds: ArrayLike, accelerations: ArrayLike, rounding: float = ROUNDING, dt: float = 0.01) -> Reference:
    """The motion along a path (K, n) rad within the motors' speeds (n,) rad/s and accelerations (n,) rad/s^2, a row each dt s.

    `rounding`: how far before and behind a corner [rad, of all motors together] the motion leaves the path, at most half way to the
    next; it passes the corner in half that distance or less.  0: it stops there instead.
    """
    corners, fastest, hardest = (
        real_array("path", path),
        np.asarray(speeds, dtype=np.float64),
        np.asarray(accelerations, dtype=np.float64),
    )
    _require(corners, fastest, hardest, rounding, dt)
    moves = np.ptp(corners, axis=0) > 0.0
    moving = corners[:, moves]
    moving = moving[np.concatenate([[True], np.linalg.norm(np.diff(moving, axis=0), axis=1) > _SAME])]
    pieces = [rounded(moving, rounding)] if rounding > 0.0 else [rounded(pair, 0.0) for pair in zip(moving, moving[1:], strict=False)]
    motions = [_timed(piece, fastest[moves], hardest[moves], dt) for piece in pieces if len(piece) > 1]
    rows = 1 + sum(len(one[0]) - 1 for one in motions)
    q, velocity, acceleration = np.tile(corners[0], (rows, 1)), np.zeros((rows, len(moves))), np.zeros((rows, len(moves)))
    first = 0
    for one in motions:
        for whole, part in zip((q, velocity, acceleration), one, strict=True):
            whole[first : first + len(part), moves] = part
        first += len(one[0]) - 1
    q[-1] = corners[-1]
    times: Array = dt * np.arange(float(rows))
    return Reference(times, q, velocity, acceleration)


def rounded(corners: ArrayLike, rounding: float) -> Array:
    """Places along a path (K, n), about STEP apart, (S, n): straight, with a parabola at each corner."""
    points = real_array("corners", corners)
    ways = np.diff(points, axis=0)
    far = np.linalg.norm(ways, axis=1)
    ways = ways / far[:, None]
    found, here = [points[:1]], points[0]
    for k in range(1, len(points)):
        last = k == len(points) - 1
        cut = 0.0 if last else min(rounding, 0.5 * far[k - 1], 0.5 * far[k])
        before = points[k] - cut * ways[k - 1]
        found.append(_line(here, before))
        here = before
        if cut > 0.0:
            behind = points[k] + cut * ways[k]
            share = np.linspace(0.0, 1.0, max(4, int(2.0 * cut / STEP)) + 1)[1:, None]
            found.append((1.0 - share) ** 2 * before + 2.0 * share * (1.0 - share) * points[k] + share**2 * behind)
            here = behind
    return np.concatenate(found)


def _line(start: Array, end: Array) -> Array:
    far = float(np.linalg.norm(end - start))
    if far <= _SAME:
        return np.empty((0, len(start)))
    share = np.linspace(0.0, 1.0, max(4, int(far / STEP)) + 1)[1:, None]
    places: Array = start + share * (end - start)
    return places


def _timed(places: Array, speeds: Array, accelerations: Array, dt: float) -> tuple[Array, Array, Array]:
    """A motion over places (S, n), as fast as the limits let it: q, velocity and acceleration (T, n), a row each dt s."""
    from scipy.interpolate import CubicHermiteSpline

    ways = np.linalg.norm(np.diff(places, axis=0), axis=1)
    along = np.concatenate([[0.0], np.cumsum(ways)])
    tangent = np.gradient(places, along, axis=0)
    bend = np.gradient(tangent, along, axis=0)
    speed = _speeds(ways, tangent, bend, speeds, accelerations)
    spans = 2.0 * ways / (speed[1:] + speed[:-1])  # s, of even acceleration
    when, gains = np.concatenate([[0.0], np.cumsum(spans)]), np.diff(speed) / spans
    where = CubicHermiteSpline(along, places, tangent)
    stretch = 1.0
    while True:  # what was interpolated may be a little too fast between the places: then all is a little slower
        count = max(1, int(np.ceil(when[-1] * stretch / dt)))
        moments = np.linspace(0.0, when[-1], count + 1)
        last = np.clip(np.searchsorted(when, moments, side="right") - 1, 0, len(spans) - 1)
        since = moments - when[last]
        q = where(along[last] + speed[last] * since + 0.5 * gains[last] * since**2)
        q[0], q[-1] = places[0], places[-1]
        steps = np.zeros((count + 2, len(speeds)))  # at rest before and behind
        steps[1:-1] = np.diff(q, axis=0) / dt
        acceleration = np.diff(steps, axis=0) / dt
        excess = max(float((np.abs(steps) / speeds).max()), float(np.sqrt((np.abs(acceleration) / accelerations).max())))
        if excess <= 1.0:
            velocity = 0.5 * (steps[1:] + steps[:-1])
            velocity[0] = velocity[-1] = acceleration[0] = acceleration[-1] = 0.0
            return q, velocity, acceleration
        stretch *= 1.01 * excess


def _speeds(ways: Array, tangent: Array, bend: Array, speeds: Array, accelerations: Array) -> Array:
    """How fast the path may be gone at each of its places (S,): half of each acceleration is for bends, half for gaining speed."""
    half = 0.5 * accelerations
    with np.errstate(divide="ignore"):
        limit = np.minimum((speeds / np.abs(tangent)).min(axis=1) ** 2, (half / np.abs(bend)).min(axis=1))
        gain = 2.0 * (half / np.abs(tangent)).min(axis=1)
    squared = limit.copy()
    squared[0] = squared[-1] = 0.0
    for k in range(len(ways)):
        squared[k + 1] = min(squared[k + 1], squared[k] + gain[k] * ways[k])
    for k in range(len(ways) - 1, -1, -1):
        squared[k] = min(squared[k], squared[k + 1] + gain[k + 1] * ways[k])
    found: Array = np.sqrt(squared)
    return found


def _require(path: Array, speeds: Array, accelerations: Array, rounding: float, dt: float) -> None:
    if path.ndim != 2 or not len(path) or not np.isfinite(path).all():
        raise InvalidValue(f"path has shape {path.shape}; it must be (K, n) rad, finite, at least one pose.")
    for name, values in (("speeds", speeds), ("accelerations", accelerations)):
        if values.shape != path.shape[1:] or not (np.isfinite(values) & (values > 0.0)).all():
            raise InvalidValue(f"{name} have shape {values.shape}; they must be ({path.shape[1]},), finite and above 0.")
    if not (rounding >= 0.0 and dt > 0.0):
        raise InvalidValue(f"rounding {rounding} rad, dt {dt} s: they must be at least 0, and above 0.")
