# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest

from services.robot_sim.sensors import PHASE_RANGE, Phases

PARTS = ("torso", "head", "left_arm", "right_arm")


def test_parts_have_different_phases_and_a_little_jitter() -> None:
    phases = Phases(PARTS, jitter=0.02, seed=3)
    times = {part: [] for part in PARTS}
    for _ in range(500):
        tick = phases.next()
        assert tick == sorted(tick)
        for share, part in tick:
            times[part].append(share)
    means = sorted(float(np.mean(t)) for t in times.values())
    assert all(0.0 <= mean <= PHASE_RANGE for mean in means)
    assert min(np.diff(means)) > 0.01
    for part in PARTS:
        assert np.std(times[part]) == pytest.approx(0.02, rel=0.3)
        assert 0.0 <= min(times[part]) and max(times[part]) <= 0.95


def test_the_seed_decides() -> None:
    assert Phases(PARTS, 0.02, 1).next() == Phases(PARTS, 0.02, 1).next()
    assert Phases(PARTS, 0.02, 1).next() != Phases(PARTS, 0.02, 2).next()
