# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest

from mobee.errors import InvalidValue
from mobee.learning.space import Space
from tests.mobee.learning.toys import toy_robot

SAMPLES = np.deg2rad([[20.0], [50.0], [100.0]])


def test_a_space_of_one_s_own_is_its_samples_and_goals():
    space = Space(toy_robot(), ["l_elbow"], SAMPLES, [[1, -1], [0, 2], [0, 1]], rest=0.25)
    assert (len(space), space.state_actions, space.part) == (3, 5, "left_arm")
    assert space.actions(0).tolist() == [1] and space.goal(1, 1) == 2
    assert [space.state_of([np.deg2rad(q)]) for q in (0, 34, 36, 74, 76)] == [0, 0, 1, 1, 2]
    assert space.target(2)[3] == pytest.approx(np.deg2rad(100))


@pytest.mark.parametrize(
    ("samples", "goals", "message"),
    [
        (SAMPLES[:1], [[0]], "at least two finite poses"),
        (SAMPLES * np.nan, [[1], [2], [0]], "at least two finite poses"),
        (SAMPLES, [[1], [2]], "one row of states"),
        (SAMPLES, [[1], [2], [3]], "one row of states"),
        (SAMPLES, [[1.5], [2], [0]], "one row of states"),
        (SAMPLES, [["next"], [2], [0]], "goals is"),
        (SAMPLES, [[-1, 1], [0, 2], [0, 1]], "-1 only after"),
        (SAMPLES, [[-1], [0], [0]], "at least one action"),
    ],
)
def test_samples_and_goals_that_do_not_fit_are_refused(samples, goals, message):
    with pytest.raises(InvalidValue, match=message):
        Space(toy_robot(), ["l_elbow"], samples, goals)
