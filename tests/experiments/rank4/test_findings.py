from __future__ import annotations

import numpy as np
import pytest

from experiments.kit.arm_learning import RANK4, arm_space
from experiments.rank4.findings import contacts_by_pair
from experiments.rank4.runs import Run

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
        "arm and chest": {"actions": 1.0, "deepest_mm": pytest.approx(10.0), "succeed": 0.5}
    }
