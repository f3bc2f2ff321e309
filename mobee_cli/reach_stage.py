"""Where `mobee reach` reaches: a plant, and what must be known of the robot on it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np

from mobee.collision.world import World
from mobee.errors import UnknownName
from mobee.model import Model
from mobee.reach import Aim, ReachPlant, ReachTarget
from mobee.robot.robot import Array, Robot
from mobee.simulation import OfflinePlant
from mobee_cli.reach_hand import Choose, Hand


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

    yield Stage(robot, plant, hand, lambda: np.concatenate([plant.measure(part) for part in robot.parts]), present_object, lambda: None)
