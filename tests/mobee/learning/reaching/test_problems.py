from __future__ import annotations

import numpy as np
import pytest

from mobee.errors import InvalidValue
from mobee.learning.reaching.tries import Problems
from mobee.reach import ReachTarget

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
