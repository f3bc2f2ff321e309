# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mobee.errors import InvalidValue
from mobee.learning.reaching.reaches import REACH
from mobee.learning.reaching.store import Problems, Step, made_of
from mobee.reach import ReachTarget

MOVE = Step(
    n=5, number=2, problem=7, s=3, a=1, s_next=4, failed=False, reward=0.0, expected=0.0, missing=0.0, settled=True, duration=2.0, q=(0.1,)
)


FAILURE = replace(MOVE, n=6, s=4, a=0, failed=True, reward=-10.0, settled=False, duration=3.0)


REACHED = replace(MOVE, n=7, s=4, a=REACH, s_next=9, reward=0.25, expected=0.75, missing=0.03, duration=4.0)


def test_a_try_is_made_of_its_transitions_and_the_reach_that_ends_it():
    made = made_of([MOVE, FAILURE, REACHED])
    assert (made.number, made.problem, made.path, made.failures) == (2, 7, ((3, 1, 4, False), (4, 0, 4, True)), 1)
    assert (made.reach_state, made.reward, made.expected, made.missing) == (4, 0.25, 0.75, 0.03)
    assert made.intrinsic == pytest.approx(0.5)  # thesis eq. 8.6: expected less actual
    assert (made.timeouts, made.duration) == (1, 9.0)


def test_a_try_that_ended_without_a_reach_was_worth_nothing():
    made = made_of([MOVE, FAILURE])
    assert (made.reach_state, made.reward, made.expected, made.intrinsic, made.missing) == (None, 0.0, 0.0, 0.0, 0.0)
    assert len(made.path) == 2


A, B, C = (ReachTarget(np.array([x, 0.0, 0.2])) for x in (-0.3, -0.2, -0.0))


def test_a_problem_is_a_place():
    problems = Problems()
    assert [problems.index(target) for target in (A, B, A)] == [0, 1, 0]
    assert problems.index(ReachTarget(B.position.copy(), radius=0.02)) == 1
    assert problems.index(C) == problems.index(ReachTarget(np.array([0.0, 0.0, 0.2]))) == 2
    assert len(problems) == 3


def test_the_least_tried_is_chosen_and_ties_are_drawn():
    problems = Problems()
    problems.tries[problems.index(A)] += 2
    problems.tries[problems.index(B)] += 1
    rng = np.random.default_rng(0)
    assert problems.least_tried([A, B], rng) is B
    assert problems.least_tried([A, B, C], rng) is C
    problems.tries[1] += 1
    assert {problems.least_tried([A, B], rng).position[0] for _ in range(50)} == {-0.3, -0.2}


def test_nothing_to_choose_from_is_refused():
    with pytest.raises(InvalidValue, match="at least one target"):
        Problems().least_tried([], np.random.default_rng(0))
