# SPDX-License-Identifier: Apache-2.0
"""What a reach needs: the robot, its plant (here the offline plant), and the choice of the hand that reaches."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from mobee.arrays import Array
from mobee.errors import UnknownName
from mobee.model.model import Model
from mobee.model.world import World
from mobee.reach import Aim, ReachPlant, ReachTarget
from mobee.robot.robot import Robot
from mobee.simulation import OfflinePlant
from services.common.hands import PALMS, hand_for, hand_of, part_of


@dataclass(frozen=True, slots=True)
class Hand:
    """The hand that reaches.

    `marker`: marker to bring to the target. `part`: part that moves it. `why`: how they were chosen; empty if the user gave both.
    """

    marker: str
    part: str
    why: str = ""


Choose = Callable[[Robot, Array | None], Hand]
"""A function that chooses the hand of a robot for a target. Its arguments: the robot, and the target's position (3,) m in the root
frame, or None if it is not known."""


def choose_hand(robot: Robot, position: Array | None, part: str | None, marker: str | None) -> Hand:
    """Return the hand that reaches for a target.

    If only `part` is given, the marker is the palm that the part moves, or else the end of its chain (`hand_of`). If only `marker` is
    given, the part is the one with the most motors that move it. If both are None, the marker is that palm or chain end which is nearest to
    the target in the home posture (`hand_for`). If both are given, the marker is not checked.

    `position`: position of the target, (3,) m in the root frame; None: not known. Raises UnknownName for a part or marker that the robot
    does not have, InvalidValue if no motor moves the marker or the part moves no marker.
    """
    if part is not None:
        robot.part(part)
        return Hand(marker or hand_of(robot, part), part, "" if marker else f"the marker of {part}; --marker names another")
    if marker is not None:
        return Hand(marker, part_of(robot, marker), "the part with the most motors that move it; --part names another")
    marker = hand_for(robot, position)
    why = "the palm nearer to the target at home" if marker in PALMS else "the end of the robot that the most motors move"
    return Hand(marker, part_of(robot, marker), f"{why}; --marker and --part name others")


@dataclass(frozen=True, slots=True, eq=False)
class Setup:
    """A robot, its plant (offline or live) and the hand that reaches.

    `hand`: the marker and the part that reach. `q`: measures the positions of all motors, (n,) rad. `present_object(name, aim, faces)`:
    makes an object of the plant's world the target and returns the target; `aim`: reach its "centre" or "surface"; `faces`: whether the
    marker's normal must point at it. `first_motion`: returns the time from the last request to the first command that moves the robot [s];
    None offline.
    """

    robot: Robot
    plant: ReachPlant
    hand: Hand
    q: Callable[[], Array]
    present_object: Callable[[str, Aim, bool], ReachTarget]
    first_motion: Callable[[], float | None]

    @property
    def model(self) -> Model:
        """A model of the robot without any world objects."""
        return Model(self.robot)


@contextmanager
def offline(robot: Robot, world: World, choose: Choose, target: Array | str) -> Iterator[Setup]:
    """Set up the offline plant with the robot at home in a world, for the block of a `with` statement.

    `choose(robot, position)`: function that returns the hand for a target at `position`, (3,) m; None: not known. `target`: a position (3,)
    m in the root frame, or the name of an object in the world.
    """
    known = {name: found.position for name, found in world.objects.items()}
    hand = choose(robot, known.get(target) if isinstance(target, str) else target)
    plant = OfflinePlant(Model(robot, world))

    def present_object(name: str, aim: Aim, faces: bool) -> ReachTarget:
        found = world.objects.get(name)
        if found is None or found.role != "target":
            raise UnknownName("target of the offline world", name, [one for one, other in world.objects.items() if other.role == "target"])
        target = ReachTarget(found.position, found.size[0], aim, faces=faces)
        plant.present(target)
        return target

    yield Setup(robot, plant, hand, lambda: plant.q, present_object, lambda: None)
