"""The motors once more, whole robots at a time in NumPy, as they were before they were compiled; with friction and torques."""

from __future__ import annotations

import numpy as np

from mobee.control.modality import FRICTION, INERTIA
from mobee.robot.robot import Array, Robot
from mobee.simulation import MotorParameters
from mobee.simulation.motors import SERVO_GAIN


class Oracle:
    """Kinematic motors with one substep length; see `Motors`."""

    def __init__(self, robot: Robot, parameters: MotorParameters, q: Array, dt: float) -> None:
        n = len(q)
        self.dt = dt
        self.limits = robot.limits
        self.top, self.push, self.torque = (
            np.array([getattr(m, name) for m in robot.motor_table]) for name in ("max_velocity", "max_acceleration", "max_torque")
        )
        self.lag, self.delay, self.backlash, self.friction = (
            np.broadcast_to(getattr(parameters, name), (n,)) for name in ("lag", "delay", "backlash", "friction")
        )
        self.steps = np.round(self.delay / dt).astype(int)
        self.q, self.motor_q, self.rest = q.copy(), q.copy(), q.copy()
        self.motor_v, self.velocity, self.load = np.zeros(n), np.zeros(n), np.zeros(n)
        self.mode, self.resting, self.reference = np.full(n, "hold", dtype="<U8"), np.ones(n, dtype=bool), np.zeros(n)
        self.line = [np.zeros(n)] * (self.steps.max() + 1)

    def command(self, where: slice, mode: str, reference: Array | None) -> None:
        if reference is not None:
            self.reference[where] = reference
        entering = np.zeros(len(self.q), dtype=bool)
        entering[where] = self.mode[where] != mode
        self.mode[where] = mode
        self.resting[entering] = False
        if mode == "torque" and entering.any():
            self.load = np.zeros(len(self.q))  # the weight of a robot without masses
        still = np.where(self.mode == "torque", self.load, self.motor_v)
        self.motor_q = np.where(entering & (self.mode == "torque"), self.q, self.motor_q)
        self.line = [np.where(entering, still, row) for row in self.line]

    def step(self) -> None:
        dt, torque, hold = self.dt, self.mode == "torque", self.mode == "hold"
        before = self.motor_v
        wanted = np.clip(self.reference, -self.top, self.top)
        wanted = np.where(self.mode == "position", self.servo(self.reference), wanted)
        wanted = np.where(torque, np.clip(self.reference, -self.torque, self.torque), wanted)
        self.line = [*self.line, wanted][-self.steps.max() - 1 :]
        delayed = np.array([self.line[-s - 1][i] for i, s in enumerate(self.steps)])
        share = np.where(self.lag > 0, 1.0 - np.exp(-dt / np.where(self.lag > 0, self.lag, 1.0)), 1.0)
        driven = shrink(before + share * (delayed - before), share * self.friction)
        push = np.clip((delayed - self.load - FRICTION * before) / INERTIA, -self.push, self.push)
        turned = np.clip(shrink(before + push * dt, FRICTION * self.friction / INERTIA * dt), -self.top, self.top)
        change = self.push * dt
        arrived = hold & ~self.resting & (np.abs(before) <= change)
        self.rest = np.where(arrived, self.motor_q, self.rest)
        self.resting = self.resting | arrived
        held = np.where(self.resting, self.servo(self.rest), before - np.clip(before, -change, change))
        self.motor_v = np.where(hold, held, np.where(torque, turned, driven))
        self.motor_q = self.motor_q + self.motor_v * dt
        play = np.where(torque, 0.0, self.backlash / 2.0)
        after = np.clip(np.clip(self.q, self.motor_q - play, self.motor_q + play), *self.limits.T)
        self.velocity = (after - self.q) / dt
        self.q = after
        half = self.backlash / 2.0
        self.motor_q = np.where(torque, after, np.clip(self.motor_q, after - half, after + half))
        self.motor_v = np.where(torque, self.velocity, self.motor_v)

    def servo(self, position: Array) -> Array:
        velocity: Array = np.clip(SERVO_GAIN * (position - self.motor_q), -self.top, self.top)
        return velocity


def shrink(x: Array, by: Array) -> Array:
    """Nearer to 0 by that much."""
    nearer: Array = np.copysign(np.maximum(np.abs(x) - by, 0.0), x)
    return nearer
