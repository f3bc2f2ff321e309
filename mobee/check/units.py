# SPDX-License-Identifier: Apache-2.0
"""Checks for wrong units: millimetres in place of metres, degrees in place of radians."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from mobee.arrays import Array
from mobee.check.finding import Finding, interval, length, some
from mobee.check.shapes import vertices
from mobee.check.subject import Subject
from mobee.robot.robot import Motor, Shape

LARGEST, SMALLEST = 10.0, 0.01  # m: the range of plausible robots
TURN_AS_DEGREES = np.deg2rad(6.3)  # rad: 2 pi read as degrees
QUARTERS = np.deg2rad(np.pi / 4 * np.array([1, 2, 3, 4, 6, 8]))  # rad: 45, 90, ... deg written in radians and read as degrees


def size(subject: Subject) -> Iterator[Finding]:
    """Yield a finding if the whole robot is larger than 10 m or smaller than 1 cm, which suggests a wrong unit of length."""
    things = list(_things(subject))
    if not things:
        return
    points = np.concatenate([corners for _, _, corners in things])
    span = float(np.ptp(points, axis=0).max())
    if span > LARGEST:
        middle = np.median(points, axis=0)
        kind, name, corners = max(things, key=lambda thing: float(np.abs(thing[2] - middle).max()))
        yield Finding(
            "warning",
            "unit",
            subject.where(kind, name),
            f"the robot is {length(span)} across; the farthest out is {kind} {name!r}, at {length(float(np.abs(corners).max()))}",
            "lengths are in metres, and so are the widths of fields and the thresholds of agents",
            "divide by 1000 if the numbers are millimetres",
        )
    elif span < SMALLEST:
        yield Finding(
            "warning",
            "unit",
            subject.where("robot", subject.robot.name),
            f"the whole robot is {length(span)} across",
            "lengths are in metres",
            "multiply the lengths if they were written in a larger unit",
        )


def radians(subject: Subject) -> Iterator[Finding]:
    """Yield a finding if ranges of motors are probably radians that were read as degrees; not for a URDF, which is in radians."""
    if subject.is_urdf:
        return
    turning = [motor for motor in subject.robot.motor_table if _turns(subject, motor)]
    suspects = [motor for motor in turning if _is_quarter(motor)]
    if turning and all(np.abs(motor.limits).max() <= TURN_AS_DEGREES for motor in turning):
        suspects = turning
    if not suspects:
        return
    first = suspects[0]
    yield Finding(
        "warning",
        "unit",
        subject.where("motor", first.name),
        f"motor {first.name!r} turns {interval(first.limits, 'revolute')}"
        + (f"; so do {some(motor.name for motor in suspects[1:])}" if len(suspects) > 1 else ""),
        "these numbers look like radians, and the file is read in degrees: the robot would hardly move",
        "write the limits in degrees",
    )


def _things(subject: Subject) -> Iterator[tuple[str, str, Array]]:
    """Yield the kind, the name, and enclosing points (k, 3) m in the zero pose, of every element that has a position."""
    for joint in subject.robot.joints:
        yield "joint", joint.name, joint.point[None]
    for marker in subject.robot.markers.values():
        yield "marker", marker.name, marker.position[None]
    for shape in subject.robot.shapes:
        reach = half_extent(shape)
        yield "shape", shape.name, np.array([shape.position - reach, shape.position + reach])


def half_extent(shape: Shape) -> Array:
    """Return half the size (3,) m of a box around the shape, centred at its position, along the axes of the root frame at zero pose."""
    if shape.kind == "convex":
        return np.asarray(np.abs(vertices(shape) @ shape.rotation.T).max(axis=0))
    if shape.kind == "box":
        return np.asarray(np.abs(shape.rotation) @ np.array(shape.size) / 2.0)
    half = shape.size[1] / 2.0 if len(shape.size) > 1 else 0.0
    return np.asarray(np.abs(shape.rotation[:, 2]) * half + shape.size[0])


def _turns(subject: Subject, motor: Motor) -> bool:
    return any(subject.robot.joints[joint].kind == "revolute" for joint, _, _ in motor.joints)


def _is_quarter(motor: Motor) -> bool:
    """Return whether an end of the range is pi/4, pi/2, ... to three digits, read as degrees."""
    ends = np.abs(motor.limits)
    if ends.max() > TURN_AS_DEGREES:
        return False
    return bool((np.abs(ends[:, None] / QUARTERS - 1.0).min(axis=1) < 1e-3).any())
