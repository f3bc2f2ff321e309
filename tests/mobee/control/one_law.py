# SPDX-License-Identifier: Apache-2.0
"""The law of some motors with given gains, without a robot."""

from __future__ import annotations

import ctypes
from typing import Any

import numpy as np

from mobee._core import INTERVAL, address, view
from mobee._core import law as core
from mobee.arrays import Array


class OneLaw:
    """Motors of one part with the given gains; limits that are not given are too large to have an effect."""

    def __init__(self, count: int = 1, *, law: dict[str, float] | None = None, **motor: float) -> None:
        self._motors = np.zeros(count, dtype=core.MOTOR_GAINS)
        far = {"low": -1e9, "high": 1e9, "spring_knee": 1.0, "client_knee": 1.0, "max_speed": 1e9, "max_acceleration": 1e9, "max_lead": 1e9}
        for name, value in {**far, "unit": 1.0, "settle_unit": 1.0, **motor}.items():
            self._motors[name] = value
        self._all, self._part = np.arange(count), np.array([(0, count)], dtype=INTERVAL)
        every: dict[str, Any] = {name: view(self._all) for name in ("active", "constrained")}
        self._law = core.Law(motors=view(self._motors), parts=view(self._part), contact_forces=1, **every, **(law or {}))
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
