# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from mobee.control.law import FRICTION, INERTIA
from mobee.errors import InvalidValue
from mobee.model.masses import gravity_torque
from mobee.robot.load import load_robot
from mobee.simulation.motors import SERVO_GAIN, MotorParameters, Motors
from tests.mobee.control.two_parts import two_part_arm

STEP = 0.005
ALL = slice(None)
IDEAL = MotorParameters.ideal()


def motors(parameters: MotorParameters = IDEAL, seed: int = 0, q: np.ndarray | None = None) -> Motors:
    return Motors(two_part_arm(), parameters, seed, np.zeros(3) if q is None else q)


def run(m: Motors, seconds: float) -> np.ndarray:
    path = []
    for _ in range(round(seconds / STEP)):
        m.move(1, STEP)
        path.append(m.q)
    return np.array(path)


def test_ideal_motors_follow_commands_at_once() -> None:
    m = motors()
    m.command(ALL, "velocity", np.array([0.5, -0.2, 0.0]))
    assert run(m, 0.1)[-1] == pytest.approx([0.05, -0.02, 0.0])
    assert m.velocities == pytest.approx([0.5, -0.2, 0.0])
    assert np.array_equal(m.encoders(1, 0.01), m.q)


def test_many_substeps_in_one_call_are_as_many_calls() -> None:
    at_once, one_by_one = motors(MotorParameters()), motors(MotorParameters())
    for velocity in ([0.5, -0.2, 0.1], [-0.3, 0.4, 0.0], [9.0, -9.0, 9.0]):
        for m in (at_once, one_by_one):
            m.command(ALL, "velocity", np.array(velocity))
        at_once.move(40, STEP)
        run(one_by_one, 40 * STEP)
        assert at_once.state.tobytes() == one_by_one.state.tobytes()


@pytest.mark.parametrize("lively", [1.0, 0.6])
def test_motors_in_one_robot_equal_separate_ones(lively: float) -> None:
    """Motors of any kind, mode and number, at their hard stops, and with NaN."""
    robot, rng = load_robot("icub"), np.random.default_rng(5)
    n = len(robot.motors)
    any_kind: dict[str, Any] = {
        name: rng.choice([0.0, *rng.uniform(0.0, most, 3)], n) for name, most in (("lag", 0.1), ("delay", 0.04), ("friction", 0.1))
    }
    kind, alive = MotorParameters(**any_kind, backlash=rng.uniform(0.0, 0.01, n).tolist()), rng.uniform(size=n) < lively
    at_once, one_by_one = (Motors(robot, kind, 0, robot.home, alive) for _ in range(2))
    for substeps in rng.integers(1, 30, 100):
        mode, (first, end) = rng.choice(["position", "velocity", "velocity", "torque", "hold"]), sorted(rng.integers(0, n, 2))
        reference = (
            None
            if mode == "hold"
            else rng.choice([-20.0, -0.3, 0.0, 0.1, 0.5, 20.0, np.nan], end - first, p=[0.1, 0.2, 0.2, 0.2, 0.2, 0.09, 0.01])
        )
        for m in (at_once, one_by_one):
            m.command(slice(first, end), mode, reference)
        at_once.move(int(substeps), STEP)
        for _ in range(substeps):
            one_by_one.drive(STEP)
            dragged = one_by_one.state["pulled_q"]
            dragged[:] = np.clip(dragged, one_by_one.constants["low"], one_by_one.constants["high"])
            one_by_one.adopt(dragged)
        for name in at_once.state.dtype.names or ():
            mine, its = (np.nan_to_num(m.state[name], nan=1e9) for m in (at_once, one_by_one))
            assert mine.tobytes() == its.tobytes(), name


def test_the_lag_is_a_first_order_response() -> None:
    m = motors(replace(IDEAL, lag=0.05))
    m.command(ALL, "velocity", np.full(3, 0.5))
    run(m, 0.05)
    assert m.velocities == pytest.approx(np.full(3, 0.5 * (1 - np.exp(-1))))


@pytest.mark.parametrize("step", [0.001, 0.005])
def test_nothing_happens_before_the_delay_is_over(step: float) -> None:
    m = motors(replace(IDEAL, delay=0.02))
    m.command(ALL, "velocity", np.full(3, 0.5))
    moved = []
    for _ in range(round(0.03 / step)):
        m.move(1, step)
        moved.append(m.q[0] > 0)
    assert moved.index(True) == round(0.02 / step)


