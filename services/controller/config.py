# SPDX-License-Identifier: Apache-2.0
"""Settings of the controller."""

from __future__ import annotations

from typing import Annotated, Literal

from msgspec import Meta

from mobee.errors import InvalidValue
from mobee.robot.motor_units import unit_name
from mobee.robot.robot import Robot
from services.common.config import ServiceConfig
from services.controller.forces import load_terms


class Config(ServiceConfig, frozen=True, kw_only=True):
    """The settings of the controller: its control law, its commands, and user-defined forces. Each field has its own text below it."""

    gains: Literal["default", "derived", "published_2014"] = "published_2014"
    """Name of the set of gains of the control law; the model must use the same set."""
    modality: Literal["position", "velocity", "torque"] = "velocity"
    """Kind of command to the motors: positions, velocities or torques."""
    speed_scale: Annotated[float, Meta(gt=0, le=1)] = 1.0
    """Share of the motors' largest speed that the controller uses."""
    ttl: Annotated[int, Meta(ge=20, le=200)] = 100
    """Milliseconds without a command after which robot_sim holds a part."""
    terms: list[str] = []
    """User-defined forces of the control law. Each is `module:name`, where the name in the importable module is a
    `mobee.control.forces.Term` or a function that returns the force. The model needs the same setting."""
    posture: dict[str, list[float]] = {}
    """Posture of each part while it has no owner, rad, by name of the part; a part that is not named stays where it is."""

    def check_robot(self, robot: Robot) -> None:
        """Raise MobeeError if these settings do not fit the robot.

        They do not fit if `posture` names an unknown part, has the wrong number of values, or leaves a motor's range; if one of the
        `terms` (user-defined forces of the control law) cannot be loaded; or if a part's name cannot be used on the bus.
        """
        super().check_robot(robot)
        if self.terms:
            load_terms(self.terms)
        for part, posture in self.posture.items():
            limits = robot.limits[robot.part(part).slice]
            if len(posture) != len(limits):
                raise InvalidValue(f"posture of {part}: {len(posture)} numbers, it has {len(limits)} motors")
            for motor, q, (lower, upper) in zip(robot.motor_table[robot.part(part).slice], posture, limits, strict=True):
                if not lower <= q <= upper:
                    unit = unit_name(robot, motor)
                    raise InvalidValue(f"posture of {part}: {motor.name} at {q:g} {unit}, its range is {lower:.4f} to {upper:.4f} {unit}")
