# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest

from mobee.learning.reaching.predictors.covariance import FACTORS, fitted_factors, scales_of


def test_only_two_reaches_in_the_same_earlier_world_share_its_differences():
    scales = scales_of(np.array([0, 0, 1, 2, 2]), np.array([0.3, 3.0, 0.0]))
    expected = np.ones((5, 5))
    expected[:2, :2] = 1.3
    expected[2, 2] = 4.0
    np.testing.assert_array_equal(scales, expected)


def drawn(factors: list[float], seed: int, n: int = 120) -> tuple[np.ndarray, ...]:
    """Return covariances, noise, rewards and worlds of n reaches in each world; the rewards are drawn with these factors."""
    rng = np.random.default_rng(seed)
    world = np.repeat(np.arange(len(factors)), n)
    place = rng.uniform(0.0, 1.0, len(world))
    between = 0.04 * np.exp(-0.5 * ((place[:, None] - place) / 0.1) ** 2)
    noise = np.full(len(world), 0.05**2)
    matrix = between * scales_of(world, np.array(factors)) + np.diag(noise)
    return between, noise, np.linalg.cholesky(matrix) @ rng.standard_normal(len(world)), world


@pytest.mark.parametrize("factors", [[0.0, 0.0], [1.0, 0.0], [10.0, 0.1, 0.0], [0.0, 1.0, 0.0]])
def test_factors_with_which_rewards_were_drawn_are_found_again(factors):
    """Within a step or two of the values: 120 rewards along one line determine a variance to about 40 %."""
    for seed in range(3):
        between, noise, residual, world = drawn(factors, seed)
        found = fitted_factors(between, noise, residual, world, np.zeros(len(factors)))
        steps = [abs(FACTORS.index(one) - FACTORS.index(other)) for one, other in zip(found, factors, strict=True)]
        assert max(steps) <= 2 and found[-1] == 0.0


def test_without_rewards_the_factors_stay():
    nothing = np.zeros(0)
    assert fitted_factors(np.zeros((0, 0)), nothing, nothing, nothing.astype(int), np.zeros(3)).tolist() == [0.0, 0.0, 0.0]
