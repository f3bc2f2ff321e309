# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mobee.control.gains import Gains
from mobee.control.law import Law, largest_step, require_stable
from mobee.errors import InvalidValue
from mobee.robot.load import load_robot
from mobee.robot.robot import Clause, Robot
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


@pytest.mark.parametrize("dt", [0.0, -0.01, np.nan, np.inf, "0.01"])
def test_a_step_that_is_no_time_is_refused(dt: float) -> None:
    with pytest.raises(InvalidValue, match="time step"):
        require_stable(ARM, Gains.default(), dt)


def bound(damping: float, stiffness: float) -> float:
    return float((np.sqrt(damping**2 + 4.0 * stiffness) - damping) / stiffness)


def tight(*rows: tuple[float, float, float]) -> Robot:
    """The arm around a pose in which a limit of every motor pushes, and clauses push both ways."""
    clauses = tuple(Clause("arm", sign * np.array([row]), np.zeros(1)) for row in rows for sign in (1.0, -1.0))
    motors = tuple(replace(m, limits=np.array([-0.05, 2.0]), max_velocity=1e9, max_acceleration=1e9) for m in ARM.motor_table)
    return replace(ARM, motor_table=motors, clauses=clauses)


@pytest.mark.parametrize(
    "gains",
    [Gains.default(), Gains.published_2014(), Gains.default().with_motors("m1", damping=70.0, stiffness=900.0, limit_width=0.2)],
    ids=["default", "published_2014", "per motor"],
)
def test_the_bound_divides_stable_from_unstable_steps_of_the_law_itself(gains: Gains) -> None:
    robot = tight((1.71, -1.71, 0.0), (0.0, -1.0, 2.0))
    law, rng = Law(robot, gains), np.random.default_rng(5)
    steady = sum(law.forces(np.zeros(3), np.zeros(3)))

    def left(dt: float) -> float:
        q = 1e-7 * rng.normal(size=3)
        state = law.at_rest(q)
        for _ in range(1000):
            force = sum(law.forces(q, np.zeros(3))) - steady
            q = q + dt * law.step(q, dt, np.zeros(3), force, state)[1]
            if np.abs(q).max() > 1e-4:  # beyond is another slope
                break
        return float(np.abs(q).max())

    assert left(0.98 * largest_step(robot, gains)) < 1e-7
    assert left(1.02 * largest_step(robot, gains)) > 1e-4


def test_clauses_count_along_their_normals_as_often_as_there_are() -> None:
    gains = Gains.default()
    one, slope = gains.stiffness + gains.max_limit / gains.limit_width, gains.max_constraint / gains.constraint_width
    row = Clause("arm", np.array([[0.0, 3.0, 4.0]]), np.zeros(1))
    assert largest_step(replace(ARM, clauses=(row,)), gains) == pytest.approx(bound(40.0, one + slope))
    assert largest_step(replace(ARM, clauses=(row,) * 3), gains) == pytest.approx(bound(40.0, one + 3 * slope))


def test_the_published_rows_count_with_their_length() -> None:
    gains = Gains.published_2014()
    one, slope = gains.stiffness + gains.max_limit / gains.limit_width, gains.max_constraint / gains.constraint_width
    row = Clause("arm", np.array([[0.0, 3.0, 4.0]]), np.zeros(1))
    assert largest_step(replace(ARM, clauses=(row,)), gains) == pytest.approx(bound(50.0, one + 5 * slope))


def test_the_motor_whose_gains_are_unstable_is_named() -> None:
    damped = Gains.default().with_motors("m1", damping=150.0)
    with pytest.raises(InvalidValue, match=r"at m1, damping \* dt = 3, must be below 2\. Use steps below 0\.0\d+ s"):
        require_stable(ARM, damped, 0.02)
    with pytest.raises(InvalidValue, match=r"at m2, stiffness \* dt\^2"):
        require_stable(ARM, Gains.default().with_motors("m2", stiffness=9e3), 0.02)


def test_motors_that_are_never_moved_do_not_count() -> None:
    gains = Gains.default().with_motors("m1", damping=150.0)
    assert largest_step(ARM, gains.with_motors("m1", weight=0.0)) == largest_step(ARM, Gains.default())
    assert largest_step(ARM, replace(gains, weights=(("*", 0.0),))) == np.inf
