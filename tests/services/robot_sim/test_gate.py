# SPDX-License-Identifier: Apache-2.0
"""The safety gate without a bus: its states, its owners, and what the motors get."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bus_schema import Refused
from mobee.simulation.motors import MotorParameters
from services.robot_sim.gate import LOCKED_TTL, MAX_START, Gate, Order
from tests.services.robot_sim.gated import LIMITS, PART, Gated, N, refusal

VELOCITY, ACCELERATION = LIMITS.velocity[0], LIMITS.acceleration[0]
ROUNDING = 1 + 1e-9


def test_the_limits_of_the_icub_are_those_of_the_design() -> None:
    assert pytest.approx(math.radians(60)) == VELOCITY
    assert pytest.approx(math.radians(600)) == ACCELERATION


def test_a_command_moves_an_armed_part_from_the_next_tick_on() -> None:
    gated = Gated().owned()
    gated.command(ref=0.05)
    gated.tick()
    assert gated.velocity == pytest.approx(0.05)
    assert (gated.gate.mode, gated.gate.seq, gated.gate.age) == ("velocity", 0, 1)


def test_after_a_hold_a_velocity_begins_from_rest() -> None:
    gated = Gated().owned()
    for _ in range(30):
        gated.command(ref=0.5 * VELOCITY)
        gated.tick()
    gated.gate.hold(gated.gate.epoch)
    for _ in range(30):
        gated.tick()
    gated.gate.arm(gated.gate.epoch)
    gated.command(ref=0.0)
    gated.tick()
    assert gated.drive.reference == pytest.approx(0.0, abs=1e-9)
    gated.command(ref=VELOCITY)
    assert gated.tick() == pytest.approx(ACCELERATION * gated.dt)


def test_the_gate_says_what_the_motors_do() -> None:
    gated = Gated()
    gate = gated.gate
    assert (gate.mode, gate.seq, gate.age, gate.faults, gate.owner) == ("hold", -1, -1, 0, None)
    gated.owned().command(ref=0.05, seq=7)
    gated.tick()
    assert (gate.mode, gate.seq, gate.age) == ("velocity", 7, 1)
    gate.hold(gate.epoch)
    gated.tick()
    assert (gate.state, gate.mode, gate.seq, gate.age) == ("hold", "hold", -1, -1)
    assert gated.events == [("hold", f"{PART}: requested by its owner")]


def test_each_owner_has_the_next_epoch_and_a_released_part_none() -> None:
    gated = Gated().owned()
    epoch = gated.gate.epoch
    assert gated.gate.take("other", "o1") == epoch + 1
    gated.gate.release(epoch + 1)
    assert gated.gate.owner is None
    with pytest.raises(Refused, match="no client does"):
        gated.gate.arm(epoch + 1)


@pytest.mark.parametrize(("late", "state"), [(0, "armed"), (1, "hold")])
def test_a_command_is_in_force_until_its_ttl_and_not_a_nanosecond_longer(late: int, state: str) -> None:
    gated = Gated().owned()
    gated.command(ref=0.05, ttl=100)
    gated.gate.tick(1, 100_000_000 + late, gated.q, gated.velocity)
    assert gated.gate.state == state


@pytest.mark.parametrize(("speed", "real"), [(0.25, 4.0), (1.0, 1.0), (4.0, 1.0)])
def test_in_slow_motion_times_are_longer_and_in_fast_motion_they_stay(speed: float, real: float) -> None:
    still, ms = np.zeros(N), 1_000_000

    def armed() -> Gate:
        gate = Gate(PART, LIMITS, 0.01, speed=speed)
        gate.arm(gate.take("controller", "c1"))
        gate.tick(1, 0, still, still)
        return gate

    def order(ttl: int) -> Order:
        return Order("controller", 1, 0, 1, "velocity", still, ttl)

    for late, state in ((0, "armed"), (1, "hold")):
        gate = armed()
        gate.admit(order(50), 1, 0, still)
        gate.tick(2, round(50 * real) * ms + late, still, still)
        assert gate.state == state
    armed().admit(order(500), 1, round(100 * real) * ms, still)
    with pytest.raises(Refused, match="answers a tick that began"):
        armed().admit(order(500), 1, round(101 * real) * ms, still)


def test_the_first_epoch_is_1_unless_an_earlier_one_is_given() -> None:
    assert Gate(PART, LIMITS, 0.01).take("controller", "c1") == 1
    assert Gate(PART, LIMITS, 0.01, epoch=5).take("controller", "c1") == 6


def test_a_moving_part_continues_smoothly_in_position_mode() -> None:
    gated = Gated().owned()
    for _ in range(30):
        gated.command(ref=0.5 * VELOCITY)
        gated.tick()
    speed = gated.velocity.copy()
    gated.command("position", gated.q + 0.9 * MAX_START)
    change = gated.tick()
    assert speed == pytest.approx(0.5 * VELOCITY)
    assert (np.abs(change) <= 1.001 * LIMITS.acceleration * gated.dt).all()
    assert (gated.velocity > 0.8 * speed).all()


def test_a_refused_command_leaves_the_last_valid_one_in_force() -> None:
    gated = Gated().owned()
    gated.command(ref=0.05)
    gated.tick()
    refusal(gated, ref=math.nan)
    gated.tick()
    assert gated.gate.seq == 0
    assert gated.velocity == pytest.approx(0.05)


def test_a_command_lasts_for_its_ttl_from_the_tick_that_it_answers() -> None:
    gated = Gated().owned()
    for _ in range(20):
        gated.tick()
    gated.command(ref=0.05, re_k=15, ttl=100)
    for _ in range(5):
        gated.tick()
        assert gated.gate.state == "armed"
    gated.tick()
    assert gated.gate.state == "hold"


def test_a_new_owner_may_count_from_zero_again() -> None:
    gated = Gated().owned()
    gated.command(seq=500)
    gated.owned().command(ref=0.05, seq=0)
    gated.tick()
    assert gated.gate.seq == 0


def test_the_old_of_two_owners_can_neither_command_nor_arm_nor_release() -> None:
    gated = Gated().owned()
    old = gated.gate.epoch
    gated.gate.take("intruder", "x1")
    for verb in (gated.gate.arm, gated.gate.hold, gated.gate.release):
        with pytest.raises(Refused, match="epoch"):
            verb(old)
    gated.gate.arm(gated.gate.epoch)
    assert refusal(gated, ref=0.05, epoch=old) == "epoch"


def test_taking_a_moving_part_makes_it_hold() -> None:
    gated = Gated().owned()
    gated.command(ref=0.05)
    gated.tick()
    gated.gate.take("other", "o1")
    gated.tick()
    assert gated.gate.state == "hold"
    assert not gated.velocity.any()


def test_an_unarmed_part_does_not_move() -> None:
    gated = Gated()
    gated.gate.take("controller", "c1")
    assert refusal(gated, ref=0.05) == "not_armed"


@given(speed=st.floats(-VELOCITY, VELOCITY), ttl=st.integers(10, 1000), ideal=st.booleans())
def test_after_the_ttl_a_part_is_at_rest_as_soon_as_its_deceleration_allows(speed: float, ttl: int, ideal: bool) -> None:
    gated = Gated(MotorParameters.ideal() if ideal else None).owned()
    for _ in range(30):
        gated.command(ref=speed, ttl=ttl)
        gated.tick()
    while gated.gate.state == "armed":
        assert gated.now <= (30 + 1) * 10_000_000 + ttl * 1_000_000
        gated.tick()
    for _ in range(math.ceil(abs(speed) / ACCELERATION / gated.dt)):
        gated.tick()
    assert np.abs(gated.velocity).max() < 0.02  # the rest is the servo, which corrects the pose


def test_nothing_is_replayed_after_a_hold() -> None:
    gated = Gated().owned()
    gated.command(ref=0.05)
    gated.tick()
    gated.tick(wall=0.5)
    assert gated.gate.state == "hold"
    gated.gate.arm(gated.gate.epoch)
    gated.tick()
    assert gated.drive.mode == "hold"
    assert gated.events[0][0] == "hold"
    assert "ttl 100 ms" in gated.events[0][1]


def test_the_loss_of_the_owner_holds_and_its_epoch_is_worth_nothing() -> None:
    gated = Gated().owned()
    gated.command(ref=0.05)
    gated.tick()
    gated.gate.lose_owner()
    gated.tick()
    assert gated.drive.mode == "hold"
    assert gated.events == [("hold", f"{PART}: its owner controller is gone")]
    with pytest.raises(Refused, match="no client does"):
        gated.gate.arm(gated.gate.epoch)


def test_a_released_part_is_idle() -> None:
    gated = Gated().owned()
    gated.gate.release(gated.gate.epoch)
    assert gated.gate.state == "idle"
    assert refusal(gated, ref=0.05) == "not_armed"


def test_an_emergency_stop_is_left_only_by_reset_and_arm() -> None:
    gated = Gated().owned()
    gated.gate.stop("test")
    epoch = gated.gate.take("other", "o1")
    assert gated.gate.state == "estop"
    with pytest.raises(Refused, match="reset the emergency stop"):
        gated.gate.arm(epoch)
    gated.gate.release(epoch)
    assert gated.gate.state == "estop"
    epoch = gated.gate.take("other", "o1")
    gated.gate.reset_stop()
    assert gated.gate.state == "hold"
    assert refusal(gated, ref=0.05) == "not_armed"
    gated.gate.arm(epoch)
    gated.command(ref=0.05)


def test_a_fault_survives_take_and_the_reset_of_an_emergency_stop() -> None:
    gated = Gated().owned()
    gated.gate.fail(1, "broken")
    with pytest.raises(Refused, match="reset the simulator"):
        gated.gate.arm(gated.gate.take("other", "o1"))
    gated.gate.stop("test")
    gated.gate.reset_stop()
    assert gated.gate.state == "fault"


@pytest.mark.parametrize("parameters", [MotorParameters.ideal(), MotorParameters()], ids=["ideal", "default"])
def test_position_mode_arrives_where_it_is_sent(parameters: MotorParameters) -> None:
    gated = Gated(parameters).owned()
    goal = 0.0
    for _ in range(200):
        goal = min(goal + 0.5 * VELOCITY * gated.dt, 0.3)
        gated.command("position", goal)
        gated.tick()
    assert gated.q == pytest.approx(0.3, abs=parameters.backlash + 1e-5)


def test_a_velocity_command_does_not_ram_a_limit() -> None:
    gated = Gated().owned()
    for _ in range(300):
        gated.command(ref=VELOCITY)
        before = gated.q.copy()
        gated.tick()
    assert (gated.q <= LIMITS.upper).all()
    assert gated.q == pytest.approx(LIMITS.upper, abs=1e-3)
    assert gated.velocity == pytest.approx(0.0, abs=0.05)
    assert (np.abs(gated.q - before) < 1e-3).all()


# What may happen at any time, sense or nonsense.
REFERENCE = st.lists(st.floats(-1.3, 1.3) | st.sampled_from([VELOCITY, -VELOCITY, math.nan, 1e9]), min_size=N, max_size=N)
COMMAND = st.tuples(st.sampled_from(["velocity", "position", "torque", "hold"]), REFERENCE, st.integers(-3, 1), st.integers(1, 300))
DEED = st.one_of(COMMAND, COMMAND, COMMAND, st.sampled_from(["take", "arm", "own", "release", "hold", "lose", "stop", "reset", "late"]))


def do(gated: Gated, deed: object) -> None:
    gate = gated.gate
    try:
        if isinstance(deed, tuple):
            mode, ref, behind, ttl = deed
            if mode == "torque":
                ref = [40.0 * x for x in ref]
            if mode == "position":
                ref = (gated.q + 0.03 * np.array(ref)).tolist()
            gated.command(mode, ref, re_k=max(0, gated.k + behind), ttl=ttl)
        elif deed == "take":
            gate.take("controller", "c1")
        elif deed == "own":
            gated.owned()
        elif deed in ("arm", "release", "hold"):
            getattr(gate, str(deed))(gate.epoch)
        elif deed == "lose":
            gate.lose_owner()
        elif deed == "stop":
            gate.stop("test")
        elif deed == "reset":
            gate.reset_stop()
    except Refused:
        pass


@given(
    deeds=st.lists(DEED, min_size=5, max_size=60),
    pause=st.integers(1, 6),
    parameters=st.sampled_from([MotorParameters.ideal(), MotorParameters()]),
)
def test_the_motors_keep_their_limits_under_any_commands(deeds: list[object], pause: int, parameters: MotorParameters) -> None:
    gated = Gated(parameters).owned()
    for deed in deeds:
        do(gated, deed)
        for _ in range(pause):
            change = gated.tick(wall=0.2 if deed == "late" else None)
            assert np.abs(gated.velocity).max() <= VELOCITY * ROUNDING
            assert np.abs(change).max() <= ACCELERATION * gated.dt * ROUNDING, deed
            assert ((gated.q >= LIMITS.lower) & (gated.q <= LIMITS.upper)).all()


@given(deeds=st.lists(DEED, max_size=40))
def test_an_old_epoch_never_moves_anything(deeds: list[object]) -> None:
    gated = Gated().owned()
    old = gated.gate.epoch
    gated.gate.take("other", "o1")
    for deed in deeds:
        if isinstance(deed, tuple):
            with pytest.raises(Refused):
                gated.command(deed[0], deed[1], epoch=old)
        elif deed != "reset":
            do(gated, deed)
        gated.tick()
        assert gated.drive.mode == "hold"


@given(deeds=st.lists(DEED, max_size=40))
def test_an_emergency_stop_stays_through_everything_but_its_reset(deeds: list[object]) -> None:
    gated = Gated().owned()
    gated.gate.stop("test")
    for deed in deeds:
        if deed != "reset":
            do(gated, deed)
        gated.tick()
        assert gated.gate.state == "estop"
        assert gated.drive.mode == "hold"


@pytest.mark.parametrize("parameters", [MotorParameters.ideal(), MotorParameters()])
def test_a_torque_that_drives_a_motor_into_its_limit_ends_in_a_hold_before_it(parameters: MotorParameters) -> None:
    gated = Gated(parameters).owned()
    for _ in range(1000):
        if gated.gate.state != "armed":
            break
        gated.command("torque", [20.0, 0.0, 0.0])
        gated.tick()
    assert "torque" in gated.events[-1][1]
    assert gated.gate.mode == "hold"
    for _ in range(50):
        gated.tick()
    assert gated.q[0] <= LIMITS.upper[0] + 1e-6
    assert abs(gated.velocity[0]) < 0.01
    assert gated.q[0] > LIMITS.upper[0] - 0.2  # not long before it either


def test_in_lockstep_a_command_is_in_force_for_three_ticks() -> None:
    events: list[tuple[str, dict[str, float]]] = []
    gate = Gate(PART, LIMITS, 0.05, report=lambda code, text, values: events.append((text, values)), ttl_ticks=LOCKED_TTL)
    epoch, still = gate.take("controller", "c1"), np.zeros(N)
    gate.arm(epoch)
    gate.admit(Order("controller", epoch, 0, 10, "velocity", np.zeros(N), 100), 10, 0, still)
    for k in (11, 12, 13):
        assert gate.tick(k, 10**12, still, still).mode == "velocity"
    assert gate.tick(14, 10**12, still, still).mode == "hold"
    assert (gate.state, events) == ("hold", [(f"{PART}: no valid command for 4 ticks, limit 3", {"age": 4.0})])


def test_the_report_of_a_command_that_is_too_old_says_by_how_much() -> None:
    gated = Gated().owned()
    gated.command(ref=0.05, ttl=100)
    gated.gate.tick(1, 120_000_000, gated.q, gated.velocity)
    assert gated.events == [("hold", f"{PART}: no valid command for 120 ms, ttl 100 ms")]
