# SPDX-License-Identifier: Apache-2.0
"""The motors of the definition: what each of their parts does, and that the simulated ones are the same."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mobee.arrays import Array
from mobee.reference import plant as reference
from mobee.simulation import MotorParameters, Motors
from tests.mobee.control.two_parts import two_part_arm
from tests.mobee.reference.drawn import Rng, drawn_pose, drawn_robot

SEEDS = st.integers(0, 2**32 - 1)
ROBOT = two_part_arm()
STEP = 0.005


def drawn_parameters(rng: Rng, n: int) -> MotorParameters:
    """The published ones, ideal ones, or some for each motor."""
    kind = rng.integers(3)
    if kind == 0:
        return MotorParameters()
    if kind == 1:
        return MotorParameters.ideal()
    each = {"lag": 0.1, "delay": 0.04, "backlash": 0.02, "friction": 0.3}
    return MotorParameters(**{name: tuple(most * rng.random(n) * (rng.random(n) < 0.7)) for name, most in each.items()})


@given(SEEDS)
def test_the_simulated_motors_follow_the_definition_under_any_commands(seed: int) -> None:
    """To the last bit: of every motor the same operations in the same order, without sums."""
    rng = np.random.default_rng(seed)
    robot = drawn_robot(rng)
    n, q = len(robot.motors), drawn_pose(rng, robot, 0.0)
    step = float(rng.choice([0.001, 0.005]))
    parameters = replace(drawn_parameters(rng, n), substep=step)
    motors, mine = Motors(robot, parameters, 0, q), reference.at_rest(robot, parameters, q, step)
    for _ in range(12):
        where = slice(*sorted(rng.integers(0, n + 1, 2)))
        mode = str(rng.choice(["position", "velocity", "torque", "hold"]))
        given_ = None if mode == "hold" else rng.normal(size=where.stop - where.start) * rng.choice([0.1, 3.0, 30.0])
        if mode == "torque":  # who enters it carries the weight of a robot without masses
            mine.load = np.where(np.any(mine.mode[where] != mode), np.zeros(n), mine.load)
        motors.command(where, mode, given_)
        reference.command(mine, where, mode, given_)
        motors.load = mine.load = rng.normal(size=n)
        for _ in range(rng.integers(1, 20)):
            if rng.random() < 0.1:  # something blocks the joints
                motors.drive(step)
                motors.adopt(motors.q)
                reference.drive(robot, parameters, mine, step)
                reference.adopt(robot, parameters, mine, mine.q, step)
            else:
                motors.move(1, step)
                reference.substep(robot, parameters, mine, step)
        assert np.array_equal(motors.q, mine.q)
        assert np.array_equal(motors.velocities, mine.velocity)
        assert np.array_equal(motors.motor_velocities, mine.motor_velocity)


@given(SEEDS)
def test_the_encoders_read_this(seed: int) -> None:
    """To rounding: logarithm, sine and cosine are the C library's."""
    rng = np.random.default_rng(seed)
    robot, parameters = drawn_robot(rng), MotorParameters(encoder_noise=0.01)
    q, drawn = drawn_pose(rng, robot), int(rng.integers(2**63))
    motors, mine = Motors(robot, parameters, drawn, q), reference.at_rest(robot, parameters, q, STEP)
    for k in (0, 1, int(rng.integers(10**9))):
        expected = reference.encoders(robot, parameters, mine, drawn, k, 0.01)
        assert motors.encoders(k, 0.01) == pytest.approx(expected, rel=1e-14, abs=1e-15)


def run(parameters: MotorParameters, mode: str, reference_: float, seconds: float, q: Array | None = None) -> reference.MotorState:
    """Return the state of the motors after the same command for some time."""
    s = reference.at_rest(ROBOT, parameters, np.zeros(3) if q is None else q, STEP)
    reference.command(s, slice(None), mode, np.full(3, reference_))
    for _ in range(round(seconds / STEP)):
        reference.substep(ROBOT, parameters, s, STEP)
    return s


def test_ideal_motors_follow_commands_at_once() -> None:
    assert run(MotorParameters.ideal(), "velocity", 0.5, 0.1).q == pytest.approx(np.full(3, 0.05))


def test_the_lag_is_a_first_order_response_after_the_delay() -> None:
    slow = MotorParameters(lag=0.05, delay=0.02, backlash=0.0, encoder_noise=0.0)
    assert not run(slow, "velocity", 0.5, 0.02).velocity.any()
    assert run(slow, "velocity", 0.5, 0.07).velocity == pytest.approx(np.full(3, 0.5 * (1.0 - np.exp(-1.0))))


def test_the_joint_rests_until_the_play_is_taken_up() -> None:
    assert run(MotorParameters(lag=0.0, delay=0.0, backlash=0.01), "velocity", 0.1, 0.04).q.tolist() == [0.0] * 3
    assert run(MotorParameters(lag=0.0, delay=0.0, backlash=0.01), "velocity", 0.1, 1.0).q == pytest.approx(np.full(3, 0.1 - 0.005))


def test_friction_holds_slow_commands_and_slows_fast_ones() -> None:
    sticky = MotorParameters(lag=0.05, delay=0.0, backlash=0.0, friction=0.2)
    assert not run(sticky, "velocity", 0.15, 1.0).q.any()
    assert run(sticky, "velocity", 0.5, 1.0).velocity == pytest.approx(np.full(3, 0.3))


def test_hard_stops_stop_and_nothing_winds_up_behind_them() -> None:
    s = run(MotorParameters(lag=0.0, delay=0.0, backlash=0.01), "velocity", 1.0, 1.0, np.full(3, 2.9))
    assert s.q.tolist() == [3.0] * 3
    assert s.motor_q == pytest.approx(np.full(3, 3.005))


def test_a_hold_brakes_and_stays() -> None:
    s = run(MotorParameters.ideal(), "velocity", 1.0, 0.5)
    reference.command(s, slice(None), "hold")
    path = []
    for _ in range(200):
        reference.substep(ROBOT, MotorParameters.ideal(), s, STEP)
        path.append(s.q)
    most = ROBOT.motor_table[0].max_acceleration
    assert path[-1] == pytest.approx(np.full(3, 0.5 + 1.0 / (2.0 * most)), abs=1.01 * STEP)
    assert path[-1] == pytest.approx(path[60], abs=1e-9)


def test_the_noise_is_a_pure_function_of_seed_tick_and_motor_and_normal() -> None:
    drawn = np.array([[reference.normal(1, k, motor) for motor in range(7)] for k in range(2000)])
    assert reference.normal(1, 17, 3) == drawn[17, 3]
    assert abs(drawn.mean()) < 4.0 / np.sqrt(drawn.size)
    assert abs(drawn.var() - 1.0) < 4.0 * np.sqrt(2.0 / drawn.size)
