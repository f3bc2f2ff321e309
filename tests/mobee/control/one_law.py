# SPDX-License-Identifier: Apache-2.0
"""A law of some motors with numbers of its own, in no robot."""

from __future__ import annotations

import ctypes
from typing import Any

import numpy as np

from mobee._core import address
from mobee._core import law as core
from mobee._core.tables import INTERVAL, view
from mobee.arrays import Array


class OneLaw:
    """Motors in one part with these numbers; what is not given is far away."""

    def __init__(self, count: int = 1, *, law: dict[str, float] | None = None, **motor: float) -> None:
        self._motors = np.zeros(count, dtype=core.MOTOR_GAINS)
        far = {"low": -1e9, "high": 1e9, "spring_knee": 1.0, "client_knee": 1.0, "max_speed": 1e9, "max_acceleration": 1e9, "leash": 1e9}
        for name, value in {**far, "unit": 1.0, "fine": 1.0, **motor}.items():
            self._motors[name] = value
        self._all, self._part = np.arange(count), np.array([(0, count)], dtype=INTERVAL)
        every: dict[str, Any] = {name: view(self._all) for name in ("active", "felt")}
        self._law = core.Law(motors=view(self._motors), parts=view(self._part), touching=1, **every, **(law or {}))
        self._at, self._calls = ctypes.addressof(self._law), core.calls()

    def force(self, name: str, q: Array, torque: Array) -> Array:
        """One of the forces that constrain the motors."""
        forces, state = np.empty((len(core.term_names()), len(q))), np.zeros(len(q), dtype=core.STATE)
        self._calls.forces(self._at, q.tobytes(), torque.tobytes(), address(state), address(forces))
        return forces[core.term_names().index(name)]

    def client(self, f: Array) -> Array:
        """A client's force, bounded."""
        total = np.zeros(len(f))
        self._calls.client(self._at, f.tobytes(), address(total))
        return total

    def step(self, dt: float, attractor: float = 0.0, force: float = 0.0, q: float = 0.0, **before: float) -> Any:
        """The state of one motor after a step."""
        state = np.zeros(1, dtype=core.STATE)
        for name, value in before.items():
            state[name] = value
        given, commands = (np.array([one]).tobytes() for one in (attractor, force)), np.empty(3)
        self._calls.step(self._at, np.array([q]).tobytes(), dt, *given, address(state), address(commands))
        return state[0]
