# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import gc
import weakref

import numpy as np
import pytest

from mobee.robot.robot import per_robot
from tests.mobee.control.two_parts import two_part_arm


def test_shared_arrays_are_read_only() -> None:
    robot = two_part_arm()
    for array in (robot.home, robot.limits, *robot.coupling):
        with pytest.raises(ValueError, match="read-only"):
            array[...] = 1.0
    free = robot.home.copy()
    free += 1.0
    assert np.array_equal(robot.home + 1.0, free)


def test_a_per_robot_value_is_built_once_for_each_robot_and_freed_with_it() -> None:
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
