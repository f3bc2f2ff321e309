# SPDX-License-Identifier: Apache-2.0
"""Targets and first poses of the live tries."""

from __future__ import annotations

import numpy as np

from experiments.claims.ch8_reaching.live_reach.problems import (
    GRID,
    MARKER,
    OBSTACLE_MOVES,
    TARGET_MOVES,
    WRIST,
    belief,
    fresh_problems,
    grid_problems,
    grid_targets,
    moving_problems,
    touchable,
)


def test_21_of_the_27_targets_can_be_touched() -> None:
    known = belief()
    others = [number for number, target in enumerate(grid_targets()) if not touchable(known, target)]
    assert others == [6, 8, 11, 18, 19, 20]  # two beyond the stretched arm, four in front of face, chest and belly


def test_tries_begin_without_contacts_and_are_those_of_their_seed() -> None:
    known = belief()
    for problem in fresh_problems(3, 2):
        known.present(problem.target)
        assert touchable(known, problem.target)
        assert known.sound(np.array([problem.start[:WRIST]]), "fields")[0]
    assert fresh_problems(3, 2) == fresh_problems(3, 2) != fresh_problems(4, 2)


def test_the_grid_has_all_27_targets_with_different_first_poses() -> None:
    problems = grid_problems(0)
    assert [(one.kind, one.number) for one in problems] == [(GRID, number) for number in range(27)]
    assert len({tuple(one.start) for one in problems}) == 27


def test_an_obstacle_crosses_the_path_of_the_hand_in_the_middle() -> None:
    known, problems = belief(), moving_problems(0, 2)
    assert [one.kind for one in problems] == [TARGET_MOVES] * 2 + [OBSTACLE_MOVES] * 2
    for one in problems[2:]:
        hand = known.model.evaluate(known.whole(np.array(one.start[:WRIST]))).position(MARKER)
        first, last = np.array(one.path)
        assert np.allclose(0.5 * (first + last), 0.5 * (hand + one.position))
        assert abs((last - first) @ (hand - one.position)) < 1e-9
