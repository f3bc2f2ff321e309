# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest

from experiments.kit.learning.arm import arm_space
from experiments.kit.learning.arm_planners import Learned, PlannedOnce, Repaired, Roadmap, Straight
from mobee import TransitionModel

A, B, C, D = (np.array([x, y, 0.0, 0.0]) for x, y in ((0.0, 0.0), (0.0, 0.4), (0.3, 0.6), (0.6, 0.4)))
ELSEWHERE = np.array([0.0, 0.2, 0.0, 0.0])


class Free:
    span = np.ones(4)

    def sound_motion(self, start, end, cables=True):
        return bool(np.linalg.norm(end - start) < 0.5)


@pytest.fixture
def roadmap():
    """A - B, then to D directly at 0.6, or over C."""
    return Roadmap(np.array([A, B, C, D]), [(0, 1), (1, 3), (1, 2), (2, 3)], Free())


def test_a_motion_that_fails_is_taken_out_and_the_way_planned_anew(roadmap):
    rival = Repaired(roadmap, {7: 3}, 1, remembers=False)
    rival.begin(7)
    aims = [rival.aim(A)]
    rival.observe(A, A)
    aims.append(rival.aim(A))
    rival.observe(A, B)
    aims.append(rival.aim(B))
    assert np.array_equal(aims, [A, B, D]) and rival.repairs == 0
    rival.observe(B, B)
    assert rival.repairs == 1
    rival.aim(B)
    rival.observe(B, B)  # back on the roadmap
    assert np.array_equal(rival.aim(B), C)


@pytest.mark.parametrize(("remembers", "second"), [(True, C), (False, D)])
def test_what_was_taken_out_stays_out_only_for_who_remembers(roadmap, remembers, second):
    rival = Repaired(roadmap, {7: 3}, 1, remembers)
    for _ in range(2):
        rival.begin(7)
        rival.aim(B)
        rival.observe(B, B)
        last = rival.aim(B)
        rival.observe(B, B)
    assert np.array_equal(last, second)


def test_when_no_way_is_left_all_motions_are_tried_again(roadmap):
    rival = Repaired(roadmap, {7: 3}, 1, remembers=True)
    rival.begin(7)
    for _ in range(20):
        assert rival.aim(A) is not None
        rival.observe(A, ELSEWHERE)


def test_who_plans_once_passes_all_vertices_wherever_it_is_and_then_gives_up(roadmap):
    rival = PlannedOnce(roadmap, {7: 3}, 1)
    rival.begin(7)
    aims = [rival.aim(q) for q in (A, ELSEWHERE, ELSEWHERE)]
    assert np.array_equal(aims, [A, B, D])
    assert rival.aim(D) is None
    rival.begin(7)
    assert np.array_equal(rival.aim(A), A)


def test_going_straight_aims_at_the_goal():
    space = arm_space()
    rival = Straight(space)
    rival.begin(5)
    assert np.array_equal(rival.aim(space.samples[80]), space.samples[5])


def test_the_learned_planner_avoids_an_action_that_it_has_seen_fail():
    space = arm_space()
    rival = Learned(space, TransitionModel(space))
    rival.begin(4)
    aims = []
    for _ in range(4):
        aims.append(space.state_of(rival.aim(space.samples[0])))
        rival.observe(space.samples[0], space.samples[0])
    assert set(aims[:2]) == {1, 3} and rival.repairs == 4
