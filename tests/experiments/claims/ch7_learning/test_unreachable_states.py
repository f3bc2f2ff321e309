# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest

from experiments.claims.ch7_learning.unreachable_states import Run, SelfContactPlant, contacts_by_pair
from experiments.kit.learning.arm import RANK4, STRETCHED, arm_plant, arm_space


def test_recording_contacts_does_not_change_the_actions():
    watched, plain, space = SelfContactPlant(arm_plant(3)), arm_plant(3), arm_space(STRETCHED)
    for state in (0, 5, 61, 2):  # 61 cannot be reached
        one, other = watched.act("left_arm", space.target(state)), plain.act("left_arm", space.target(state))
        assert np.array_equal(one.q, other.q)
        assert (one.settled, one.duration) == (other.settled, other.duration)
    assert len(watched.contacts) == 4


SPACE = arm_space(RANK4)


def run(seen, touching):
    depths = np.where(np.array(touching) >= 0, 0.01, 0.0)
    return Run(SPACE, np.array(seen), np.zeros(SPACE.goals.shape), ["arm and chest"], np.array(touching), depths)


def test_unreached_states_are_those_without_arrival():
    every = np.array([[0, 0, state] for state in range(256) if state != 60])
    assert run(every, [-1] * 255).unreached == (60,)


def test_self_contacts_are_counted_by_pair_with_their_success():
    one = run([[0, 0, 1], [1, 0, 0], [0, 0, 0]], [0, -1, 0])
    assert contacts_by_pair([one, run([[0, 0, 1]], [-1])]) == {
        "arm and chest": {"actions_per_run": 1.0, "deepest_mm": pytest.approx(10.0), "share_that_succeeds": 0.5}
    }
