# SPDX-License-Identifier: Apache-2.0
"""Checks the joints, motors, markers and home of a robot: limits, couplings, motors without effect, homes too near to limits."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from mobee.check.interface import Finding, Subject, count, interval, motor_interval, position, some
from mobee.control.gains import Gains
from mobee.robot.motor_units import in_metres, motor_units, outside_zones
from mobee.robot.robot import Motor

TURN = 2 * np.pi + 1e-6  # rad
SLACK = 1e-6  # rad or m: tolerance for the digits of a file


def joint_limits(subject: Subject) -> Iterator[Finding]:
    """Yield a finding for each joint without limits, with an empty range, or with a limit more than one turn from zero."""
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
    """Yield a finding for each joint that its motors can drive beyond the joint's limits, and for each joint that no motor drives."""
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
                "it stays at its zero position",
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


MIN_RANGE = np.deg2rad(1.0)  # rad: a smaller one cannot be used; any range of a slide can


def home_limits(subject: Subject) -> Iterator[Finding]:
    """Yield a finding for each motor whose home is outside the motor's limits."""
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
    """Yield a finding for each motor that moves neither a shape nor a marker."""
    bearing = {shape.link for shape in subject.robot.shapes} | {marker.link for marker in subject.robot.markers.values()}
    for motor in subject.robot.motor_table:
        driven = [joint for joint, scale, _ in motor.joints if scale]
        if any(subject.below[joint] & bearing for joint in driven):
            continue
        lacks = "no shape and no marker is on the links that it moves" if driven else "it drives no joint"
        yield Finding(
            "warning",
            "idle-motor",
            subject.where("motor", motor.name),
            f"motor {motor.name!r} moves nothing: {lacks}",
            "its motion has no effect, and still doubles the states that an agent has to learn",
            "give its links a radius or a marker, or remove it",
        )


def idle_parts(subject: Subject) -> Iterator[Finding]:
    """Yield a finding for each part that no agent can use: it has no motor, or all its motors have a range below 1 degree."""
    units = motor_units(subject.robot)
    ranges = {motor.name: float(np.ptp(motor.limits)) / unit for motor, unit in zip(subject.robot.motor_table, units, strict=True)}
    for part in subject.robot.parts.values():
        if any(ranges[name] >= MIN_RANGE for name in part.motors):
            continue
        lacks = "all its motors move less than 1 deg" if part.motors else "it has no motor"
        yield Finding(
            "warning",
            "idle-part",
            subject.where("part", part.name),
            f"no agent can use part {part.name!r}: {lacks}",
            "an agent chooses goals of a part, and here there is nothing to choose",
            "give it a motor with a range, or move its links into another part",
        )


def unreachable_markers(subject: Subject) -> Iterator[Finding]:
    """Yield a finding for each marker that no motor moves; for a URDF or MJCF file, in which many links are markers, one note for all."""
    unmoved = [marker for marker in subject.robot.markers.values() if marker.link not in subject.moved]
    frames = [marker for marker in unmoved if subject.is_mjcf or subject.is_urdf("marker", marker.name)]
    if frames:
        yield Finding(
            "note",
            "marker",
            subject.where("marker", frames[0].name),
            f"{count(frames, 'marker')} that no motor moves: {some(marker.name for marker in frames)}",
            "their Jacobian is zero: they can neither reach nor be pushed",
            "nothing, if they are frames of the base",
        )
    for marker in (marker for marker in unmoved if marker not in frames):
        yield Finding(
            "warning",
            "marker",
            subject.where("marker", marker.name),
            f"no motor moves marker {marker.name!r}: it sits on link {subject.robot.links[marker.link]!r}",
            "its Jacobian is zero: it can neither reach nor be pushed",
            "write it inside the joint that should carry it",
        )


ROUNDING = 1e-4  # of the motor's range: tolerance for the digits of a file


def home_zones(subject: Subject) -> Iterator[Finding]:
    """Yield up to two notes on motors whose home is in the limit zone of the default gains.

    In the limit zone, a range before the limit, the control law pushes the motor inward. The first note lists the motors that it pushes
    away from home. The second lists the motors whose zone is made narrower so that it ends at home; they rest at home.
    """
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
    """Return a text about the motor whose home is deepest in its limit zone: how far from home it rests.

    It rests where the spring towards home balances the limit force. `better`: by name of the motor, the nearest home outside the zone.
    """
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
    """Return a text for the user: what to write in the robot's file to set this home (rad), and, except for MJCF, in which line."""
    line = _line(subject, motor).rpartition(":")[2]
    if subject.is_mjcf:
        return f"{motor.name} {home:.6g} in the qpos of a keyframe home"
    if not subject.is_urdf("motor", motor.name):
        value = home if in_metres(subject.robot, motor) else np.rad2deg(home)
        return f'{motor.name} home="{value:.6g}" (line {line})'
    index, scale, offset = motor.joints[0]
    return f'<joint name="{subject.robot.joints[index].name}" value="{scale * home + offset:.6g}"/> (line {line})'


def _line(subject: Subject, motor: Motor) -> str:
    """Return file and line of a motor's home: in the SRDF, or at the motor."""
    return subject.robot.where.get(("home", motor.name)) or subject.where("motor", motor.name)
