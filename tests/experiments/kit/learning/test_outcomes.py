# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest

import mobee
from experiments.kit.cells import Cell
from experiments.kit.learning.outcomes import (
    Explored,
    constraint_actions,
    exists_in,
    explored,
    failure_shares,
    failures_of,
    first_places,
    first_tries,
    goals_of,
    in_order,
    outcome_counts,
    relative_tries,
    relative_tries_of,
    tries_of,
    uncertain_in,
    visits_of,
)
from tests.experiments.finished_cells import finished

SPACE = mobee.Lattice(mobee.load_robot("icub"), ["l_elbow", "l_shoulder_yaw"], neighbours="equidistant")  # 0 has the goals 1 and 3
SEEN = np.array([[0, 0, 1], [0, 0, 4], [0, 0, 1], [0, 1, 3], [4, 2, 5]])


def test_tries_goals_and_visits_are_counted():
    assert tries_of(SPACE, SEEN)[0].tolist() == [3, 1, 0, 0]
    assert tries_of(SPACE, SEEN).sum() == len(SEEN)
    assert goals_of(SPACE, SEEN).tolist() == [1, 1, 1, 3, 5]
    assert visits_of(SPACE, SEEN).tolist() == [0, 2, 0, 1, 1, 1, 0, 0, 0]


def test_records_of_small_unsigned_numbers_are_counted_alike():
    small = SEEN.astype(np.uint16)
    assert (tries_of(SPACE, small) == tries_of(SPACE, SEEN)).all() and (failures_of(SPACE, small) == failures_of(SPACE, SEEN)).all()
    assert failures_of(SPACE, SEEN)[0].tolist() == [1, 0, 0, 0]
    assert exists_in(SPACE).sum() == SPACE.state_actions


def test_a_failure_is_an_end_elsewhere_and_what_was_never_tried_has_no_share():
    shares = failure_shares(SPACE, SEEN)
    assert shares[0, :2] == pytest.approx([1 / 3, 0.0])
    assert np.isnan(shares[1]).all()


FEWER = np.array([[0, 0, 1], [0, 0, 4], [0, 1, 3]])


def test_runs_are_grouped_by_two_settings_in_the_order_of_their_seeds():
    cells = [Cell(f"{how}-s{seed}", seed, {"where": "here", "how": how}) for how in ("one", "other") for seed in (3, 1)]
    groups = explored(finished(lambda cell: {"seen": FEWER[: cell.seed], "more": cell.seed}, cells), lambda where: SPACE, "where", "how")
    assert list(groups) == [("here", "one"), ("here", "other")]
    assert [(run.seed, run.values["more"]) for run in groups["here", "one"]] == [(1, 1), (3, 3)]


def test_tries_and_failures_are_of_the_state_actions_there_are():
    cell = Cell("one", 0, {"where": "here", "how": "one"})
    (run,) = explored(finished(lambda cell: {"seen": FEWER}, [cell]), lambda where: SPACE, "where", "how")["here", "one"]
    assert len(run.tries) == len(run.failures) == SPACE.state_actions
    assert (run.tries[:2].tolist(), run.failures[:2].tolist(), run.tries.sum()) == ([2, 1], [1, 0], 3)
    assert run.visits.tolist() == [0, 1, 0, 1, 1, 0, 0, 0, 0]


def run(tries, failures):
    return Explored(0, np.array(tries), np.array(failures), np.zeros(1, dtype=int), {})


def test_actions_at_constraints_fail_in_more_than_half_of_all_tries():
    chosen = constraint_actions([run([4, 4, 1, 0], [3, 2, 0, 0]), run([2, 4, 1, 0], [0, 2, 1, 0])])
    assert chosen.tolist() == [False, False, False, False]
    assert constraint_actions([run([4, 4], [3, 2])]).tolist() == [True, False]


def test_where_nothing_can_be_compared_there_is_no_ratio():
    assert np.isnan(relative_tries(np.array([3, 5]), np.array([False, False])))
    assert relative_tries(np.array([6, 3]), np.array([True, False])) == 2.0


def test_a_run_is_judged_by_actions_that_fail_in_the_others():
    first, second = run([9, 3], [9, 0]), run([2, 4], [0, 4])
    assert relative_tries_of([first, second], [first, second]) == pytest.approx([3 / 9, 2 / 4])
    assert relative_tries_of([first], [first, run([5, 5], [0, 0])]) == []


def test_first_tries_are_numbered_from_one():
    assert first_tries(SPACE, SEEN).tolist() == [1, 4, 5]
    assert first_places([4, 2, 4, 7]).tolist() == [0, 1, 3]


def test_an_action_is_uncertain_that_sometimes_fails():
    assert uncertain_in(SPACE, SEEN) == 1 and uncertain_in(SPACE, SEEN[3:]) == 0


def test_sorted_transitions_have_the_same_counts(rng):
    shuffled = rng.permutation(SEEN)
    assert np.array_equal(in_order(shuffled), in_order(SEEN))
    for counts in (tries_of, failures_of, outcome_counts, visits_of):
        assert np.array_equal(counts(SPACE, in_order(shuffled)), counts(SPACE, SEEN))
