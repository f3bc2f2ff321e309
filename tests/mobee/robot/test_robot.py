from __future__ import annotations

import numpy as np
import pytest

from tests.mobee.control.two_parts import two_part_arm


def test_shared_arrays_are_read_only() -> None:
    robot = two_part_arm()
    for array in (robot.home, robot.limits, *robot.coupling):
        with pytest.raises(ValueError, match="read-only"):
            array[...] = 1.0
    free = robot.home.copy()
    free += 1.0
    assert np.array_equal(robot.home + 1.0, free)
