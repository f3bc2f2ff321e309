from __future__ import annotations

import gc
import weakref

from mobee.robot.per_robot import per_robot
from tests.mobee.control.two_parts import two_part_arm


def test_it_is_built_once_for_each_robot_and_dies_with_it() -> None:
    built = []

    @per_robot
    def size(robot):
        built.append(robot.name)
        return [len(robot.motors)]

    one, other = two_part_arm(), two_part_arm()
    assert size(one) is size(one) and size(one) == size(other)
    assert built == [one.name, other.name]
    watched = weakref.ref(one)
    del one
    gc.collect()
    assert watched() is None
