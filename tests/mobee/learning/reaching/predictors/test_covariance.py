# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest

from mobee.learning.reaching.predictors import covariance as evidence
from mobee.learning.reaching.predictors.covariance import (
    Covariance,
    LinearArm,
    default_parameters,
    fitted_pairs,
    fitted_parameters,
    joint_squares,
    negative_log_posterior,
    points,
)
from mobee.learning.reaching.predictors.predictor import Reached
from tests.mobee.learning.reaching.predictors.arms import drawn, reaches


def known(seen, worlds: int = 1) -> Reached:
    reached = Reached()
    for number, (state, target, value) in enumerate(seen):
        reached.add(state, target, value, number * worlds // len(seen))
    return reached


def before(reached: Reached):
    return np.full(len(reached), 0.2)


def test_differences_of_surprise_are_those_of_all_rewards_taken_one_by_one():
    made, seen = reaches(), drawn(reaches(), 60)
    squares, first = joint_squares(made), default_parameters(reaches())
    state, where, value = (np.array(column) for column in zip(*seen, strict=True))
    data = points(LinearArm(made), state, where)

    def plain(logs):
        covariance = Covariance(squares, logs)
        matrix = covariance.between(data, data) + covariance.noise * np.eye(len(seen))
        residual = value - 0.2
        return 0.5 * (residual @ np.linalg.solve(matrix, residual) + np.linalg.slogdet(matrix)[1] + (logs - first) @ (logs - first))

    other = first + np.random.default_rng(0).normal(0.0, 0.3, len(first))
    merged = [negative_log_posterior(logs, LinearArm(made), squares, known(seen), before(known(seen)))[0] for logs in (first, other)]
    assert merged[1] - merged[0] == pytest.approx(plain(other) - plain(first), abs=1e-8)


@pytest.mark.parametrize("factors", [np.zeros(1), np.array([0.3, 3.0, 0.0])])
def test_the_derivatives_are_those_of_the_surprise(factors):
    made, reached = reaches(), known(drawn(reaches(), 50), len(factors))
    logs, step, rest = default_parameters(made) + 0.2, 1e-5, (LinearArm(made), joint_squares(made), reached, before(reached), factors)
    _, slope = negative_log_posterior(logs, *rest)
    for axis, unit in enumerate(np.eye(len(logs))):
        up, down = (negative_log_posterior(logs + sign * step * unit, *rest)[0] for sign in (1.0, -1.0))
        assert slope[axis] == pytest.approx((up - down) / (2.0 * step), rel=1e-5, abs=1e-5)


def test_the_most_likely_parameters_are_less_surprising_than_the_usual_ones():
    made, reached = reaches(), known(drawn(reaches(), 80))
    squares, first = joint_squares(made), default_parameters(made)
    rest = LinearArm(made), squares, reached, before(reached)
    assert negative_log_posterior(fitted_parameters(first, *rest), *rest)[0] < negative_log_posterior(first, *rest)[0] - 1.0


def test_the_fit_uses_a_limited_number_of_pairs(monkeypatch):
    made, reached = reaches(), known(drawn(reaches(), 80))
    monkeypatch.setattr(evidence, "MAX_FITTED", 10)
    few, _ = negative_log_posterior(default_parameters(made), LinearArm(made), joint_squares(made), reached, before(reached))
    monkeypatch.undo()
    assert few != negative_log_posterior(default_parameters(made), LinearArm(made), joint_squares(made), reached, before(reached))[0]


def test_a_fit_uses_all_pairs_of_the_newest_world_first(monkeypatch):
    monkeypatch.setattr(evidence, "MAX_FITTED", 20)
    reached = Reached()
    for number in range(60):
        reached.add(number % 12, np.full(3, 0.01 * number), 0.5, int(number >= 45))
    chosen = fitted_pairs(reached)
    assert len(chosen) == 20 and set(range(45, 60)) <= set(chosen.tolist())
    assert chosen.tolist() == sorted(chosen.tolist()) and chosen[0] == 0
