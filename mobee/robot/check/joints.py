"""Joints: limits that are missing or make no sense, and couplings that drive a joint beyond them."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from mobee.robot.check.finding import Finding
from mobee.robot.check.subject import Subject
from mobee.robot.check.words import interval

TURN = 2 * np.pi + 1e-6
SLACK = 1e-6  # rad or m: what a file's digits leave open


def joint_limits(subject: Subject) -> Iterator[Finding]:
    """Joints without limits, with an empty interval, or one of more than a turn to a side."""
    for joint in subject.robot.joints:
        where, said = subject.where("joint", joint.name), interval(joint.limits, joint.kind)
        low, high = joint.limits
        if not np.isfinite(joint.limits).all():
            yield Finding(
                "error",
                "joint-limits",
                where,
                f"joint {joint.name!r} has no limits ({said})",
                "agents divide a range into states and the controller stops before its ends: without one neither works",
                "give it the range its hardware has; a wheel-like joint may take -180 to 180 deg",
            )
        elif low >= high:
            yield Finding(
                "error",
                "joint-limits",
                where,
                f"joint {joint.name!r} has the empty range {said}",
                "it can never move, and the limit forces at both ends fight each other",
                "put the smaller limit first, or make it a fixed link",
            )
        elif joint.kind == "revolute" and max(abs(low), abs(high)) > TURN:
            yield Finding(
                "warning",
                "joint-limits",
                where,
                f"joint {joint.name!r} turns {said}, more than a whole turn to one side",
                "degrees were perhaps written where radians are read (XML is in degrees, URDF in radians)",
                "convert the limits, or divide the range if the joint really turns several times",
            )


def coupling(subject: Subject) -> Iterator[Finding]:
    """Joints that their motors drive beyond their own limits, and joints that nothing drives."""
    matrix, offset = subject.robot.coupling
    ends = matrix[:, :, None] * subject.range[None]
    low, high = ends.min(axis=2).sum(axis=1) + offset, ends.max(axis=2).sum(axis=1) + offset
    for index, joint in enumerate(subject.robot.joints):
        where = subject.where("joint", joint.name)
        if not matrix[index].any():
            yield Finding(
                "warning",
                "coupling",
                where,
                f"no motor drives joint {joint.name!r}",
                "it stays where it is drawn",
                "put it inside a motor, or write a fixed link instead",
            )
        elif low[index] < joint.limits[0] - SLACK or high[index] > joint.limits[1] + SLACK:
            drivers = [motor.name for column, motor in enumerate(subject.robot.motor_table) if matrix[index, column]]
            reached = interval(np.array([low[index], high[index]]), joint.kind)
            yield Finding(
                "warning",
                "coupling",
                where,
                f"joint {joint.name!r} is driven to {reached}, beyond its own limits {interval(joint.limits, joint.kind)}",
                f"nothing stops {' and '.join(drivers)} there: only motors have limit forces",
                "narrow the range of the motor, or correct the factor of the coupling",
            )
