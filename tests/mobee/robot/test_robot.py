# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import copy
import gc
import pickle
import weakref
from collections.abc import Callable

import numpy as np
import pytest

from mobee.robot.robot import Robot, per_robot
from tests.mobee.control.two_parts import two_part_arm


@pytest.mark.parametrize(
    "copied", [copy.copy, copy.deepcopy, lambda one: pickle.loads(pickle.dumps(one))], ids=["copy", "deepcopy", "pickle"]
)
def test_shared_arrays_of_a_copy_are_read_only(copied: Callable[[Robot], Robot]) -> None:
    robot = two_part_arm()
    assert len(robot.limits) == len(robot.home) == len(robot.coupling[0].T)  # computed before the copy
    other = copied(robot)
    assert [array.flags.writeable for array in (other.limits, other.home, *other.coupling)] == [False] * 4
    assert np.array_equal(other.limits, robot.limits) and other.name == robot.name


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
