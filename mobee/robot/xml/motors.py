# SPDX-License-Identifier: Apache-2.0
"""Reads motors, the joints they drive, and linear constraints."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from mobee.robot.robot import Clause, Joint, Motor, Part
from mobee.robot.xml.node import Node

UNITS = ("deg", "m")  # of the positions of a motor
NARROWEST = 1e-6  # deg or m between the limits of a motor


@dataclass(frozen=True, slots=True, eq=False)
class MotorDraft:
    """A motor as written in its element, before its joints are known.

    `part`: name of its part. `index`: its attribute idx, which determines the order of the motors within the part. `low`, `high`, `home`:
    limits and home, in m if `in_metres`, else in degrees.
    """

    node: Node
    name: str
    part: str
    index: int
    low: float
    high: float
    home: float
    in_metres: bool = False  # unit="m", of a motor that slides; else degrees

    def si(self, value: float) -> float:
        """Convert a position, velocity or acceleration of this motor from the unit of the file to rad or m."""
        return value if self.in_metres else float(np.deg2rad(value))


def read_motor(node: Node, part: str, before: Collection[MotorDraft]) -> MotorDraft:
    """Return the motor that a <motor> element describes; raises RobotFileError if it is not valid.

    `part`: name of the motor's part. `before`: the motors, of all parts, before it in the file. Their number is in the name of a motor
    without a name; the number of those in the same part is the index of a motor without idx.
    """
    low, high = node.number("minPos"), node.number("maxPos")
    unit = node.choice("unit", node.optional("unit") or UNITS[0], UNITS, "unit")
    if low == high:
        remedy = "Write a <link> instead of the joint if it shall not move, or another interval"
        node.fail("minPos", f"equals maxPos {high:g}, so the motor cannot move", remedy)
    if low > high:
        node.fail("minPos", f"{low:g} is not below maxPos {high:g}", "Swap the two")
    if high - low < NARROWEST:
        node.fail("minPos", f"is less than {NARROWEST:g} {unit} below maxPos", "Write limits in degrees, or a <link> instead of the joint")
    home = node.number("home", min(max(0.0, low), high))
    if not low <= home <= high:
        node.fail("home", f"{home:g} is outside of {low:g} .. {high:g}", "Choose a home between minPos and maxPos")
    index = node.number("idx", float(sum(motor.part == part for motor in before)))
    if not index.is_integer() or index < 0:
        node.fail("idx", f"{index:g} is not a whole number from 0 on", "Count the motors of a part from 0")
    return MotorDraft(node, node.optional("name") or f"{part}_{len(before)}", part, int(index), low, high, home, unit == "m")


def order_motors(motors: Mapping[str, MotorDraft], parts: Iterable[str]) -> list[MotorDraft]:
    """Return all motors in the order of q: part by part in the order of `parts`, and within a part by the attribute idx.

    Raises RobotFileError if two motors of a part have the same idx.
    """
    ordered = []
    for part in parts:
        mine = sorted((motor for motor in motors.values() if motor.part == part), key=lambda motor: motor.index)
        for one, other in zip(mine, mine[1:], strict=False):
            if one.index == other.index:
                other.node.fail("idx", f"{other.index} is taken by {one.name!r}", "Give every motor of a part its own idx")
        ordered += mine
    return ordered


def finish_joints(
    joints: Sequence[Joint], drives: Sequence[tuple[Node, str]], motors: Sequence[MotorDraft]
) -> tuple[tuple[Joint, ...], tuple[Motor, ...]]:
    """Return the finished joints and motors: joints with limits in SI units, motors with the affine maps to their joints (thesis 2.3.1).

    Each map takes the motor's range to the joint's range. `drives`: for each joint, its element and the name of its motor. `motors`: in
    the order of q. Raises RobotFileError for an unknown motor, a motor without a joint, a joint that cannot move, and a joint without an
    interval whose unit is not that of its motor.
    """
    places = {motor.name: k for k, motor in enumerate(motors)}
    driven: list[list[tuple[int, float, float]]] = [[] for _ in motors]
    finished = []
    for index, (joint, (node, name)) in enumerate(zip(joints, drives, strict=True)):
        motor = motors[places[node.choice("motor", name, places, "motor")]]
        slides = joint.kind == "prismatic"
        if slides != motor.in_metres and not {"minPos", "maxPos"} <= set(node.attributes):
            unit, other = ("metres", "degrees") if slides else ("degrees", "metres")
            remedy = f'Write minPos and maxPos of the joint in {unit}, or unit="{"m" if slides else "deg"}" in the motor'
            node.fail("minPos", f"joint {joint.name!r} moves in {unit}, and its motor {name!r} in {other}", remedy)
        low, high = node.number("minPos", motor.low), node.number("maxPos", motor.high)
        if low == high:
            node.fail(
                "minPos", f"equals maxPos {high:g}, so the joint cannot move", 'Write type="fixed" without limits, or another interval'
            )
        span = motor.si(motor.high - motor.low)
        si = 1.0 if slides else np.deg2rad(1.0)
        scale = (high - low) * si / span
        driven[places[name]].append((index, float(scale), float(low * si - scale * motor.si(motor.low))))
        finished.append(replace(joint, limits=np.array([min(low, high), max(low, high)]) * si))
    for motor, joints_of_motor in zip(motors, driven, strict=True):
        if not joints_of_motor:
            motor.node.fail("name", f"motor {motor.name!r} drives no joint", f'Write <joint motor="{motor.name}" ...>')
    return tuple(finished), tuple(_motor(motor, tuple(mine)) for motor, mine in zip(motors, driven, strict=True))


def _motor(draft: MotorDraft, joints: tuple[tuple[int, float, float], ...]) -> Motor:
    limits = np.array([draft.si(draft.low), draft.si(draft.high)])
    motor = Motor(draft.name, draft.part, limits, float(np.clip(draft.si(draft.home), *limits)), joints)
    node, unit = draft.node, "metres" if draft.in_metres else "degrees"
    if node.flag("zoneEndsAtHome"):
        motor = replace(motor, zone_ends_at_home=True)
    if "velocity" in node.attributes:
        motor = replace(motor, max_velocity=draft.si(node.positive("velocity", unit=f"{unit} per second")))
    if "acceleration" in node.attributes:
        motor = replace(motor, max_acceleration=draft.si(node.positive("acceleration", unit=f"{unit} per second squared")))
    if "torque" in node.attributes:
        motor = replace(motor, max_torque=node.positive("torque", unit="newton metres"))
    return motor


def read_clauses(node: Node, part: Part, motors: Sequence[MotorDraft]) -> Clause:
    """Return the clause of a <constraintList>: a condition on motor positions q, which is met if at least one of its rows holds.

    A row holds if a.q + b > 0 or, with the attribute `negate`, if a.q + b < 0. The attribute `q` of a row contains the names of motors of
    the part, or their indices in the part, from 0. In the file each position is in the unit of its motor, and `b` in degrees, or in m if
    all motors of the row are in m. `motors`: all motors of the robot, in the order of q. Raises RobotFileError if the element is not valid.
    """
    names, in_metres = [motor.name for motor in motors], np.array([motor.in_metres for motor in motors])
    rows, offsets = [], []
    for child in (child for child in node if child.tag == "constraint"):
        factors, words = child.numbers("a"), child.words("q")
        if len(factors) != len(words) or not words:
            child.fail("q", f"names {len(words)} motors for {len(factors)} factors", "Give a and q the same number of entries")
        row = np.zeros(len(motors))
        for factor, word in zip(factors, words, strict=True):
            row[names.index(_motor_name(child, word, part))] += factor
        if not row.any():
            child.fail("a", "is zero", "Give at least one motor a factor")
        offset = child.number("b")
        if (row[~in_metres] != 0.0).any():  # from degrees to rad
            row[in_metres] = np.deg2rad(row[in_metres])
            offset = np.deg2rad(offset)
        sign = -1.0 if child.flag("negate") else 1.0
        rows.append(sign * row)
        offsets.append(sign * offset)
    if not rows:
        node.fail("constraint", "the list is empty", "Add a <constraint> or remove the list")
    return Clause(part.name, np.array(rows), np.array(offsets))


def _motor_name(node: Node, word: str, part: Part) -> str:
    if re.fullmatch("-?[0-9]{1,9}", word):
        number = int(word)
        if not 0 <= number < len(part):
            node.fail("q", f"part {part.name!r} has no motor {number}", f"Its motors are 0 to {len(part) - 1}: {', '.join(part.motors)}")
        return part.motors[number]
    return node.choice("q", word, part.motors, "motor")
