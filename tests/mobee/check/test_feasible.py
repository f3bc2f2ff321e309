# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from mobee.check.constraints import conflict
from mobee.robot.robot import Clause

LIMITS = np.array([[-1.0, 1.0]] * 3)


def clause(*rows: tuple[list[float], float]) -> Clause:
    return Clause("arm", np.array([a for a, _ in rows]), np.array([b for _, b in rows]))


@given(st.integers(0, 10_000))
def test_clauses_made_around_a_pose_never_conflict(seed: int) -> None:
    rng = np.random.default_rng(seed)
    q = rng.uniform(-0.9, 0.9, 3)
    made = []
    for _ in range(6):
        a = rng.normal(size=3)
        made.append(clause((list(a), 0.05 * float(np.linalg.norm(a)) - float(a @ q))))
    assert conflict(made, LIMITS, rng.uniform(-1, 1, (20, 3))) == ()


def test_the_clauses_that_fight_are_named_and_no_other() -> None:
    made = [clause(([1, 0, 0], 0.5)), clause(([0, 1, 0], -0.2)), clause(([0, 0, 1], 0.5)), clause(([0, -1, 0], 0.1))]
    assert conflict(made, LIMITS, np.zeros((1, 3))) == (1, 3)


def test_one_row_of_a_clause_suffices() -> None:
    made = [clause(([0, 1, 0], -0.2), ([0, -1, 0], -0.2)), clause(([0, -1, 0], 0.1))]
    assert conflict(made, LIMITS, np.zeros((1, 3))) == ()


def test_a_clause_that_fights_the_limits_is_alone() -> None:
    assert conflict([clause(([1, 1, 1], 0.5)), clause(([1, 0, 0], -1.5))], LIMITS, np.zeros((1, 3))) == (1,)


def test_among_many_clauses_of_two_rows_the_rows_that_are_nearly_satisfied_are_tried_first() -> None:
    """Each of 12 motors has to be beyond .98 or below -2, and only the former can be."""
    limits, count = np.array([[-1.0, 1.0]] * 12), 12
    made = [clause((list(-np.eye(count)[k]), -2.0), (list(np.eye(count)[k]), -0.98)) for k in range(count)]
    assert conflict(made, limits, np.zeros((1, count))) == ()


def test_clauses_that_share_no_motor_are_judged_apart() -> None:
    """Two pairs that fight: the first is named, and nothing of the second."""
    made = [clause(([1, 0, 0], -0.5)), clause(([0, 1, 0], -0.5)), clause(([-1, 0, 0], 0.2)), clause(([0, -1, 0], 0.2))]
    assert conflict(made, LIMITS, np.zeros((1, 3))) == (0, 2)
