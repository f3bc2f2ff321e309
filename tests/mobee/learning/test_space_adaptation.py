# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest

import mobee
from mobee import Space
from mobee.learning.neighbours import edges_of
from mobee.learning.space import carried, pruned, with_shortcuts
from mobee.store import Transition
from tests.mobee.learning.toys import toy_robot

SAMPLES = np.array([[0.3], [0.6], [0.9], [1.2], [1.5]])
RING = [[1, 4], [0, 2], [1, 3], [2, 4], [0, 3]]


def space() -> Space:
    return Space(toy_robot(), ["l_elbow"], SAMPLES, RING)


def walked(*states: int) -> list[Transition]:
    """Every action reaches its goal."""
    line = space()
    return [
        Transition(n, s, line.actions(s).tolist().index(g), g, 0.0, True, 1.0, tuple(line.target(g).tolist()))
        for n, (s, g) in enumerate(zip(states, states[1:], strict=False), start=1)
    ]


def failed(state: int, goal: int, times: int) -> list[Transition]:
    line = space()
    action = line.actions(state).tolist().index(goal)
    return [Transition(n + 1, state, action, state, 0.0, True, 1.0, tuple(line.target(state).tolist())) for n in range(times)]


def test_a_state_that_was_aimed_at_in_vain_is_pruned_with_the_actions_to_it():
    left, number = pruned(space(), [*walked(0, 1, 2), *failed(2, 3, 5)])
    assert number.tolist() == [0, 1, 2, -1, 3]
    assert left.goals.tolist() == [[1, 3], [0, 2], [1, -1], [0, -1]]
    assert len(pruned(space(), [*walked(0, 1, 2), *failed(2, 3, 4)])[0]) == 5


class Rounded(Space):
    def aim(self, state, action):
        return super().aim(state, action).round(6)


def test_a_subclass_whose_states_are_poses_alone_is_adapted():
    given = Rounded(toy_robot(), ["l_elbow"], SAMPLES, RING)
    assert len(pruned(given, walked(0, 1, 2))[0]) == len(with_shortcuts(given, walked(0, 1, 2), 1)) == 5


def test_what_was_reached_once_stays():
    assert len(pruned(space(), [*walked(2, 3, 2), *failed(2, 3, 50)])[0]) == 5


def test_shortcuts_join_what_is_often_passed_one_after_the_other():
    shorter = with_shortcuts(space(), walked(0, 1, 2, 1, 0, 1, 2, 3), count=1)
    assert set(edges_of(shorter.goals)) - set(edges_of(space().goals)) == {(0, 2), (2, 0)}


def test_a_path_back_to_its_start_makes_no_shortcut():
    assert np.array_equal(with_shortcuts(space(), walked(0, 1, 0, 1, 0), count=3).goals, space().goals)


def test_transitions_are_carried_over_where_their_states_and_action_are_still_there():
    made = [*walked(0, 1, 2, 3, 4), *failed(0, 4, 2)]
    left, number = pruned(space(), [*made, *failed(0, 4, 5)])
    assert (number >= 0).all()
    fewer = Space(toy_robot(), ["l_elbow"], SAMPLES[:4], [[1, -1], [0, 2], [1, 3], [2, -1]])
    kept = carried(made, space(), fewer)
    assert [(one.n, one.s, one.s_next) for one in kept] == [(1, 0, 1), (2, 1, 2), (3, 2, 3)]
    shorter = with_shortcuts(space(), walked(0, 1, 2), count=1)
    assert [(one.s, one.s_next) for one in carried(made, space(), shorter)] == [(one.s, one.s_next) for one in made]


def test_a_space_of_which_nothing_was_reached_is_not_pruned_away():
    line = Space(toy_robot(), ["l_elbow"], SAMPLES[:2], [[1], [0]])
    vain = [Transition(n + 1, 0, 0, 0, 0.0, True, 1.0, tuple(line.target(0).tolist())) for n in range(5)]
    with pytest.raises(mobee.InvalidValue, match="observe more"):
        pruned(line, vain)
