# SPDX-License-Identifier: Apache-2.0
"""One part behind its gate, with motors, on a clock that the test turns."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from bus_schema import VERSION, Refused
from bus_schema.messages import Command
from mobee.arrays import Array
from mobee.robot.load import load_robot
from mobee.simulation.motors import MotorParameters, Motors
from services.robot_sim.gate import Drive, Gate, Limits, Order

ROBOT = load_robot("icub")
PART = "torso"
WHERE = ROBOT.part(PART).slice
LIMITS = Limits.of(ROBOT, PART)
N = len(ROBOT.part(PART))


class Gated:
    """Advances gate and motors together, and keeps what the motors did."""

    def __init__(self, parameters: MotorParameters | None = None, dt: float = 0.01) -> None:
        self.dt, self.k, self.now, self.seq = dt, 0, 0, -1
        self.events: list[tuple[str, str]] = []
        self.gate = Gate(PART, LIMITS, dt, report=lambda code, text, values: self.events.append((code, text)))
        self.motors = Motors(ROBOT, parameters or MotorParameters.ideal(), seed=0, q=ROBOT.home)
        self.drive = Drive("hold")

    def owned(self) -> Gated:
        self.gate.arm(self.gate.take("controller", "c1"))
        return self

    @property
    def q(self) -> Array:
        return self.motors.q[WHERE]

    @property
    def velocity(self) -> Array:
        return self.motors.motor_velocities[WHERE]

    def command(self, mode: str = "velocity", ref: Any = 0.0, **changes: Any) -> None:
        """Admit a command that is right but for `changes`; raises Refused."""
        self.seq += 1
        fields: dict[str, Any] = {"epoch": self.gate.epoch, "re_k": self.k, "ttl": 100, "seq": self.seq}
        reference = np.broadcast_to(np.asarray(ref, dtype=float), (N,)).tolist() if np.ndim(ref) == 0 else list(ref)
        header = {"v": VERSION, "run": "r", "src": "controller", "k": self.k, "t": 0, "tw": 0}
        command = Command(**header, mode=mode, ref=reference, **{**fields, **changes})
        self.gate.admit(Order.of(command), self.k, self.now, self.q)

    def tick(self, wall: float | None = None) -> Array:
        """One tick, `wall` s after the last; the change of the motors' velocity in it."""
        self.k += 1
        self.now += round((self.dt if wall is None else wall) * 1e9)
        before = self.velocity.copy()
        self.drive = self.gate.tick(self.k, self.now, self.q, self.velocity)
        self.motors.command(WHERE, self.drive.mode, self.drive.reference)
        substeps = self.motors.parameters.substeps(self.dt)
        self.motors.move(substeps, self.dt / substeps)
        return self.velocity - before


def refusal(gated: Gated, *args: object, **changes: object) -> str:
    """Return the reason for which a command is refused."""
    with pytest.raises(Refused) as caught:
        gated.command(*args, **changes)
    return caught.value.reason
