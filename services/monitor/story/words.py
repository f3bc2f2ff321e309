# SPDX-License-Identifier: Apache-2.0
"""Words for parts, motors, motions and numbers in the sentences of a story."""

from __future__ import annotations

import os
import re
from collections.abc import Sequence

import numpy as np

from mobee.arrays import Array
from mobee.learning.space import Space
from mobee.robot.motor_units import slides
from mobee.robot.robot import Robot
from services.common.worlds import AT_TABLE

ROOT_AXES = ("x", "y", "z")
ICUB_AXES = (("back", "forward"), ("right", "left"), ("up", "down"))  # of the root frame, positive and negative: x is backwards
SHORTEST = 0.015  # m: a hand that moves less stays where it is
SHARE = 0.5  # of the largest displacement: smaller ones along other axes are not named
SIDES = ("l_", "r_", "left_", "right_")


def title_of(name: str) -> str:
    """Return a name as words for users: left_arm becomes "left arm"."""
    return name.replace("_", " ")


def joint_words(name: str, part: str, robot: Robot) -> str:
    """Return the name of a motor in words, without a prefix that users do not need.

    For example, l_shoulder_pitch of left_arm becomes "shoulder pitch", and panda_joint1 becomes "joint 1". One prefix is removed, the first
    of these with which the name begins: the part's name, a side (such as l_), the prefix that all motors of the robot share.
    """
    shared = os.path.commonprefix(robot.motors)
    for prefix in (f"{part}_", *SIDES, shared[: shared.rfind("_") + 1]):
        if prefix and name.startswith(prefix) and len(name) > len(prefix):
            name = name.removeprefix(prefix)
            break
    words = re.sub(r"(?<=[a-z])(?=\d+$)", " ", name.replace("_", " "))
    return f"joint {words}" if words.isdecimal() else words


def ordinal(n: int) -> str:
    """Return an integer as an ordinal number: 1st, 2nd, 3rd, 4th, 11th, ..."""
    suffix = "th" if n % 100 in (11, 12, 13) else {1: "st", 2: "nd", 3: "rd"}.get(n % 10, "th")
    return f"{n}{suffix}"


def listed(words: Sequence[str]) -> str:
    """Join words to a list in a sentence: "a", "a and b", "a, b and c". `words` must not be empty."""
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} and {words[-1]}"


def displacement(motion: Array, robot: str) -> str:
    """Describe the displacement `motion` (3,) m of a hand, such as "12 cm up and forward".

    Only the main directions are named. The text is empty if the displacement is below 1.5 cm. `robot`: name of the robot. For robots of the
    iCub's family the directions are those of the body, such as forward; for others, the axes of the root frame.
    """
    length = float(np.linalg.norm(motion))
    if length < SHORTEST:
        return ""
    main = [axis for axis in np.argsort(-np.abs(motion)).tolist() if abs(motion[axis]) >= SHARE * np.abs(motion).max()]
    return f"{100 * length:.0f} cm {listed([_direction(axis, float(motion[axis]), robot) for axis in main])}"


def _direction(axis: int, along: float, robot: str) -> str:
    if robot in AT_TABLE:
        return ICUB_AXES[axis][along < 0.0]
    if axis == 2:
        return "up" if along > 0.0 else "down"
    return f"along {'+' if along > 0.0 else '−'}{ROOT_AXES[axis]}"


def action_words(space: Space, state: int, goal: int) -> str:
    """Describe the action from a state to a goal state by the joints that it turns, such as "elbow +32°, shoulder yaw −20°"."""
    turns = space.samples[goal] - space.samples[state]
    named = []
    for index in np.argsort(-np.abs(turns)).tolist():
        if abs(turns[index]) > 1e-6:
            named.append(f"{joint_words(space.joints[index], space.part, space.robot)} {_amount(space, index, float(turns[index]))}")
    return ", ".join(named) or "stay in this pose"


def _amount(space: Space, index: int, turn: float) -> str:
    sign = "+" if turn > 0.0 else "−"
    motor = space.robot.motor_table[space.robot.motor_index(space.joints[index])]
    return f"{sign}{1000 * abs(turn):.0f} mm" if slides(space.robot, motor) else f"{sign}{np.rad2deg(abs(turn)):.0f}°"


def percent(share: float) -> str:
    """Return a share (0 to 1) as whole percent.

    A share above 0 that would be rounded to 0 % becomes "under 1 %". A share below 1 that would be rounded to 100 % becomes "over 99 %".
    """
    rounded = round(100 * share)
    if rounded == 0 and share > 0.0:
        return "under 1 %"
    if rounded == 100 and share < 1.0:
        return "over 99 %"
    return f"{rounded} %"