def test_a_reversal_loses_the_play() -> None:
    m = motors(replace(IDEAL, backlash=0.01))
    m.command(ALL, "velocity", np.full(3, 0.1))
    forth = run(m, 1.0)[-1]
    assert forth == pytest.approx(np.full(3, 0.1 - 0.005))
    m.command(ALL, "velocity", np.full(3, -0.1))
    assert run(m, 0.09)[-1] == pytest.approx(forth)
    assert run(m, 0.91)[-1] == pytest.approx(np.full(3, 0.005))


def test_encoder_noise_is_white_seeded_and_independent_of_the_tick() -> None:
    noisy = replace(IDEAL, encoder_noise=0.002)
    for dt in (0.02, 0.005):
        m = motors(noisy)
        readings = np.array([m.encoders(k, dt) for k in range(20_000)])
        assert readings.std(axis=0) * np.sqrt(dt / 0.02) == pytest.approx(np.full(3, 0.002), rel=0.02)
        assert np.abs(np.mean(readings[1:] * readings[:-1], axis=0)).max() < 0.03 * readings.var()
    again = motors(noisy, seed=5)
    again.encoders(7, 0.01)
    assert np.array_equal(motors(noisy, seed=5).encoders(1, 0.01), again.encoders(1, 0.01))
    assert np.abs(motors(noisy).encoders(1, 1.0)).min() > 0.0
    assert not np.array_equal(motors(noisy, seed=5).encoders(1, 0.01), motors(noisy, seed=6).encoders(1, 0.01))


def test_parts_can_be_read_one_by_one() -> None:
    m = motors(q=np.array([0.1, 0.2, 0.3]))
    assert m.encoders(1, 0.01, slice(1, 3)).tolist() == [0.2, 0.3]


def test_hard_stops_stop_and_nothing_winds_up_behind_them() -> None:
    m = motors(replace(IDEAL, backlash=0.01), q=np.full(3, 2.9))
    m.command(ALL, "velocity", np.full(3, 1.0))
    assert run(m, 1.0).max() == 3.0
    assert not m.velocities.any()
    m.command(ALL, "velocity", np.full(3, -1.0))
    assert run(m, 0.1)[-1] == pytest.approx(np.full(3, 2.91))


def test_a_joint_blocked_by_physics_does_not_wind_up_either() -> None:
    m = motors(replace(IDEAL, backlash=0.01))
    m.command(ALL, "velocity", np.full(3, 0.5))
    for _ in range(200):
        asked = m.drive(STEP)
        m.adopt(np.zeros(3))
    assert asked == pytest.approx(np.full(3, 0.5))
    m.command(ALL, "velocity", np.full(3, -0.5))
    assert run(m, 0.1)[-1] == pytest.approx(np.full(3, -0.04))


def test_position_mode_goes_to_the_reference_no_faster_than_the_motor_can() -> None:
    m = motors(MotorParameters(encoder_noise=0.0, backlash=0.0))
    m.command(ALL, "position", np.array([1.5, -0.3, 0.0]))
    path = run(m, 3.0)
    assert path[-1] == pytest.approx([1.5, -0.3, 0.0], abs=1e-3)
    assert np.abs(np.diff(path, axis=0)).max() / STEP <= two_part_arm().motor_table[0].max_velocity + 1e-9


def test_the_servo_moves_by_its_gain() -> None:
    m = motors()
    m.command(ALL, "position", np.full(3, 0.01))
    m.move(1, STEP)
    assert m.velocities == pytest.approx(np.full(3, SERVO_GAIN * 0.01))


def test_motors_that_are_started_again_are_as_new_ones() -> None:
    kind, place = MotorParameters(friction=0.01), np.array([0.1, -0.2, 0.3])
    old, new = motors(kind, seed=1), motors(kind, seed=7, q=place)
    for mode in ("torque", "velocity"):
        old.command(ALL, mode, np.full(3, 0.7))
        old.move(3, STEP)
    old.encoders(2, 0.01)
    old.restart(7, place)
    for k, mode in enumerate(("hold", "velocity", "position", "torque", "velocity")):
        for m in (old, new):
            m.command(ALL, mode, None if mode == "hold" else np.full(3, 0.4))
            m.move(3, STEP)
        assert old.state.tobytes() == new.state.tobytes(), mode
        assert old.encoders(k, 0.01).tobytes() == new.encoders(k, 0.01).tobytes()


