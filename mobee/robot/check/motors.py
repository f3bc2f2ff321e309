"""Motors and parts: a home that cannot be, motors that move nothing, parts with nothing to learn."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from mobee.robot.check.finding import Finding
from mobee.robot.check.subject import Subject
from mobee.robot.check.words import motor_interval
from mobee.robot.motor_units import motor_units

LEAST = np.deg2rad(1.0)  # rad: less is no range; any range of a slide is one


def home_limits(subject: Subject) -> Iterator[Finding]:
    """Motors whose home lies outside of their limits."""
    for motor in subject.robot.motor_table:
        if not motor.limits[0] <= motor.home <= motor.limits[1]:
            home = f"{np.rad2deg(motor.home):.4g} deg ({motor.home:.4g} rad)"
            yield Finding(
                "error",
                "home-limits",
                subject.where("motor", motor.name),
                f"motor {motor.name!r} has its home at {home}, outside of {motor_interval(subject.robot, motor)}",
                "the robot would start against its limits and push itself back",
                "choose a home between them",
            )


def idle_motors(subject: Subject) -> Iterator[Finding]:
    """Motors that move no shape and no marker."""
    bearing = {shape.link for shape in subject.robot.shapes} | {marker.link for marker in subject.robot.markers.values()}
    for motor in subject.robot.motor_table:
        driven = [joint for joint, scale, _ in motor.joints if scale]
        if any(subject.below[joint] & bearing for joint in driven):
            continue
        lacks = "no shape and no marker hangs on what it drives" if driven else "it drives no joint"
        yield Finding(
            "warning",
            "idle-motor",
            subject.where("motor", motor.name),
            f"motor {motor.name!r} moves nothing: {lacks}",
            "its movements can be neither felt nor seen, and still double the states an agent has to learn",
            "give its links a radius or a marker, or remove it",
        )


def idle_parts(subject: Subject) -> Iterator[Finding]:
    """Parts without a motor that an agent could use."""
    units = motor_units(subject.robot)
    ranges = {motor.name: float(np.ptp(motor.limits)) / unit for motor, unit in zip(subject.robot.motor_table, units, strict=True)}
    for part in subject.robot.parts.values():
        if any(ranges[name] >= LEAST for name in part.motors):
            continue
        lacks = "all its motors move less than 1 deg" if part.motors else "it has no motor"
        yield Finding(
            "warning",
            "idle-part",
            subject.where("part", part.name),
            f"no agent can use part {part.name!r}: {lacks}",
            "an agent owns the goal of a part, and here it has nothing to choose from",
            "give it a motor with a range, or move its links into another part",
        )
