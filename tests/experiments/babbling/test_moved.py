from __future__ import annotations

import numpy as np

from experiments.babbling.moved import COUNT, Targets, moved_motors
from mobee import load_robot

ROBOT = load_robot("icub")


def test_the_23_motors_are_torso_head_and_arms_without_hands() -> None:
    moved = moved_motors(ROBOT)
    by_part = {name: int(((moved >= part.slice.start) & (moved < part.slice.stop)).sum()) for name, part in ROBOT.parts.items()}
    assert len(moved) == COUNT
    assert by_part == {"torso": 3, "head": 6, "left_arm": 7, "right_arm": 7}


def test_postures_fill_the_ranges_and_leave_the_hands_at_home() -> None:
    targets, moved = Targets(ROBOT, 1), moved_motors(ROBOT)
    q = np.array([targets.next() for _ in range(500)])
    lower, upper = ROBOT.limits[moved].T
    share = (q[:, moved] - lower) / (upper - lower)
    assert share.min() >= 0.0 and share.max() <= 1.0
    assert (share.min(axis=0) < 0.02).all() and (share.max(axis=0) > 0.98).all()
    still = np.setdiff1d(np.arange(len(ROBOT.motors)), moved)
    assert (q[:, still] == ROBOT.home[still]).all()


def test_a_seed_is_a_sequence() -> None:
    one, same, other = Targets(ROBOT, 1), Targets(ROBOT, 1), Targets(ROBOT, 2)
    first = one.next()
    assert np.array_equal(first, same.next())
    assert not np.array_equal(first, other.next())
    assert not np.array_equal(first, one.next())
