# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np

from experiments.claims.ch7_learning.exploration_uniformity import CLAIMS, EXPLORERS
from experiments.kit.experiment import judged
from experiments.kit.learning.outcomes import Explored

UNIFORM, UNEQUAL = np.array([10, 11, 10, 11, 10, 20]), np.array([1, 30, 2, 40, 3, 2])
VISITS = {True: np.array([5, 5, 6]), False: np.array([1, 9, 20])}


def runs(is_uniform, fails=True):
    """Three seeds that try six actions, of which the last fails."""
    tries = UNIFORM if is_uniform else UNEQUAL
    failures = np.where(np.arange(6) == 5, tries, 0) * fails
    return [Explored(seed, tries, failures, VISITS[is_uniform], {}) for seed in range(3)]


def verdicts(fails=True):
    nearest = {("nearest", explorer): runs(explorer == "curious", fails) for explorer in EXPLORERS}
    equidistant = {("equidistant", explorer): runs(explorer != "random", fails) for explorer in EXPLORERS}
    return [claim["verdict"] for claim in judged(CLAIMS, nearest | equidistant)]


def test_uniform_tries_with_spikes_where_actions_fail_confirm_the_claims():
    assert verdicts() == ["confirmed"] * 4 + ["met"]


def test_where_no_action_fails_spikes_are_open():
    assert verdicts(fails=False) == ["confirmed", "confirmed", "open", "open", "met"]
