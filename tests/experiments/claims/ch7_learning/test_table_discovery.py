# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from experiments.claims.ch7_learning.table_discovery import trial
from experiments.claims.ch7_learning.table_measures import (
    WINDOW,
    Judged,
    Run,
    agreement,
    at_second_peak,
    autocorrelation,
    is_cyclic,
    is_forward,
    low_goals,
    near_table,
    second_peak,
    spaces,
    summary,
)
from experiments.kit.cells import Cell, load_cells, write_cell
from experiments.kit.learning.arm import robot
from experiments.kit.learning.outcomes import outcome_counts, tries_of, uncertain_in

RUNS, WINDOWS, LONGEST = 6, 300, 100
PERIOD = 30


def noise(seed):
    return np.random.default_rng(seed).normal(size=(RUNS, WINDOWS))


def curves(rates):
    return np.array([autocorrelation(rate, LONGEST) for rate in rates])


def waves(periods):
    """A period of each run, with a phase of its own."""
    return np.sin(2.0 * np.pi * (np.arange(WINDOWS) / np.array(periods)[:, None] + np.linspace(0.0, 1.0, RUNS)[:, None]))


GHOSTS = curves(noise(1))


def test_contact_with_one_period_is_cyclic():
    found = curves(waves([PERIOD] * RUNS) + noise(0))
    assert second_peak(found) % PERIOD in (0, 1, PERIOD - 1)
    assert is_cyclic(found, GHOSTS) is True


def test_bouts_of_contact_without_a_period_are_not_cyclic():
    bouts = curves(lfilter([1.0], [1.0, -0.4], noise(0)))
    assert bouts[:, 1].min() > GHOSTS[:, 1].max()
    assert is_cyclic(bouts, GHOSTS) is False


def test_correlations_at_longer_lags_without_a_second_peak_are_open():
    assert is_cyclic(curves(lfilter([1.0], [1.0, -0.9], noise(0))), GHOSTS) is None


def test_runs_with_different_periods_are_open():
    assert is_cyclic(curves(waves([13, 17, 22, 29, 37, 47]) + noise(0)), GHOSTS) is None


def test_a_period_that_the_ghosts_have_too_is_not_cyclic():
    waving = waves([PERIOD] * RUNS)
    assert is_cyclic(curves(waving + noise(0)), curves(waving + noise(1))) is not True


def test_a_run_is_judged_at_the_peak_of_the_other_runs():
    alone = curves(np.concatenate([waves([PERIOD] * RUNS)[:1], waves([PERIOD / 2] * RUNS)[1:]]))
    here, there = at_second_peak(alone, np.zeros_like(alone))
    assert here[0] == pytest.approx(alone[0, second_peak(alone[1:])])
    assert there == [0.0] * RUNS


def test_the_autocorrelation_ignores_a_trend_and_shows_periods():
    steps = np.arange(100)
    periods = (steps // 10) % 2
    found = autocorrelation(periods + 0.01 * steps, 10)
    assert found[0] == pytest.approx(1.0)
    assert found[1] > 0.7
    assert found[10] < -0.7
    assert autocorrelation(steps % 2, 1)[1] < -0.9


def test_arms_that_prefer_the_same_actions_agree():
    tries = np.random.default_rng(0).normal(size=(3, 4))
    assert agreement(np.array([tries, 2.0 * tries + 1.0])) == pytest.approx(1.0)
    assert agreement(np.array([tries, -tries])) == pytest.approx(-1.0)


def test_precision_and_recall_of_a_ranking():
    judged = Judged(np.array([[True, False, True, False]]))
    assert judged.precision.tolist() == pytest.approx([1.0, 0.5, 2 / 3, 0.5])
    assert judged.recall.tolist() == pytest.approx([0.5, 0.5, 1.0, 1.0])
    assert (judged.at_all, judged.chance) == (0.5, 0.5)


def test_the_numbers_of_both_arms_of_a_run_are_averaged():
    judged = Judged(np.array([[True, True, False, False], [False, True, False, True]]))
    assert (judged.at_all, judged.chance) == (0.75, 0.5)
    assert judged.precision.tolist() == pytest.approx([0.5, 0.75, 0.5, 0.5])
    assert judged.recall.tolist() == pytest.approx([0.25, 0.75, 0.75, 1.0])


def bent(degrees):
    q = robot().home.copy()
    q[robot().motor_index("torso_pitch")] = np.deg2rad(degrees)
    return q


def test_a_hand_is_near_the_table_when_the_torso_is_bent_and_nearer_with_a_larger_margin():
    poses = np.array([bent(0.0), bent(25.0), bent(70.0)])
    touching, near = near_table(poses, "left_arm", 0.0), near_table(poses, "left_arm", 0.2)
    assert not touching[0]
    assert touching[2]
    assert near.sum() >= touching.sum()
    assert is_forward(poses).tolist() == [False, False, True]


def test_low_goals_are_the_same_for_both_arms():
    left, right = low_goals("left_arm"), low_goals("right_arm")
    assert (left == right).all()
    assert 20 < left.sum() < 40


def test_the_summary_of_a_run_has_the_counts_of_its_transitions(tmp_path):
    values = trial({"explorer": "curious", "world": "table", "propagate": "tree", "transitions": 260}, 0)
    write_cell(tmp_path, Cell("a", 0), summary(values), 1.0)
    run = Run(load_cells(tmp_path)["a"])
    for part, space in spaces().items():
        seen = values[f"seen_{part}"].astype(int)
        assert np.array_equal(run.tries[part], tries_of(space, seen)) and run.tries[part].sum() == 260
        assert np.array_equal(run.late_tries[part], tries_of(space, seen[130:]))
        assert np.array_equal(run.outcomes[part], outcome_counts(space, seen))
        assert run.timeouts[part] == pytest.approx(1.0 - values[f"settled_{part}"].mean())
    assert run.half_failing == sum(uncertain_in(spaces()[arm], values[f"seen_{arm}"].astype(int)) for arm in ("left_arm", "right_arm"))
    touch = np.array([values["touch_left_arm"], values["touch_right_arm"]])
    assert run.touch == pytest.approx(touch[:, 130:].mean()) and run.touch_rate[0] == pytest.approx(touch[:, :WINDOW].mean())
