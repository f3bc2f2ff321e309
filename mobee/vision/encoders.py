# SPDX-License-Identifier: Apache-2.0
"""Estimates the encoder values at the time stamp of a picture, from the readings shortly before and after it."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from mobee.arrays import Array
from mobee.errors import InvalidValue

KEPT = 128  # readings of a part
WINDOW = 0.035  # s: readings within this time of the stamp are used


@dataclass(frozen=True, slots=True, eq=False)
class Moment:
    """The encoder values at one time, from a straight line fitted to the readings around this time.

    `q`: (n,) rad. `dq`: (n,) rad/s. `variance`: (n,) rad^2, of q.
    """

    q: Array
    dq: Array
    variance: Array


class Readings:
    """The newest readings of the encoders of each part; the readings of different parts have different times.

    `parts`: range of motor indices of each part, by name. `motors`: number n of all motors.
    """

    def __init__(self, parts: Mapping[str, slice], motors: int) -> None:
        self._parts, self._motors = dict(parts), motors
        self._rows: dict[str, deque[tuple[float, Array]]] = {part: deque(maxlen=KEPT) for part in parts}

    def note(self, part: str, t: float, q: Array) -> None:
        """Add a reading q (n_part,) rad of a part at time t [s]; a reading that is not newer than the last one is ignored."""
        rows = self._rows[part]
        if not rows or t > rows[-1][0]:
            rows.append((t, q))

    def at(self, t: float) -> tuple[Array, Array, int]:
        """Return the encoder values (n,) rad and velocities (n,) rad/s of all motors at time t [s], and the smallest number of readings.

        For each part, the readings within 0.035 s of t are used; the number is that of the part with the fewest of them. Raises
        InvalidValue if a part has fewer than two.
        """
        q, dq, fewest = np.zeros(self._motors), np.zeros(self._motors), KEPT
        for part, where in self._parts.items():
            times = np.array([time for time, _ in self._rows[part]])
            values = np.array([value for _, value in self._rows[part]])
            found = moment_at(times, values, t, np.ones(where.stop - where.start))
            q[where], dq[where] = found.q, found.dq
            fewest = min(fewest, int((np.abs(times - t) <= WINDOW).sum()))
        return q, dq, fewest

    def forget(self) -> None:
        """Remove all readings; called at the start of a new run."""
        for rows in self._rows.values():
            rows.clear()


def moment_at(times: Array, readings: Array, t: float, noise: Array) -> Moment:
    """Return the encoder values at time t [s] from readings (m, n) rad at times (m,) s, by a line fitted to the readings within 0.035 s.

    `noise`: (n,) rad, standard deviation of one reading. Raises InvalidValue if fewer than two readings are within 0.035 s of t.
    """
    near = np.abs(times - t) <= WINDOW
    if near.sum() < 2:
        raise InvalidValue(f"{int(near.sum())} readings of the encoders within {WINDOW} s of {t:.3f} s: at least 2 are needed")
    inverse = np.linalg.pinv(np.stack([np.ones(int(near.sum())), times[near] - t], axis=1))
    line = inverse @ readings[near]
    return Moment(line[0], line[1], float(inverse[0] @ inverse[0]) * noise**2)