def test_seeds_are_taken_modulo_2_to_the_64th() -> None:
    large, small = motors(seed=2**64 + 5), motors(seed=5)
    assert large.seed == 5
    large.restart(2**64 + 7, large.q)
    small.restart(7, small.q)
    assert (large.seed, small.seed) == (7, 7)


def test_torque_mode_is_inertia_and_viscous_friction() -> None:
    m = motors()
    m.command(ALL, "torque", np.array([2.0, 0.0, -1.0]))
    run(m, STEP)
    assert m.velocities == pytest.approx(np.array([2.0, 0.0, -1.0]) * STEP / INERTIA)
    run(m, 2.0)
    assert m.velocities == pytest.approx(np.array([2.0, 0.0, -1.0]) / FRICTION)
    assert m.efforts == pytest.approx([2.0, 0.0, -1.0])


def test_hold_brakes_at_the_acceleration_limit_and_keeps_the_place() -> None:
    m = motors(MotorParameters(encoder_noise=0.0))
    m.command(ALL, "velocity", np.full(3, 1.0))
    start = run(m, 1.0)[-1]
    m.command(ALL, "hold")
    path = run(m, 2.0)
    limit = two_part_arm().motor_table[0].max_acceleration
    assert path[-1] - start == pytest.approx(np.full(3, 1.0 / (2 * limit)), abs=1.0 * STEP)
    assert path[60:] == pytest.approx(np.tile(path[-1], (len(path) - 60, 1)), abs=1e-9)


def test_a_held_motor_that_is_pushed_away_returns() -> None:
    m = motors()
    m.drive(STEP)
    m.adopt(np.full(3, 0.1))
    assert run(m, 2.0)[-1] == pytest.approx(np.zeros(3), abs=1e-6)


def test_parts_can_be_in_different_modes() -> None:
    m = motors()
    m.command(slice(0, 1), "position", np.array([0.2]))
    m.command(slice(1, 3), "velocity", np.array([0.1, -0.1]))
    assert run(m, 2.0)[-1] == pytest.approx([0.2, 0.2, -0.2], abs=1e-6)
    m.command(slice(1, 2), "hold")
    assert run(m, 1.0)[-1] == pytest.approx([0.2, 0.2, -0.3], abs=1e-3)


def test_delayed_commands_are_not_read_in_the_unit_of_a_new_mode() -> None:
    m = motors(replace(IDEAL, delay=0.02))
    m.command(ALL, "torque", np.full(3, 1.0))
    run(m, 0.1)
    speed = m.velocities[0]
    m.command(ALL, "velocity", np.zeros(3))
    run(m, 0.02)
    assert m.velocities == pytest.approx(np.full(3, speed))
    run(m, 0.005)
    assert m.velocities == pytest.approx(np.zeros(3), abs=1e-12)


def test_friction_subtracts_its_velocity_and_stops_slower_motors() -> None:
    m = motors(replace(IDEAL, lag=0.05, friction=(0.0, 0.2, 0.2)))
    m.command(ALL, "velocity", np.array([0.5, 0.5, -0.15]))
    run(m, 1.0)
    assert m.velocities == pytest.approx([0.5, 0.3, 0.0], abs=1e-6)


def test_a_load_pulls_a_motor_in_torque_mode_and_the_same_torque_carries_it() -> None:
    m = motors()
    m.command(ALL, "torque", np.array([0.0, 0.0, 2.0]))
    m.load = np.array([0.0, 2.0, 2.0])
    run(m, 0.5)
    assert m.in_torque.all() and m.torques.tolist() == [0.0, 0.0, 2.0]
    assert m.q[1] < -0.05
    assert m.q[[0, 2]].tolist() == [0.0, 0.0]


def test_torques_move_a_joint_through_its_play_and_a_block_stops_the_motor_behind_it() -> None:
    m = motors(replace(IDEAL, backlash=0.02))
    m.command(ALL, "torque", np.full(3, 1.0))
    run(m, 0.1)
    assert m.q[0] > 0.001
    m.drive(STEP)
    m.adopt(m.q)
    assert m.motor_velocities.tolist() == [0.0] * 3


