# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest

from experiments.claims.ch7_learning.information_gain import failing, reliable, rewards, trial, tries_to_prefer


def test_computed_rewards_are_those_of_the_thesis_tables():
    assert rewards("left_arm", "kail", reliable, repeats=1)[0, :3] == pytest.approx([0.0201, 0.0095, 0.0052], abs=5e-5)
    assert rewards("torso", "kail", failing, repeats=1)[0, :3] == pytest.approx([0.0487, 0.0196, 0.0103], abs=5e-5)


def test_plain_kl_never_prefers_a_failing_action_to_a_reliable_one():
    assert tries_to_prefer("left_arm", "kail", "failing") == 1.0
    assert np.isinf(tries_to_prefer("left_arm", "kl", "failing"))


@pytest.mark.parametrize(("divergence", "is_same"), [("kail", True), ("kl", False)])
def test_with_kail_the_expected_reward_does_not_depend_on_the_number_of_states(divergence, is_same):
    arm, torso = (trial({"part": part, "divergence": divergence, "transitions": 1}, 0)["first_reward"] for part in ("left_arm", "torso"))
    assert arm == pytest.approx(torso) if is_same else arm < torso
