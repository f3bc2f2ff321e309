"""What `mobee reach` reaches with: a marker, and the part that moves it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from mobee.robot.robot import Array, Robot
from services.common.hands import PALMS, hand_for, hand_of, part_of


@dataclass(frozen=True, slots=True)
class Hand:
    """A marker, the part that moves it, and how they were chosen, "" where the user gave both."""

    marker: str
    part: str
    why: str = ""


Choose = Callable[[Robot, Array | None], Hand]
"""The hand of a robot for a target at a place (3,) m, None where the place is not known."""


def hand_chosen(robot: Robot, place: Array | None, part: str | None, marker: str | None) -> Hand:
    """The hand for a target; what is not given follows from the target and the robot.

    Raises UnknownName for a part or a marker that the robot does not have, InvalidValue where no motor moves a marker.
    """
    if part is not None:
        robot.part(part)
        return Hand(marker or hand_of(robot, part), part, "" if marker else f"the marker of {part}; --marker names another")
    if marker is not None:
        return Hand(marker, part_of(robot, marker), "the part with most motors that move it; --part names another")
    marker = hand_for(robot, place)
    why = "the palm nearer to the target at home" if marker in PALMS else "the end of the robot with most motors before it"
    return Hand(marker, part_of(robot, marker), f"{why}; --marker and --part name others")
