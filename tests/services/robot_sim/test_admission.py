# SPDX-License-Identifier: Apache-2.0
"""The commands that the safety gate of a part admits."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from bus_schema import Refused
from services.robot_sim.gate import LOCKED_TTL, MAX_AGE, MAX_START, MAX_STEP, MAX_TTL, POSITION_MARGIN, Admission, Gate, Order
from tests.services.robot_sim.gated import LIMITS, PART, ROBOT, WHERE, Gated, N, refusal

VELOCITY = LIMITS.velocity[0]


@pytest.mark.parametrize(
    ("reason", "changes"),
    [
        ("epoch", {"epoch": 0}),
        ("epoch", {"epoch": 99}),
        ("length", {"ref": [0.0] * (N + 1)}),
        ("length", {"ref": []}),
        ("value", {"ref": math.nan}),
        ("value", {"ref": math.inf}),
        ("velocity", {"ref": 1.1 * VELOCITY}),
        ("position", {"mode": "position", "ref": 3.0}),
        ("torque", {"mode": "torque", "ref": 41.0}),
        ("step", {"mode": "position", "ref": 0.1}),
        ("future", {"re_k": 21}),
        ("age", {"re_k": 9}),
        ("ttl", {"ttl": 0}),
        ("ttl", {"ttl": -1}),
        ("ttl", {"ttl": 10**9}),
    ],
)
def test_a_wrong_command_is_refused_with_its_reason_and_moves_nothing(reason: str, changes: dict[str, object]) -> None:
    gated = Gated().owned()
    for _ in range(20):
        gated.tick()
    assert refusal(gated, **changes) == reason
    gated.tick()
    assert gated.drive.mode == "hold"
    assert not gated.velocity.any()


def test_the_bounds_of_admission_are_those_of_the_contract() -> None:
    assert (MAX_AGE, MAX_TTL, MAX_STEP, LOCKED_TTL) == (0.1, 1000, 2.0, 3)
    assert (POSITION_MARGIN, MAX_START) == (math.radians(1.0), math.radians(2.0))


@pytest.mark.parametrize(
    "changes",
    [
        {"ref": VELOCITY},
        {"ref": -VELOCITY},
        {"mode": "torque", "ref": LIMITS.torque[0]},
        {"mode": "torque", "ref": -LIMITS.torque[0]},
        {"ttl": 1},
        {"ttl": MAX_TTL},
        {"re_k": 20},
    ],
)
def test_a_command_at_a_bound_is_admitted(changes: dict[str, object]) -> None:
    gated = Gated().owned()
    for _ in range(20):
        gated.tick()
    gated.command(**changes)


@pytest.mark.parametrize(
    ("mode", "ref", "text"),
    [
        ("velocity", -VELOCITY - 0.25, "0.250 rad/s beyond the limit"),
        ("torque", LIMITS.torque[0] + 0.5, "0.500 N m beyond the limit"),
        ("position", LIMITS.upper.max() + 0.125, f"{LIMITS.upper.max() - LIMITS.upper.min() + 0.125:.3f} rad beyond a limit"),
        ("position", LIMITS.lower.min() - 0.125, f"{LIMITS.lower.max() - LIMITS.lower.min() + 0.125:.3f} rad beyond a limit"),
        ("velocity", [0.0, math.nan, 0.0], "NaN or infinity"),
        ("velocity", [0.0, VELOCITY + 0.5, 0.0], "0.500 rad/s beyond the limit"),
        ("torque", [0.0, -LIMITS.torque[1] - 0.5, 0.0], "0.500 N m beyond the limit"),
    ],
)
def test_a_refusal_says_by_how_much_a_reference_is_beyond_its_limit(mode: str, ref: object, text: str) -> None:
    gated = Gated().owned()
    with pytest.raises(Refused, match=f"^{PART}: {text}$"):
        gated.command(mode, ref)


def test_after_a_silence_a_position_may_not_be_farther_than_after_100_ms() -> None:
    admission, q = Admission(PART, LIMITS, 0.01, None), np.zeros(N)
    most = 10 * MAX_STEP * LIMITS.velocity * 0.01
    admission.check_step(0.999 * most, q, 1000, q)
    with pytest.raises(Refused, match=f"a jump of {1.001 * most.max():.3f} rad, allowed {most.max():.3f}"):
        admission.check_step(1.001 * most, q, 1000, q)
    one = np.zeros(N)
    one[1] = 1.001 * most[1]
    with pytest.raises(Refused, match="a jump of"):
        admission.check_step(one, q, 1000, q)


@pytest.mark.parametrize("ticks", [0, 1])
def test_two_positions_of_one_tick_may_be_as_far_apart_as_those_of_two(ticks: int) -> None:
    admission, q = Admission(PART, LIMITS, 0.01, None), np.zeros(N)
    stride = MAX_STEP * LIMITS.velocity * 0.01
    admission.check_step(0.999 * stride, q, ticks, q)
    with pytest.raises(Refused, match="a jump of"):
        admission.check_step(1.001 * stride, q, ticks, q)


def test_in_lockstep_a_silence_counts_as_the_most_ticks_that_a_command_may_be_old() -> None:
    admission, q = Admission(PART, LIMITS, 0.05, 3), np.zeros(N)
    most = 3 * MAX_STEP * LIMITS.velocity * 0.05
    admission.check_step(0.999 * most, q, 1000, q)
    with pytest.raises(Refused, match="a jump of"):
        admission.check_step(1.001 * most, q, 1000, q)


def test_at_a_low_rate_a_silence_counts_as_one_tick() -> None:
    admission, q = Admission(PART, LIMITS, 0.25, None), np.zeros(N)
    stride = MAX_STEP * LIMITS.velocity * 0.25
    admission.check_step(0.999 * stride, q, 1000, q)
    with pytest.raises(Refused, match="a jump of"):
        admission.check_step(1.001 * stride, q, 1000, q)


def test_after_a_velocity_a_position_is_compared_with_the_measured_one() -> None:
    gated = Gated().owned()
    gated.command("position", 0.02)
    for _ in range(5):
        gated.tick()
    for _ in range(30):
        gated.command(ref=0.5 * VELOCITY)
        gated.tick()
    assert refusal(gated, "position", 0.02) == "step"
    gated.command("position", gated.q + 0.9 * MAX_START)


def test_references_exactly_at_the_bounds_are_admitted() -> None:
    admission, q = Admission(PART, LIMITS, 0.01, None), np.zeros(N)
    admission.check_step(q + MAX_START * LIMITS.fine, None, 1, q)
    margin = POSITION_MARGIN * LIMITS.fine
    for reference in (LIMITS.upper + margin, LIMITS.lower - margin):
        admission.check(Order("controller", 1, 1, 1, "position", reference, 100), 1)
    for sign in (1.0, -1.0):  # with the rounding that is allowed
        admission.check(Order("controller", 1, 1, 1, "velocity", sign * LIMITS.velocity * (1.0 + 1e-9), 100), 1)
        admission.check(Order("controller", 1, 1, 1, "torque", sign * LIMITS.torque * (1.0 + 1e-9), 100), 1)


def test_a_command_100_ms_old_is_just_in_time() -> None:
    gated = Gated().owned()
    for _ in range(20):
        gated.tick()
    gated.command(ref=0.05, re_k=10, ttl=200)
    gated.tick()
    assert gated.gate.age == 11


@pytest.mark.parametrize("ticks", [1, 20])  # that the gate has seen
def test_a_command_from_before_a_freeze_of_this_process_is_refused_although_no_tick_has_passed(ticks: int) -> None:
    gated = Gated().owned()
    for _ in range(ticks):
        gated.tick()
    gated.now += 100_000_000
    gated.command(ref=0.05, ttl=200)  # it answers the newest tick, which began 100 ms ago
    gated.now += 1_000_000
    assert refusal(gated, ref=0.05, ttl=200) == "age"
    gated.now -= 1_000_000
    gated.tick()
    assert gated.gate.state == "armed"


@pytest.mark.parametrize("seq", [0, 3])
def test_a_replayed_or_overtaken_command_is_refused(seq: int) -> None:
    gated = Gated().owned()
    gated.command(ref=0.05, seq=3)
    assert refusal(gated, ref=0.05, seq=seq) == "seq"


def test_a_position_reference_may_continue_after_a_refused_one() -> None:
    gated = Gated().owned()
    gated.command("position", 0.02)
    for _ in range(5):
        gated.tick()
    gated.command("position", 0.02 + 5 * VELOCITY * gated.dt)
    assert refusal(gated, "position", 0.02 + 9 * VELOCITY * gated.dt) == "step"


def test_in_lockstep_an_age_is_counted_in_ticks_however_long_these_are() -> None:
    gate = Gate(PART, LIMITS, 0.05, ttl_ticks=3)
    epoch = gate.take("controller", "c1")
    gate.arm(epoch)

    def order(seq: int, re_k: int) -> Order:
        return Order("controller", epoch, seq, re_k, "velocity", np.zeros(N), 100)

    gate.admit(order(0, 7), 10, 0, ROBOT.home[WHERE])  # 150 ms ago
    with pytest.raises(Refused, match="4 ticks ago, limit 3") as caught:
        gate.admit(order(1, 6), 10, 0, ROBOT.home[WHERE])
    assert caught.value.reason == "age"


def test_after_a_hold_the_first_position_is_compared_with_the_measured_one() -> None:
    gated = Gated().owned()
    gated.command("position", gated.q + 0.9 * MAX_START)
    gated.gate.hold(gated.gate.epoch)
    gated.gate.arm(gated.gate.epoch)
    gated.command("position", gated.q - 0.9 * MAX_START)


FINE = np.full(N, 0.01)


def order(side: float, beyond: float) -> Order:
    """A position that is beyond the upper (side 1) or lower limit (side -1)."""
    reference = (LIMITS.upper if side > 0 else LIMITS.lower).copy()
    reference[0] += side * beyond
    return Order("controller", 1, 1, 1, "position", reference, 100)


@pytest.mark.parametrize("fine", [np.ones(N), FINE])
def test_a_position_may_be_beyond_its_limit_by_as_much_as_the_motor_is_exact(fine: np.ndarray) -> None:
    admission = Admission("torso", replace(LIMITS, fine=fine), 0.01, None)
    for side in (1.0, -1.0):
        admission.check(order(side, 0.9 * POSITION_MARGIN * fine[0]), 1)
        with pytest.raises(Refused, match="rad beyond a limit"):
            admission.check(order(side, 1.1 * POSITION_MARGIN * fine[0]), 1)


@pytest.mark.parametrize("fine", [np.ones(N), FINE])
def test_the_first_position_may_be_as_far_from_the_measured_one(fine: np.ndarray) -> None:
    admission, q = Admission("torso", replace(LIMITS, fine=fine), 0.01, None), np.zeros(N)
    admission.check_step(q + 0.9 * MAX_START * fine, None, 1, q)
    with pytest.raises(Refused, match="a jump of"):
        admission.check_step(q + 1.1 * MAX_START * fine, None, 1, q)
