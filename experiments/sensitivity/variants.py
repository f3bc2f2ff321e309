"""One number of the published plant changed at a time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from experiments.kit.arm_learning import DT, LEFT, robot
from mobee import Gains, Model, MotorParameters, OfflinePlant
from mobee.robot.robot import Robot


@dataclass(frozen=True)
class Variant:
    """A plant of one arm; `gains` and `settle` are changes to the published gains, `motors` to the default motors."""

    gains: dict[str, float] = field(default_factory=dict)
    settle: dict[str, float] = field(default_factory=dict)
    motors: dict[str, float] = field(default_factory=dict)
    dt: float = DT  # s
    gain_set: Callable[[], Gains] = Gains.published_2014
    motor_set: Callable[[], MotorParameters] = MotorParameters
    robot: Callable[[], Robot] = robot

    def plant(self, seed: int) -> OfflinePlant:
        """The left arm's four motors."""
        gains = self.gain_set()
        gains = replace(gains, **self.gains, settle=replace(gains.settle, **self.settle))
        motors = replace(self.motor_set(), **self.motors)
        return OfflinePlant(Model(self.robot()), seed, gains, motors, self.dt, active=LEFT)


def normalised() -> Robot:
    """The published robot with the cable rows scaled so that their units are those along their normals."""
    clauses = []
    for clause in robot().clauses:
        length = np.linalg.norm(clause.a, axis=1)
        clauses.append(replace(clause, a=clause.a / length[:, None], b=clause.b / length))
    return replace(robot(), clauses=tuple(clauses))


def _degrees(place: str, name: str, *values: float) -> dict[str, dict[str, dict[str, float]]]:
    return {f"{value:g}": {place: {name: float(np.deg2rad(value))}} for value in values}


def _plain(place: str, name: str, *values: float) -> dict[str, dict[str, dict[str, float]]]:
    return {f"{value:g}": {place: {name: value}} for value in values}


_OLDER = {"stiffness": 20.0, "max_spring": float(np.deg2rad(800.0)), "max_constraint": float(np.deg2rad(1600.0))}
_CHANGED: dict[str, dict[str, Any]] = {
    "encoder noise, deg (0.1)": _degrees("motors", "encoder_noise", 0.0, 0.05, 0.2, 0.4),
    "motor delay, s (0.02)": _plain("motors", "delay", 0.0, 0.06),
    "motor lag, s (0.05)": _plain("motors", "lag", 0.0, 0.15),
    "backlash, deg (0.2)": _degrees("motors", "backlash", 0.0, 0.5),
    "friction, deg/s (0)": _degrees("motors", "friction", 0.5),
    "cable zone, row units (40)": _degrees("gains", "constraint_width", 10.0, 20.0, 30.0, 50.0),
    "cable force, deg/s^2 (1500)": _degrees("gains", "max_constraint", 1000.0, 1300.0, 1700.0, 2500.0),
    "damping, 1/s (50)": _plain("gains", "damping", 14.0, 20.0, 35.0),
    "spring stiffness, 1/s^2 (50)": _plain("gains", "stiffness", 25.0, 100.0),
    "spring maximum, deg/s^2 (1000)": _degrees("gains", "max_spring", 800.0, 1500.0),
    "settle speed, deg/s (1)": _degrees("settle", "speed", 0.2, 0.6, 1.2, 2.0),
    "settle acceleration, deg/s^2 (50)": _degrees("settle", "acceleration", 25.0, 100.0),
    "first look, s (1)": _plain("settle", "first_look", 0.2, 3.0),
    "limit ramp, deg (10)": _degrees("gains", "limit_width", 5.0),
    "control period, s (0.02)": {"0.01": {"dt": 0.01}, "0.005": {"dt": 0.005}},
}
_SCALED = {f"{width:g}": {"robot": normalised, "gains": {"constraint_width": float(np.deg2rad(width))}} for width in (10.0, 20.0, 40.0)}

PUBLISHED = "as published"
VARIANTS: dict[str, Variant] = {
    PUBLISHED: Variant(),
    **{f"{name}: {value}": Variant(**change) for name, changes in _CHANGED.items() for value, change in changes.items()},
    **{f"cable zone, degrees along the normals: {value}": Variant(**change) for value, change in _SCALED.items()},
    "older arm: spring 20 and 800, cable force 1600": Variant(gains=_OLDER),
    "motors without lag, delay, backlash, noise": Variant(motor_set=MotorParameters.ideal),
    "motors as identified on the simulated robot": Variant(motor_set=lambda: MotorParameters.identified("icub")),
    "our default gains": Variant(gain_set=Gains.default),
}
