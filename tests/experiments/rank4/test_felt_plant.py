from __future__ import annotations

import numpy as np
import pytest

from experiments.kit.arm_learning import LEFT, STRETCHED, arm_plant, arm_space, robot
from experiments.rank4.felt_plant import FeltPlant


def test_watching_changes_nothing():
    watched, plain, space = FeltPlant(arm_plant(3)), arm_plant(3), arm_space(STRETCHED)
    for state in (0, 5, 61, 2):  # 61 cannot be reached
        mine, theirs = watched.act("left_arm", space.target(state)), plain.act("left_arm", space.target(state))
        assert np.array_equal(mine.q, theirs.q)
        assert (mine.settled, mine.duration) == (theirs.settled, theirs.duration)
    assert len(watched.felt) == 4


def test_the_deepest_self_contact_of_an_action_is_named():
    plant = FeltPlant(arm_plant(0))
    target = robot().home[robot().part("left_arm").slice].copy()
    plant.act("left_arm", target)
    for name, degrees in zip(LEFT, (-60.0, 0.0, 70.0, 100.0), strict=True):  # the forearm across the chest
        target[robot().part("left_arm").motors.index(name)] = np.deg2rad(degrees)
    plant.act("left_arm", target)
    assert plant.felt[0] is None
    assert plant.felt[1] is not None
    assert any(link.startswith("l_") for link in plant.felt[1].pair)
    assert plant.felt[1].depth == pytest.approx(0.02, abs=0.02)
