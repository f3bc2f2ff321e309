from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mobee.control.gains import Gains
from mobee.control.stability import largest_step, require_stable
from mobee.errors import InvalidValue
from mobee.robot.load import load_robot
from tests.mobee.control.two_parts import two_part_arm

ARM = two_part_arm()


def integrate(damping: float, stiffness: float, dt: float, steps: int = 3000) -> float:
    q, v = 1.0, 0.0
    for _ in range(steps):
        v += dt * (-stiffness * q - damping * v)
        q += dt * v
    return abs(q) + abs(v) * dt


@given(st.floats(5.0, 60.0), st.floats(10.0, 500.0))
def test_the_bound_divides_stable_from_unstable_steps(damping: float, stiffness: float) -> None:
    gains = replace(Gains.default(), damping=damping, stiffness=stiffness)
    stiffest = stiffness + gains.max_limit / gains.limit_width
    step = largest_step(ARM, gains)
    with np.errstate(over="ignore"):
        assert integrate(damping, stiffest, 0.97 * step) < 1.0
        assert integrate(damping, stiffest, 1.03 * step, 1000) > 10.0


def test_both_sets_are_stable_at_100_hz_even_when_a_tick_is_missed() -> None:
    for gains in (Gains.default(), Gains.published_2014()):
        require_stable(load_robot("icub"), gains, 0.02)


def test_the_published_damping_at_40_ms_is_refused_with_the_bound_it_breaks() -> None:
    with pytest.raises(InvalidValue, match=r"damping \* dt = 2, must be below 2"):
        require_stable(ARM, Gains.published_2014(), 0.04)


def test_too_stiff_is_refused_with_the_other_bound() -> None:
    with pytest.raises(InvalidValue, match=r"stiffness \* dt\^2"):
        require_stable(ARM, replace(Gains.default(), stiffness=1e5), 0.01)


@pytest.mark.parametrize("dt", [0.0, -0.01, np.nan, np.inf])
def test_a_step_that_is_no_time_is_refused(dt: float) -> None:
    with pytest.raises(InvalidValue, match="time step"):
        require_stable(ARM, Gains.default(), dt)
