"""How the state of the dynamical system becomes a motor command: position, velocity or torque (thesis 5.2)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from mobee.robot.robot import Array

Modality = Literal["position", "velocity", "torque"]

# What a torque-commanded motor is taken to be, here and in the simulated motors: inertia * dv/dt = torque - friction * v.
INERTIA = 0.5  # kg m^2
FRICTION = 5.0  # N m s/rad


@dataclass(frozen=True, slots=True, eq=False)
class Command:
    """What the motors are told: the modality in force says which one counts; each (n,), motor order of the robot."""

    position: Array  # rad
    velocity: Array  # rad/s
    torque: Array  # N m
