# SPDX-License-Identifier: Apache-2.0
"""Assembles the state of the whole body from the parts' states, each with its own sampling time (thesis 2.3.2)."""

from __future__ import annotations

import numpy as np

from bus_schema.messages import State
from mobee.arrays import Array
from mobee.robot.robot import Robot
from services.common.bus import Bus


class Body:
    """Collects the newest `State` message of each part, and joins them to vectors over all motors of the robot."""

    def __init__(self, bus: Bus, robot: Robot) -> None:
        self._streams = {name: bus.latest(State, name) for name in robot.parts}
        self._robot = robot
        self.states: dict[str, State] = {}

    def update(self) -> bool:
        """Read the newest states; return True once every part has a state."""
        for name, stream in self._streams.items():
            state = stream.take()
            if state is not None:
                self.states[name] = state
        return len(self.states) == len(self._streams)

    def forget(self) -> None:
        """Drop all states; call this at the start of a new run."""
        self.states.clear()

    def q(self) -> Array:
        """Return the motor positions, shape (n,), in [rad]; call it only after `update` has returned True."""
        q = np.empty(len(self._robot.motors))
        for name, part in self._robot.parts.items():
            q[part.slice] = self.states[name].q
        return q

    def dq(self) -> Array:
        """Return the motor velocities, shape (n,), in [rad/s]; call it only after `update` has returned True."""
        dq = np.empty(len(self._robot.motors))
        for name, part in self._robot.parts.items():
            dq[part.slice] = self.states[name].dq
        return dq

    def ages(self, t: int) -> dict[str, int]:
        """Return a dict from each part to the age [ns] of its newest state at the bus time t [ns]."""
        return {name: t - state.t for name, state in self.states.items()}
