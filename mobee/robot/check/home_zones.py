"""A home so near to a limit that the limit pushes there, and the nearest home that is left alone."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from mobee.control.gains import Gains
from mobee.robot.check.finding import Finding
from mobee.robot.check.subject import Subject
from mobee.robot.check.words import count, position, some
from mobee.robot.motor_units import motor_units, outside_zones
from mobee.robot.robot import Motor

ROUNDING = 1e-4  # of the motor's range: what the digits of a file leave open


def home_zones(subject: Subject) -> Iterator[Finding]:
    """Motors whose home lies in a limit zone of the default gains: those that are pushed away from it, and those whose zone ends there."""
    units = motor_units(subject.robot)
    better = {
        motor.name: outside_zones(motor.home, motor.limits, float(unit))
        for motor, unit in zip(subject.robot.motor_table, units, strict=True)
        if np.isfinite(motor.limits).all() and motor.limits[0] <= motor.home <= motor.limits[1]
    }
    near = [
        motor
        for motor in subject.robot.motor_table
        if motor.name in better and abs(better[motor.name] - motor.home) > ROUNDING * float(np.ptp(motor.limits))
    ]
    pushed = [motor for motor in near if not motor.zone_ends_at_home]
    if pushed:
        yield _finding(subject, pushed, better, _drift(subject, pushed, better), "where the robot is to stay at home")
    rest = [motor for motor in near if motor.zone_ends_at_home]
    if rest:
        why = "their limits begin to push at home only, so that they rest there, and less strongly at the limit than others"
        yield _finding(subject, rest, better, why, "nothing, if home must be there; else")


def _drift(subject: Subject, motors: Sequence[Motor], better: dict[str, float]) -> str:
    """How far from home the motor comes to rest that is pushed farthest: where the spring to home is as strong as the limit."""
    gains = Gains.default()
    slope = gains.max_limit / gains.limit_width
    share = slope / (slope + gains.stiffness)
    worst = max(motors, key=lambda motor: abs(better[motor.name] - motor.home))
    drift = position(subject.robot, worst, share * abs(better[worst.name] - worst.home))
    return f"their limits push them away: with home as its goal {worst.name} rests about {drift} from it"


def _finding(subject: Subject, motors: Sequence[Motor], better: dict[str, float], why: str, when: str) -> Finding:
    near = [f"{motor.name} at {position(subject.robot, motor, motor.home)}" for motor in motors]
    changes = ", ".join(_change(subject, motor, better[motor.name]) for motor in motors)
    return Finding(
        "note",
        "home-zone",
        _line(subject, motors[0]),
        f"home lies in the limit zone of {count(motors, 'motor')}: {some(near)}",
        why,
        f"{when} write the nearest home outside the zone: {changes}",
    )


def _change(subject: Subject, motor: Motor, home: float) -> str:
    """What to write where, in the words of the file."""
    line = _line(subject, motor).rpartition(":")[2]
    if not subject.is_urdf:
        return f'{motor.name} home="{np.rad2deg(home):.6g}" (line {line})'
    index, scale, offset = motor.joints[0]
    return f'<joint name="{subject.robot.joints[index].name}" value="{scale * home + offset:.6g}"/> (line {line})'


def _line(subject: Subject, motor: Motor) -> str:
    """Where the home is written: in the SRDF, or at the motor."""
    return subject.robot.where.get(("home", motor.name)) or subject.where("motor", motor.name)
