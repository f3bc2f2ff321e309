"""Where `mobee reach` reaches: a plant, and what must be known of the robot on it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np

from mobee.errors import UnknownName
from mobee.model import Model
from mobee.reach import Aim, ReachPlant, ReachTarget
from mobee.robot.load import load_robot, load_world
from mobee.robot.robot import Array, Robot
from mobee.simulation import OfflinePlant


@dataclass(frozen=True, slots=True, eq=False)
class Stage:
    """A plant, offline or live.

    `q`: measures all motors, (n,) rad.  `present_object`: makes an object of the plant's world the target.  `first_motion`: s from
    the last reach's request to the first command that moves, None where no clock on the wall counts.
    """

    robot: Robot
    plant: ReachPlant
    q: Callable[[], Array]
    present_object: Callable[[str, Aim], ReachTarget]
    first_motion: Callable[[], float | None]

    @property
    def model(self) -> Model:
        """The robot alone."""
        return Model(self.robot)


@contextmanager
def offline() -> Iterator[Stage]:
    """The iCub at home, at its table, on the offline plant."""
    robot, world = load_robot("icub"), load_world("table")
    plant = OfflinePlant(Model(robot, world))

    def present_object(name: str, aim: Aim) -> ReachTarget:
        thing = world.objects.get(name)
        if thing is None or thing.role != "target":
            raise UnknownName("target of the offline world", name, [one for one, other in world.objects.items() if other.role == "target"])
        target = ReachTarget(thing.position, thing.size[0], aim)
        plant.present(target)
        return target

    yield Stage(robot, plant, lambda: np.concatenate([plant.measure(part) for part in robot.parts]), present_object, lambda: None)
