"""The plant on which `mobee reach` acts, its hand, and what it needs of the robot."""

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


@dataclass(frozen=True, slots=True, eq=False)
class Stage:
    """A plant, offline or live.

    `hand`: what reaches.  `q`: measures all motors, (n,) rad.  `present_object`: makes an object of the plant's world the target.
    `first_motion`: s from the last reach's request to the first command that moves, None where no clock on the wall counts.
    """

    robot: Robot
    plant: ReachPlant
    hand: Hand
    q: Callable[[], Array]
    present_object: Callable[[str, Aim], ReachTarget]
    first_motion: Callable[[], float | None]

    @property
    def model(self) -> Model:
        """The robot alone."""
        return Model(self.robot)


@contextmanager
def offline(robot: Robot, world: World, choose: Choose, target: Array | str) -> Iterator[Stage]:
    """The robot at home in a world, on the offline plant; `target`: the place (3,) m, or the object's name, that is reached for."""
    known = {name: thing.position for name, thing in world.objects.items()}
    hand = choose(robot, known.get(target) if isinstance(target, str) else target)
    plant = OfflinePlant(Model(robot, world))

    def present_object(name: str, aim: Aim) -> ReachTarget:
        thing = world.objects.get(name)
        if thing is None or thing.role != "target":
            raise UnknownName("target of the offline world", name, [one for one, other in world.objects.items() if other.role == "target"])
        target = ReachTarget(thing.position, thing.size[0], aim)
        plant.present(target)
        return target

    yield Stage(robot, plant, hand, lambda: plant.q, present_object, lambda: None)
