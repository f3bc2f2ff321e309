"""Checks masses: wrong units, impossible moments of inertia, centres far from their links, weights that motors cannot hold."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from mobee.arrays import Array
from mobee.check.finding import Finding, count, length, some
from mobee.check.subject import Subject
from mobee.check.units import half_extent
from mobee.model.masses import gravity_torque
from mobee.robot.bodies import can_be
from mobee.robot.robot import Body

HEAVIEST, LIGHTEST = 1000.0, 0.01  # kg: robots are between
NEAR = 0.1  # m, by which a centre of mass may lie outside of its link's solids, however small they are


def masses(subject: Subject) -> Iterator[Finding]:
    """All that can be said of the robot's masses; nothing of a robot without any."""
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
    """Moving links that are drawn and weigh nothing."""
    robot = subject.robot
    solid = {shape.link for shape in robot.shapes if shape.role == "solid"}
    idle = sorted((solid & subject.moved) - {body.link for body in robot.bodies})
    if idle:
        yield Finding(
            "note",
            "mass",
            subject.where("link", robot.links[idle[0]]),
            f"{count(idle, 'moving link')} with solids and without a mass: {some(robot.links[link] for link in idle)}",
            "gravity compensation takes them for weightless",
            f"nothing, if the mass of what carries them includes theirs; else add {'<inertial>' if subject.is_urdf else '<mass>'}",
        )


def _impossible(subject: Subject) -> Iterator[Finding]:
    """Moments of inertia that no solid thing has; one note of all."""
    wrong = [body.link for body in subject.robot.bodies if body.inertia is not None and not can_be(body.inertia)]
    if wrong:
        names = [subject.robot.links[link] for link in wrong]
        yield Finding(
            "note",
            "mass",
            subject.where("link", names[0]),
            f"no solid thing has the moments of inertia of {some(names)}",
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
    if off > max(NEAR, float(np.linalg.norm(high - low))):
        name = subject.robot.links[body.link]
        yield Finding(
            "warning",
            "mass",
            subject.where("link", name),
            f"the centre of mass of link {name!r} lies {length(off)} away from its solids",
            "gravity compensation is computed with that lever",
            "check its place: it is in metres, and relative to where its tag stands",
        )


def _too_heavy(subject: Subject) -> Iterator[Finding]:
    """Motors that cannot hold the robot, a warning where it is at home."""
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
    return Finding(
        "warning" if home else "note",
        "mass",
        subject.where("motor", motor.name),
        f"motor {motor.name!r} needs {needed:.3g} N m to hold the robot {where}; its largest torque is {limits[index]:.3g} N m",
        "in the torque modality it gives way under the robot's weight",
        "check the masses (kg) and centres (m), or the motor's torque limit",
    )
