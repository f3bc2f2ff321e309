# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.mobee.control.one_law import OneLaw


def limit_force(q: float, low: float, high: float, below: float, above: float, slope: float) -> float:
    law = OneLaw(low=low, high=high, low_zone=below, high_zone=above, limit_slope=slope)
    return float(law.force("limits", np.array([q]), np.zeros(1))[0])


def at(q: float, width: float = 1.0, maximum: float = 1.0) -> float:
    return limit_force(q, -3.0, 3.0, width, width, maximum / width)


@given(st.floats(-2.0, 2.0))
def test_no_force_inside(q: float) -> None:
    assert at(q) == 0.0


@given(st.floats(0.01, 1.0), st.floats(0.1, 100.0))
def test_the_force_at_the_limit_is_the_maximum_and_points_inward(width: float, maximum: float) -> None:
    assert at(-3.0, width, maximum) == pytest.approx(maximum)
    assert at(3.0, width, maximum) == pytest.approx(-maximum)


@given(st.floats(-5.0, 5.0), st.floats(0.1, 1.5))
def test_continuous_with_the_slope_of_the_ramp(q: float, width: float) -> None:
    step = 1e-6
    assert abs(at(q + step, width) - at(q, width)) <= 1.001 * step / width


@given(st.floats(0.0, 2.0))
def test_the_ramp_continues_beyond_the_limit(beyond: float) -> None:
    assert at(3.0 + beyond) == pytest.approx(-1.0 - beyond)
    assert at(-3.0 - beyond) == pytest.approx(1.0 + beyond)


def test_each_side_has_a_zone_of_its_own() -> None:
    force = [limit_force(q, 0.0, 1.0, 0.0, 0.5, 2.0) for q in (-0.1, 0.0, 0.25, 0.5, 1.0)]
    assert force == pytest.approx([0.2, 0.0, 0.0, 0.0, -1.0])
