# SPDX-License-Identifier: Apache-2.0
"""Checks the sizes and masses of a robot.

It finds wrong units (millimetres in place of metres, degrees in place of radians, grams in place of kilograms), impossible inertias,
centres of mass far from their links, and weights that motors cannot hold.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from mobee.arrays import Array
from mobee.check.interface import Finding, Subject, count, interval, length, some
from mobee.check.shapes import vertices
from mobee.model.masses import gravity_torque
from mobee.robot.bodies import can_be
from mobee.robot.motor_units import in_metres
from mobee.robot.robot import Body, Motor, Shape

LARGEST, SMALLEST = 10.0, 0.01  # m: the range of plausible robots
TURN_AS_DEGREES = np.deg2rad(6.3)  # rad: 2 pi read as degrees
QUARTERS = np.deg2rad(np.pi / 4 * np.array([1, 2, 3, 4, 6, 8]))  # rad: 45, 90, ... deg written in radians and read as degrees
HEAVIEST, LIGHTEST = 1000.0, 0.01  # kg: the range of plausible robots
MAX_OUTSIDE = 0.1  # m: how far a centre of mass may always lie outside its link's solids


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
    """Yield a finding if ranges of motors are probably radians that were read as degrees; not for those of a URDF, which is in radians."""
    turning = [motor for motor in subject.robot.motor_table if _turns(subject, motor) and not subject.is_urdf("motor", motor.name)]
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
    """Return whether an end of the motor's range [rad] is, to three digits, pi/4, pi/2, ... degrees: radians that were read as degrees."""
    ends = np.abs(motor.limits)
    if ends.max() > TURN_AS_DEGREES:
        return False
    return bool((np.abs(ends[:, None] / QUARTERS - 1.0).min(axis=1) < 1e-3).any())


def masses(subject: Subject) -> Iterator[Finding]:
    """Yield all findings about the masses of the robot's links; none for a robot whose file has no masses."""
    if not subject.robot.bodies:
        return
    yield from _total(subject)
    yield from _without(subject)
    yield from _impossible(subject)
    for body in subject.robot.bodies:
        yield from _astray(subject, body)
    yield from _too_heavy(subject)


def _total(subject: Subject) -> Iterator[Finding]:
    total = sum(body.mass for body in subject.robot.bodies)
    if LIGHTEST <= total <= HEAVIEST:
        return
    heaviest = max(subject.robot.bodies, key=lambda body: body.mass)
    name = subject.robot.links[heaviest.link]
    yield Finding(
        "warning",
        "mass",
        subject.where("link", name),
        f"the robot weighs {total:.4g} kg; the heaviest link is {name!r} with {heaviest.mass:.4g} kg",
        "gravity compensation commands torques for that weight",
        "masses are in kilograms: divide by 1000 if the numbers are grams"
        if total > HEAVIEST
        else "masses are in kilograms, not in tonnes",
    )


def _without(subject: Subject) -> Iterator[Finding]:
    """Find moving links with solids but without a mass."""
    robot = subject.robot
    solid = {shape.link for shape in robot.shapes if shape.role == "solid"}
    idle = sorted((solid & subject.moved) - {body.link for body in robot.bodies})
    if idle:
        tag = "<inertial>" if subject.is_urdf("link", robot.links[idle[0]]) else "<mass>"
        yield Finding(
            "note",
            "mass",
            subject.where("link", robot.links[idle[0]]),
            f"{count(idle, 'moving link')} with solids and without a mass: {some(robot.links[link] for link in idle)}",
            "gravity compensation ignores their weight",
            f"nothing, if the mass of the link that carries them includes theirs; else add {tag}",
        )


def _impossible(subject: Subject) -> Iterator[Finding]:
    """Find moments of inertia that no rigid body can have; one note for all."""
    wrong = [body.link for body in subject.robot.bodies if body.inertia is not None and not can_be(body.inertia)]
    if wrong:
        names = [subject.robot.links[link] for link in wrong]
        yield Finding(
            "note",
            "mass",
            subject.where("link", names[0]),
            f"no rigid body can have the moments of inertia of {some(names)}",
            "this library does not use them; simulators to which the robot is exported do, and may become unstable",
            "no principal moment is negative, or larger than the two others together",
        )


def _astray(subject: Subject, body: Body) -> Iterator[Finding]:
    solids = [shape for shape in subject.robot.shapes if shape.link == body.link and shape.role == "solid"]
    if not solids:
        return
    low = np.min([shape.position - half_extent(shape) for shape in solids], axis=0)
    high = np.max([shape.position + half_extent(shape) for shape in solids], axis=0)
    off = float(np.linalg.norm(np.maximum(0.0, np.maximum(low - body.centre, body.centre - high))))
    if off > max(MAX_OUTSIDE, float(np.linalg.norm(high - low))):
        name = subject.robot.links[body.link]
        yield Finding(
            "warning",
            "mass",
            subject.where("link", name),
            f"the centre of mass of link {name!r} lies {length(off)} away from its solids",
            "gravity compensation is computed with that lever",
            "check its position: it is in metres, relative to the element around its tag",
        )


def _too_heavy(subject: Subject) -> Iterator[Finding]:
    """Yield a finding for each motor whose largest torque cannot hold the robot against gravity, at home or in a sampled pose.

    It is a warning if the torque is too small at home (`Robot.home`), and a note if it is too small only in a sampled pose.
    """
    robot = subject.limited
    limits = np.array([motor.max_torque for motor in robot.motor_table])
    at_home = np.abs(gravity_torque(robot, subject.home))
    anywhere = np.abs(gravity_torque(robot, subject.samples)).max(axis=0)
    for index in np.flatnonzero(np.maximum(at_home, anywhere) > limits):
        yield _overload(subject, int(index), at_home, anywhere, limits)


def _overload(subject: Subject, index: int, at_home: Array, anywhere: Array, limits: Array) -> Finding:
    motor = subject.robot.motor_table[index]
    home = bool(at_home[index] > limits[index])
    needed, where = (at_home[index], "at home") if home else (anywhere[index], "in some pose")
    effort, unit = ("force", "N") if in_metres(subject.robot, motor) else ("torque", "N m")
    return Finding(
        "warning" if home else "note",
        "mass",
        subject.where("motor", motor.name),
        f"motor {motor.name!r} needs {needed:.3g} {unit} to hold the robot {where}; its largest {effort} is {limits[index]:.3g} {unit}",
        "in the torque modality it gives way under the robot's weight",
        f"check the masses (kg) and centres (m), or the motor's {effort} limit",
    )
