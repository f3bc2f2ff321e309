from __future__ import annotations

import numpy as np

from experiments.control.postures import random_posture
from mobee import load_robot

ICUB = load_robot("icub")


def test_the_motors_named_are_within_their_shares_and_the_others_at_home() -> None:
    q = random_posture(ICUB, np.random.default_rng(1), {"torso": 3, "left_arm": 2}, (0.4, 0.6))
    moved = np.flatnonzero(q != ICUB.home)
    first = ICUB.parts["left_arm"].start
    assert moved.tolist() == [0, 1, 2, first, first + 1]
    low, high = ICUB.limits[moved].T
    share = (q[moved] - low) / (high - low)
    assert (share >= 0.4).all() and (share <= 0.6).all() and np.ptp(share) > 0.01
