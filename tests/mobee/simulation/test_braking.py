"""References that can be braked; numpy says the same of whole arrays."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from mobee.robot.robot import Array
from mobee.simulation.load import compiled

N, DT = 6, 0.01
LOWER, UPPER = np.linspace(-2.0, -0.5, N), np.linspace(0.5, 2.0, N)
FASTEST, CHANGE = np.full(N, 1.05), np.full(N, 10.5 * DT)
BOUNDS = LOWER, UPPER, FASTEST, CHANGE

seeds = st.integers(0, 2**32 - 1)


def brakeable(distance: Array) -> Array:
    """The largest velocity that whole ticks of full braking end within the distance."""
    return np.minimum(FASTEST, CHANGE * (np.sqrt(0.25 + 2.0 * np.maximum(distance, 0.0) / (CHANGE * DT)) - 0.5))


@given(seed=seeds)
def test_a_velocity_is_approached_as_far_as_it_can_be_braked(seed: int) -> None:
    rng = np.random.default_rng(seed)
    q, wanted, before = rng.uniform(LOWER - 0.1, UPPER + 0.1), rng.uniform(-2, 2, N), rng.uniform(-FASTEST, FASTEST)
    velocity = before.copy()
    compiled().braking.to_velocity(wanted, q, *BOUNDS, velocity, DT)
    allowed = np.clip(wanted, -brakeable(q - LOWER), brakeable(UPPER - q))
    np.testing.assert_array_equal(velocity, np.clip(allowed, before - CHANGE, before + CHANGE))


@given(seed=seeds)
def test_a_position_is_approached_as_fast_as_it_can_be_braked_and_reached_at_rest(seed: int) -> None:
    rng = np.random.default_rng(seed)
    wanted, at, velocity = rng.uniform(LOWER - 0.5, UPPER + 0.5), rng.uniform(LOWER, UPPER), np.zeros(N)
    goal = np.clip(wanted, LOWER, UPPER)
    for _ in range(600):
        before, rest = velocity.copy(), goal - at
        compiled().braking.to_position(wanted, at, *BOUNDS, velocity, DT)
        allowed = np.sign(rest) * np.minimum(brakeable(np.abs(rest)), np.abs(rest) / DT)
        np.testing.assert_array_equal(velocity, np.clip(allowed, before - CHANGE, before + CHANGE))
    np.testing.assert_allclose(at, goal, atol=1e-6)
    np.testing.assert_allclose(velocity, 0.0, atol=1e-4)


@given(seed=seeds)
def test_what_cannot_stop_in_time_is_told(seed: int) -> None:
    rng = np.random.default_rng(seed)
    q, moving = rng.uniform(LOWER, UPPER), rng.uniform(-1.3, 1.3, N)
    late = (moving > brakeable(UPPER - q) + CHANGE) | (moving < -brakeable(q - LOWER) - CHANGE)
    assert compiled().braking.runs_out(q, moving, *BOUNDS, DT) == late.any()
