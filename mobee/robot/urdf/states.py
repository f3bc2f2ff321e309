"""Poses that an SRDF names (<group_state>), and which of them is home."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from math import atan2, pi, remainder
from pathlib import Path

import numpy as np

from mobee.errors import UnknownName
from mobee.robot.robot import Motor
from mobee.robot.urdf.frames import bounded
from mobee.robot.urdf.tree import UrdfJoint
from mobee.robot.xml_node import Node

HOMES = ("home", "ready", "half_sitting", "standing", "default")  # the first of them that an SRDF has is home
ZERO = "zero"  # a home that every robot has, unless its SRDF gives the name to another pose
BEYOND = 1e-6  # rad or m, of a limit, by rounding

State = dict[str, tuple[Node, float]]  # joint -> its line in the SRDF, and where it is in [rad] or [m]


@dataclass(frozen=True, slots=True)
class Home:
    """A pose by joints, and its name; `meant`: that is home, or was asked for, so a value that no motor can reach is an error."""

    name: str
    state: State
    meant: bool


def read_state(group_state: Node, joints: Mapping[str, UrdfJoint], elsewhere: Collection[str]) -> State:
    """The joints of a <group_state> that the robot has and that move; `elsewhere`: virtual joints, which place the robot in the world."""
    found: State = {}
    for node in group_state:
        name = node.text("name")
        if name in joints and joints[name].kind != "fixed":
            found[name] = node, _value(node, joints[name])
        elif name not in joints and name not in elsewhere:
            node.warn(f"the robot has no joint {name!r}, so this is ignored")
    return found


def _value(node: Node, joint: UrdfJoint) -> float:
    """One number; of a continuous joint also the cosine and the sine, as some tools write, and any number of turns."""
    if joint.kind != "continuous":
        return bounded(node, "value")
    numbers = node.numbers("value") if "value" in node.attributes else [bounded(node, "value")]
    if len(numbers) not in (1, 2):
        node.fail("value", f"has {len(numbers)} numbers", "Write the angle in radians")
    angle = numbers[0] if len(numbers) == 1 else atan2(numbers[1], numbers[0])
    return angle if abs(angle) <= pi + BEYOND else remainder(angle, 2.0 * pi)


def choose_home(states: Mapping[str, State], asked: str | None, srdf: Path | None) -> Home:
    """The pose that was asked for by name; else the first of HOMES, else the only one, else none. Case does not count.

    Raises UnknownName with the names there are.
    """
    lower = {name.lower(): name for name in states}
    if asked is not None:
        if asked.lower() not in (*lower, ZERO):
            raise UnknownName(f"home ({srdf or 'no SRDF was found'})", asked, (*states, ZERO))
        name = lower.get(asked.lower(), ZERO)
        return Home(name, states.get(name, {}), meant=True)
    known = next((lower[name] for name in HOMES if name in lower), None)
    name = known or (next(iter(states)) if len(states) == 1 else ZERO)
    return Home(name, states.get(name, {}), meant=name.lower() == HOMES[0])


def homed(motor: Motor, home: Home, moving: list[UrdfJoint]) -> Motor:
    """The motor with its place in a home that speaks of joints; raises RobotFileError where a home that is meant is out of reach."""
    for index, scale, offset in motor.joints:
        if moving[index].name not in home.state:
            continue
        node, value = home.state[moving[index].name]
        place = (value - offset) / scale
        low, high = motor.limits
        if not low - BEYOND <= place <= high + BEYOND:
            problem = f"{value:g} puts {motor.name!r} outside of {low:g} .. {high:g}"
            if home.meant:
                node.fail("value", problem, "Choose a home within the limits")
            node.warn(f"{problem}, so its home is the nearest limit. Correct the value, or choose another home")
        return replace(motor, home=float(np.clip(place, low, high)))
    return motor
