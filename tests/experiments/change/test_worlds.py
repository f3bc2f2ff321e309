from __future__ import annotations

import numpy as np
import pytest

from experiments.change.worlds import CHANGES, groups, plant_of
from experiments.kit.arm_learning import arm_space
from experiments.kit.truth import truth_of


@pytest.mark.parametrize("change", CHANGES)
def test_what_changes_moves_where_the_middle_state_is_or_how_the_elbow_gets_there(change):
    space = arm_space()
    ends = []
    for is_after in (False, True):
        plant = plant_of(change, is_after, 0)
        plant.act("left_arm", space.target(39))
        ends.append(plant.act("left_arm", space.target(40 if change == "object" else 66)).q[space.columns])
    assert np.abs(ends[0] - ends[1]).max() > np.deg2rad(3.0)


def test_an_action_changed_if_it_ends_elsewhere_and_neither_if_that_is_not_known():
    space = arm_space()
    goals = space.goals[0]
    before = truth_of(space, np.array([[0, 0, goals[0]], [0, 1, goals[1]], [0, 2, goals[2]]]))
    after = truth_of(space, np.array([[0, 0, 0], [0, 1, goals[1]]]))
    changed, same = groups(before, after)
    assert np.argwhere(changed).tolist() == [[0, 0]]
    assert np.argwhere(same).tolist() == [[0, 1]]