def test_another_substep_keeps_the_commands_in_the_delay_line_in_their_order() -> None:
    m = motors(replace(IDEAL, delay=0.02))
    each = np.array([1.0, 2.0, -1.0])
    for speed in (0.1, 0.2, 0.3):
        m.command(ALL, "velocity", speed * each)
        m.move(5 if speed == 0.1 else 1, 0.005)
    path = []
    for _ in range(22):
        m.move(1, 0.001)
        path.append(m.velocities)
    speeds = [0.1] * 18 + [0.2] + [0.3] * 3  # those before the oldest delayed command continue
    np.testing.assert_allclose(path, np.outer(speeds, each), atol=1e-12)


def test_a_longer_substep_keeps_the_newest_commands() -> None:
    m = motors(replace(IDEAL, delay=0.02))
    for speed in (0.1, 0.2, 0.3):
        m.command(ALL, "velocity", np.full(3, speed))
        m.move(30 if speed == 0.1 else 1, 0.001)
    m.move(1, 0.01)
    assert m.velocities == pytest.approx(np.full(3, 0.2))


def test_driving_begins_with_the_substep_that_it_is_given() -> None:
    driven, moved = (motors(MotorParameters(encoder_noise=0.0), q=np.full(3, 0.3)) for _ in range(2))
    assert driven.drive(0.002).tolist() == [0.0] * 3
    for m in (driven, moved):
        m.command(ALL, "velocity", np.full(3, 0.5))
    for _ in range(50):
        driven.adopt(driven.q + 0.001 * driven.drive(0.001))
        moved.move(1, 0.001)
    np.testing.assert_allclose(driven.q, moved.q, atol=1e-12)
    assert driven.q.min() > 0.301


def test_motors_enter_a_mode_also_if_others_are_in_it() -> None:
    m = motors()
    m.command(slice(0, 1), "velocity", np.array([0.5]))
    m.command(ALL, "velocity", np.full(3, 0.5))
    m.move(1, STEP)
    assert m.velocities == pytest.approx(np.full(3, 0.5))


def test_a_motor_that_enters_torque_mode_carries_its_weight_and_an_effort_can_be_set() -> None:
    robot = load_robot("icub")
    m = Motors(robot, IDEAL, 0, robot.home)
    m.command(ALL, "velocity", np.zeros(len(robot.motors)))
    assert not m.load.any()
    m.command(ALL, "torque")
    assert m.load == pytest.approx(gravity_torque(robot, robot.home)) and m.load.any()
    m.efforts = np.arange(float(len(robot.motors)))
    assert m.efforts.tolist() == [*range(len(robot.motors))]


def test_parameters_of_another_number_of_motors_are_refused() -> None:
    with pytest.raises(InvalidValue, match="friction of 2 motors: the robot has 3"):
        motors(replace(IDEAL, friction=(0.1, 0.1)))


@pytest.mark.parametrize("seed", [0.5, True, -1])
def test_a_seed_that_is_no_whole_number_from_0_is_refused(seed) -> None:
    with pytest.raises(InvalidValue, match="seed"):
        motors(seed=seed)


def test_motors_that_do_not_live_never_move() -> None:
    m = Motors(two_part_arm(), MotorParameters(), 0, np.zeros(3), np.array([True, False, True]))
    m.command(ALL, "velocity", np.full(3, 0.5))
    run(m, 0.5)
    assert m.q[1] == 0.0 and m.q[0] == m.q[2] > 0.1
    assert m.encoders(3, 0.02)[1] == 0.0


def test_substeps_cover_the_tick() -> None:
    assert [MotorParameters().substeps(dt) for dt in (0.001, 0.005, 0.01, 0.012, 0.02)] == [1, 1, 2, 3, 4]


@pytest.mark.parametrize(
    "change",
    [
        {"lag": -0.1},
        {"lag": np.inf},
        {"friction": (0.1, -0.1)},
        {"encoder_noise": np.nan},
        {"substep": 0.0},
        {"lag": "a"},
        {"substep": "a"},
    ],
)
def test_nonsense_parameters_are_refused_by_name(change: dict[str, Any]) -> None:
    with pytest.raises(InvalidValue, match=next(iter(change))):
        MotorParameters(**change)


def test_a_posture_of_the_wrong_length_is_refused() -> None:
    with pytest.raises(InvalidValue, match="planar"):
        motors(q=np.zeros(2))
