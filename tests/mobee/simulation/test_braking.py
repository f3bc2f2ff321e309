# SPDX-License-Identifier: Apache-2.0
"""References that can be braked; numpy says the same of whole arrays."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from mobee.arrays import Array
from mobee.simulation.motors import Braking

N, DT = 6, 0.01
LOWER, UPPER = np.linspace(-2.0, -0.5, N), np.linspace(0.5, 2.0, N)
FASTEST, CHANGE = np.full(N, 1.05), np.full(N, 10.5 * DT)

seeds = st.integers(0, 2**32 - 1)


def braking() -> Braking:
    return Braking(LOWER, UPPER, FASTEST, CHANGE, DT)


def brakeable(distance: Array) -> Array:
    """The largest velocity that whole ticks of full braking end within the distance."""
    return np.minimum(FASTEST, CHANGE * (np.sqrt(0.25 + 2.0 * np.maximum(distance, 0.0) / (CHANGE * DT)) - 0.5))


@given(seed=seeds)
def test_a_velocity_is_approached_as_far_as_it_can_be_braked(seed: int) -> None:
    rng = np.random.default_rng(seed)
    q, wanted, before = rng.uniform(LOWER - 0.1, UPPER + 0.1), rng.uniform(-2, 2, N), rng.uniform(-FASTEST, FASTEST)
    asked = braking()
    asked.velocity[:] = before
    asked.to_velocity(wanted, q)
    allowed = np.clip(wanted, -brakeable(q - LOWER), brakeable(UPPER - q))
    np.testing.assert_array_equal(asked.velocity, np.clip(allowed, before - CHANGE, before + CHANGE))


@given(seed=seeds)
def test_a_position_is_approached_as_fast_as_it_can_be_braked_and_reached_at_rest(seed: int) -> None:
    rng = np.random.default_rng(seed)
    wanted, asked = rng.uniform(LOWER - 0.5, UPPER + 0.5), braking()
    asked.position[:] = rng.uniform(LOWER, UPPER)
    goal = np.clip(wanted, LOWER, UPPER)
    for _ in range(600):
        before, rest = asked.velocity.copy(), goal - asked.position
        asked.to_position(wanted)
        allowed = np.sign(rest) * np.minimum(brakeable(np.abs(rest)), np.abs(rest) / DT)
        np.testing.assert_array_equal(asked.velocity, np.clip(allowed, before - CHANGE, before + CHANGE))
    np.testing.assert_allclose(asked.position, goal, atol=1e-6)
    np.testing.assert_allclose(asked.velocity, 0.0, atol=1e-4)


@given(seed=seeds)
def test_a_motor_that_cannot_stop_in_time_is_detected(seed: int) -> None:
    rng = np.random.default_rng(seed)
    q, moving = rng.uniform(LOWER, UPPER), rng.uniform(-1.3, 1.3, N)
    late = (moving > brakeable(UPPER - q) + CHANGE) | (moving < -brakeable(q - LOWER) - CHANGE)
    assert braking().runs_out(q, moving) == late.any()
