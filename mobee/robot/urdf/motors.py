# SPDX-License-Identifier: Apache-2.0
"""Reads motors, limits and couplings (<mimic>) of a URDF."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import copysign, inf, isinf, pi

import numpy as np

from mobee.arrays import Array
from mobee.robot.motor_units import angle_unit, outside_zones
from mobee.robot.robot import Motor
from mobee.robot.urdf.tree import FARTHEST, UrdfJoint, bounded, child, read_name
from mobee.robot.xml.node import FARTHEST as HIGHEST
from mobee.robot.xml.node import Node, listed, nearest

LEAST = 1e-6  # of a factor between a joint and its motor
TURN = 2.0 * pi  # rad, of a joint without limits
SLIDE = 2.0  # m, of a prismatic joint without limits


@dataclass(frozen=True, slots=True)
class Drive:
    """The drive of a joint by a motor: joint = scale * motor + offset (rad or m).

    `master`: name of the joint that the motor moves directly, at the end of the chain of <mimic>; the motor has this name too, unless the
    joint's <mobee> element gives it another one.
    """

    master: str
    scale: float
    offset: float  # rad or m


def read_drives(joints: Mapping[str, UrdfJoint], moving: Sequence[UrdfJoint]) -> dict[str, Drive]:
    """Return a dict from the name of each moving joint to its drive; chains of <mimic> are followed to the joint at their end.

    `joints`: all joints, by name. `moving`: the joints that move. Raises RobotFileError for cycles of <mimic> and unknown joints.
    """
    names = {joint.name for joint in moving}
    drives: dict[str, Drive] = {}
    for joint in moving:
        chain: list[tuple[UrdfJoint, Node]] = []
        now = joint
        while now.name not in drives and (mimic := child(now.node, "mimic")) is not None:
            if now.name in {link.name for link, _ in chain}:
                mimic.fail("joint", f"{now.name!r} mimics itself in the end", "Remove one <mimic> of the cycle")
            chain.append((now, mimic))
            now = _master(mimic, joints, names)
        found = drives.setdefault(now.name, Drive(now.name, 1.0, 0.0))
        for link, mimic in reversed(chain):
            factor, shift = _multiplier(mimic), bounded(mimic, "offset", 0.0)
            found = Drive(found.master, factor * found.scale, factor * found.offset + shift)
            if not LEAST <= abs(found.scale) <= FARTHEST or abs(found.offset) > FARTHEST:
                mimic.fail("multiplier", f"{link.name!r} moves {found.scale:g} times as far as {found.master!r}", "Correct the multipliers")
            drives[link.name] = found
    return drives


def _master(mimic: Node, joints: Mapping[str, UrdfJoint], moving: set[str]) -> UrdfJoint:
    name = mimic.text("joint")
    if name not in joints:
        mimic.fail("joint", f"there is no joint {name!r}", f"{nearest(name, joints)}Valid: {listed(moving)}")
    if name not in moving:
        mimic.fail("joint", f"joint {name!r} does not move", "Name a joint that moves, or remove <mimic>")
    return joints[name]


def _multiplier(mimic: Node) -> float:
    factor = bounded(mimic, "multiplier", 1.0)
    if abs(factor) < LEAST:
        mimic.fail("multiplier", "is 0, so the joint cannot move", 'Write type="fixed", or another multiplier')
    return factor


def joint_limits(joint: UrdfJoint) -> Array:
    """Return the lower and upper limit (2,) of a joint, rad or m; always finite, since every motor needs limits.

    A joint whose limits are both infinite (`stated_limits`) gets an interval of one turn, or of 2 m if it is prismatic, centred at zero. A
    joint with one finite limit gets an interval of the same length that ends at this limit.
    """
    low, high = stated_limits(joint).tolist()
    span = SLIDE if joint.kind == "prismatic" else TURN
    if low == -inf and high == inf:
        return np.array([-span / 2.0, span / 2.0])
    return np.array([low if low > -inf else high - span, high if high < inf else low + span])


def stated_limits(joint: UrdfJoint) -> Array:
    """Return the lower and upper limit (2,) [rad or m] that the file gives a joint; infinite for a turning joint without limits.

    If only one limit is given, the other is 0 (URDF's default). A limit beyond 1e6 counts as infinite. If lower is above upper, both count
    as infinite: files for PyBullet write joints without limits in this form. Raises RobotFileError if the file gives a prismatic joint no
    limits.
    """
    limit = child(joint.node, "limit")
    if joint.kind == "continuous":
        return np.array([-inf, inf])
    if limit is None or not {"lower", "upper"} & set(limit.attributes):
        if joint.kind == "prismatic":
            joint.node.fail("limit", "a prismatic joint without limits", 'Add <limit lower="0" upper="0.1" .../> in metres')
        return np.array([-inf, inf])
    low, high = _or_infinite(limit, "lower"), _or_infinite(limit, "upper")
    if low > high or (isinf(low) and low == high):
        return np.array([-inf, inf])
    return np.array([low, high])


def _or_infinite(limit: Node, name: str, farthest: float = FARTHEST) -> float:
    """Return a number of a <limit>, 0 if it is left out; infinite if it is above `farthest`, which no joint can reach."""
    try:
        value = float(limit.optional(name))
    except ValueError:
        value = 0.0
    return copysign(inf, value) if abs(value) > farthest else limit.number(name, 0.0)


def _warn_of_free(joint: UrdfJoint) -> None:
    """Warn that a joint has no limits, and name the range that is assumed."""
    limit = child(joint.node, "limit")
    if joint.kind == "continuous" or np.isfinite(stated_limits(joint)).all():
        return
    slides = joint.kind == "prismatic"
    low, high = joint_limits(joint) if slides else np.rad2deg(joint_limits(joint))
    taken = f"{low:.4g} to {high:.4g} {'m' if slides else 'deg'} is taken"
    if limit is None or not {"lower", "upper"} & set(limit.attributes):
        joint.node.warn(f'joint {joint.name!r} has no limits; {taken}. Write <limit lower= upper=>, or type="continuous"')
        return
    given = f"lower={limit.optional('lower') or '0'}, upper={limit.optional('upper') or '0'}"
    remedy = "If it has limits, write them, lower before upper" + ("" if slides else '; else write type="continuous"')
    stated = stated_limits(joint)
    lacks = "limits" if np.isinf(stated).all() else "a lower limit" if np.isinf(stated[0]) else "an upper limit"
    limit.warn(f"joint {joint.name!r} has {given}, so it is read as one without {lacks}; {taken}. {remedy}")


def read_motor(master: UrdfJoint, driven: Sequence[tuple[int, UrdfJoint, Drive]], part: str = "all") -> Motor:
    """Return the motor of the joint `master` and of all joints that mimic it; its limits keep every joint within the joint's limits.

    `driven`: for each of these joints, `master` included, (index in the robot, joint, drive). `part`: name of the motor's part. The unit is
    that of `master`: rad, or m if it is prismatic. At home, `master` is at 0, or as near to it as possible outside the motor's limit zones.
    A limit zone is a range near a limit, in which the control law pushes inward. A <mobee> element of `master` (from `write_urdf`) can give
    name, acceleration, scale and offset of the motor. Warns of limits that are assumed or ignored, and of a velocity or effort below 0.
    """
    limits = joint_limits(master)
    _warn_of_free(master)
    for _, joint, drive in driven:
        if joint is master or child(joint.node, "limit") is None:
            continue
        ends = np.sort((stated_limits(joint) - drive.offset) / drive.scale)
        narrowed = np.array([max(limits[0], ends[0]), min(limits[1], ends[1])])
        if narrowed[1] - narrowed[0] < 1e-6:
            joint.node.warn(f"the limits of {joint.name!r} leave {master.name!r}, which it mimics, no room, so they are ignored")
        elif np.abs(narrowed - limits).max() > 1e-9:  # a difference in the last digit of the file does not count
            limits = narrowed
    joints = tuple((index, drive.scale, drive.offset) for index, _, drive in driven)
    motor = Motor(master.name, part, limits, float(np.clip(0.0, *limits)), joints, zone_ends_at_home=True)
    motor = _extended(master, _limited(master, motor))
    unit = angle_unit(motor.limits, all(joint.kind == "prismatic" for _, joint, _ in driven))
    return replace(motor, home=outside_zones(motor.home, motor.limits, unit))


def _limited(master: UrdfJoint, motor: Motor) -> Motor:
    limit = child(master.node, "limit")
    if limit is None:
        return motor
    velocity, effort = _or_infinite(limit, "velocity"), _or_infinite(limit, "effort", HIGHEST)
    slides = master.kind == "prismatic"
    _warn_if_negative(limit, "velocity", velocity, f"{motor.max_velocity:.4g} {'m/s' if slides else 'rad/s'}")
    _warn_if_negative(limit, "effort", effort, f"{motor.max_torque:.4g} {'N' if slides else 'N m'}")
    if 0 < velocity < inf:  # exporters write 0 for an unknown value, or inf
        motor = replace(motor, max_velocity=velocity)
    return replace(motor, max_torque=effort) if 0 < effort < inf else motor


def _warn_if_negative(limit: Node, name: str, value: float, default: str) -> None:
    if value < 0:
        limit.warn(f"{name} is {value:g}, which is below 0, so the default {default} is taken. Write a number above 0")


def _extended(master: UrdfJoint, motor: Motor) -> Motor:
    """Return the motor with the values of the element <mobee> that `write_urdf` adds to the joint, since URDF has no place for them.

    These are the motor's name, the scale and offset between motor and joint (joint = scale * motor + offset), and the acceleration limit. A
    motor without this element is returned unchanged.
    """
    note = child(master.node, "mobee")
    if note is None:
        return motor
    note.check_attributes({"motor", "scale", "offset", "acceleration"})
    scale, offset = bounded(note, "scale", 1.0), bounded(note, "offset", 0.0)
    if abs(scale) < LEAST:
        note.fail("scale", "is 0", "Write joint = scale * motor + offset")
    limits = np.sort((motor.limits - offset) / scale)
    return replace(
        motor,
        name=read_name(note, "motor") if note.optional("motor") else motor.name,
        limits=limits,
        home=float(np.clip((motor.home - offset) / scale, *limits)),
        joints=tuple((index, factor * scale, factor * offset + shift) for index, factor, shift in motor.joints),
        max_velocity=motor.max_velocity / abs(scale),
        max_torque=motor.max_torque * abs(scale),
        max_acceleration=note.positive("acceleration", motor.max_acceleration, unit="rad/s^2"),
    )
