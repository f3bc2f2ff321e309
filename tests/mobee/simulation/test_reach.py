# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from mobee.arrays import Array
from mobee.control import Controller, Gains, Settle
from mobee.errors import ActionInterrupted, InvalidValue, UnknownName
from mobee.model import sphere
from mobee.model.model import Model
from mobee.model.world_file import load_world
from mobee.reach import TARGET, ReachTarget
from mobee.robot.load import load_robot
from mobee.simulation import MotorParameters, Motors, OfflinePlant
from tests.mobee.control.two_parts import two_part_arm

ICUB = load_robot("icub_2014")
RIGHT = ("r_shoulder_pitch", "r_shoulder_roll", "r_shoulder_yaw", "r_elbow")
BOTH = pytest.mark.parametrize("gains", [Gains.default(), Gains.published_2014()], ids=lambda g: g.law)
NEAR = ReachTarget((0.45, 0.75, 0.0), 0.01)  # beside the tip of the arm at rest below


def bent(**options: Any) -> OfflinePlant:
    """The planar arm at rest, its tip at about (0.58, 0.55)."""
    plant = OfflinePlant(Model(two_part_arm()), **options)
    plant.act("trunk", np.array([0.3]))
    plant.act("arm", np.array([0.5, 0.5]))
    return plant


@BOTH
def test_a_reach_is_drawn_to_the_target_and_back(gains: Gains) -> None:
    plant = bent(gains=gains)
    before, started = plant.measure("arm"), plant.time
    tip = plant.model.evaluate(np.concatenate([plant.measure("trunk"), before])).position("tip")
    plant.present(NEAR)
    outcome = plant.reach("arm", "tip")
    assert outcome.settled and outcome.after.settled
    assert outcome.missing == pytest.approx(NEAR.missing(outcome.marker))
    assert outcome.missing < 0.7 * NEAR.missing(tip)
    assert np.abs(outcome.q - before).max() > 0.05
    assert outcome.after.q == pytest.approx([0.5, 0.5], abs=0.03)
    assert np.array_equal(plant.measure("arm"), outcome.after.q)
    assert outcome.duration == pytest.approx(plant.time - started)
    assert plant.reaching == ()
    assert outcome is plant.reached("arm")


def test_after_a_restart_no_reach_has_ended() -> None:
    plant = bent()
    plant.present(NEAR)
    plant.reach("arm", "tip")
    plant.restart(0)
    with pytest.raises(InvalidValue, match="has not ended a reach"):
        plant.reached("arm")


@BOTH
def test_with_stay_the_part_is_not_drawn_back(gains: Gains) -> None:
    plant = bent(gains=gains)
    plant.present(NEAR)
    outcome = plant.reach("arm", "tip", stay=True)
    assert np.array_equal(outcome.after.q, outcome.q) and outcome.duration == outcome.after.duration
    plant.run(100)
    assert plant.measure("arm") == pytest.approx(outcome.q, abs=0.03)


def test_a_reach_without_a_target_is_refused() -> None:
    plant = bent()
    with pytest.raises(InvalidValue, match="no target is presented"):
        plant.reach("arm", "tip")
    plant.present(NEAR)
    plant.present(None)
    assert TARGET not in plant.model.world.objects
    with pytest.raises(InvalidValue, match="no target is presented"):
        plant.reach("arm", "tip")
    with pytest.raises(InvalidValue, match="has not ended a reach"):
        plant.reached("arm")


def test_a_refused_call_changes_nothing() -> None:
    plant = bent()
    with pytest.raises(UnknownName, match="marker"):
        plant.act("arm", np.zeros(2), reaching="nothing")
    assert plant.acting == () and plant.controller.attractor[1:] == pytest.approx([0.5, 0.5])
    plant.present(NEAR)
    plant.begin_reach("arm", "tip")
    with pytest.raises(UnknownName, match="marker"):
        plant.begin_reach("arm", "nothing")
    with pytest.raises(InvalidValue, match="radius"):
        plant.present(replace(NEAR, radius=1e-10))
    assert plant.reaching == ("tip",) and plant.model.world.objects[TARGET].size == (NEAR.radius,)
    plant.advance()
    undisturbed = bent()
    undisturbed.present(NEAR)
    assert np.array_equal(plant.reached("arm").q, undisturbed.reach("arm", "tip").q)


def test_a_presented_target_is_moved_and_grows() -> None:
    plant = bent()
    plant.present(NEAR)
    plant.present(replace(NEAR, position=np.array([0.1, 0.2, 0.3])))
    thing = plant.model.world.objects[TARGET]
    assert thing.position.tolist() == [0.1, 0.2, 0.3] and thing.role == "target" and thing.size == (0.01,)
    plant.present(ReachTarget((0.0, 0.0, 0.5), 0.07))
    assert plant.model.world.objects[TARGET].size == (0.07,)


def test_reaching_while_another_part_acts_is_refused() -> None:
    plant = bent()
    plant.present(NEAR)
    plant.begin("trunk", np.array([0.2]))
    with pytest.raises(InvalidValue, match="trunk is acting"):
        plant.reach("arm", "tip")


def test_reaches_and_actions_run_at_the_same_time() -> None:
    plant = bent()
    plant.present(NEAR)
    plant.begin_reach("arm", "tip")
    plant.begin("trunk", np.array([0.35]))
    order = []
    while len(order) < 2:
        order += [name for name, _ in plant.advance()]
    assert order == ["trunk", "arm"]  # the arm settles twice
    assert plant.reached("arm").after.settled


def test_a_new_action_ends_a_reach() -> None:
    plant = bent()
    plant.present(NEAR)
    plant.begin_reach("arm", "tip")
    plant.run(50)
    assert plant.reaching == ("tip",)
    outcome = plant.act("arm", np.array([0.5, 0.5]))
    assert plant.reaching == ()
    assert outcome.q == pytest.approx([0.5, 0.5], abs=0.03)
    with pytest.raises(InvalidValue, match="has not ended a reach"):
        plant.reached("arm")


def test_a_reach_that_never_settles_times_out() -> None:
    never = Settle(speed=1e-9, acceleration=1e-9, timeout=2.0)
    plant = OfflinePlant(Model(two_part_arm()), gains=replace(Gains.default(), settle=never))
    plant.present(NEAR)
    outcome = plant.reach("arm", "tip")
    assert not outcome.settled and not outcome.after.settled
    assert outcome.duration == pytest.approx(4.0)


def test_a_lost_state_interrupts_a_reach() -> None:
    plant = bent()
    plant.present(NEAR)
    plant.begin_reach("arm", "tip")
    plant.run(5)
    plant.motors.state["q"] = np.nan
    with pytest.raises(ActionInterrupted, match="not finite"):
        plant.advance()
    assert plant.reaching == () and not plant.controller.reaches


@BOTH
def test_the_command_is_continuous_where_the_pull_begins_and_ends(gains: Gains) -> None:
    plant = bent(gains=gains)
    plant.present(NEAR)
    plant.begin_reach("arm", "tip")
    trace = plant.run(2000)
    change = np.abs(np.diff(trace.velocity, axis=0)).max(axis=0)
    assert plant.reached("arm").settled
    assert (change <= [m.max_acceleration * plant.dt for m in plant.robot.motor_table]).all()
    assert (np.abs(trace.velocity).max(axis=0) <= [m.max_velocity for m in plant.robot.motor_table]).all()


def reference(gains: Gains, ticks: int, world: str | None) -> Array:
    """Encoders (ticks, n) of a reach by `Controller.step` alone, from a plant's first tick on."""
    model = Model(ICUB, None if world is None else load_world(world))
    model.world.add(TARGET, sphere(0.05), position=(-0.3, 0.1, 0.05), role="target")
    controller, motors = Controller(model, gains), Motors(ICUB, MotorParameters(), 5, ICUB.home)
    controller.reach_toward("right_arm", "right_palm", ReachTarget((-0.3, 0.1, 0.05)))
    track, velocity, encoders = model.track(), None, []
    for k in range(1, ticks + 1):
        if velocity is not None:
            motors.command(slice(None), "velocity", velocity)
        q = motors.encoders(k, 0.02)
        velocity = controller.step(q, 0.02, controller.forces(track.evaluate(q, "right_palm"))).velocity
        motors.move(motors.parameters.substeps(0.02), 0.02 / motors.parameters.substeps(0.02))
        encoders.append(q)
    return np.array(encoders)


@BOTH
@pytest.mark.parametrize("world", [None, "table"])
def test_the_plants_reach_is_the_controllers_to_the_last_bit(gains: Gains, world: str | None) -> None:
    plant = OfflinePlant(Model(ICUB, None if world is None else load_world(world)), 5, gains, dt=0.02)
    plant.present(ReachTarget((-0.3, 0.1, 0.05)))
    plant.begin_reach("right_arm", "right_palm")
    trace = plant.run(45)
    assert plant.reaching == ("right_palm",)
    assert np.array_equal(trace.encoders, reference(gains, 45, world))
    assert np.abs(trace.encoders[-1] - trace.encoders[0]).max() > 0.1


@BOTH
def test_tick_by_tick_a_reach_is_the_same_as_at_once(gains: Gains) -> None:
    outcomes = []
    for ticks in (1, 7, 1000):
        plant = OfflinePlant(Model(ICUB), 3, gains, dt=0.02, active=RIGHT, hashed=True)
        plant.present(ReachTarget((-0.3, 0.1, 0.05)))
        plant.begin_reach("right_arm", "right_palm")
        while plant.time < 30.0:
            plant.run(min(ticks, round((30.0 - plant.time) / 0.02)))
        outcomes.append((plant.hash, plant.reached("right_arm").missing, plant.reached("right_arm").duration))
    assert outcomes[0] == outcomes[1] == outcomes[2]


def test_the_target_repels_the_arm_but_not_the_reaching_hand() -> None:
    """A target in the hand pushes the arm away until the hand reaches for it; a target at the elbow continues to push."""

    def pushed(target: Array, reaching: bool) -> float:
        plant = OfflinePlant(Model(ICUB), 0, Gains.published_2014(), dt=0.02, active=RIGHT, motors=MotorParameters.ideal())
        plant.present(ReachTarget(target))
        if reaching:
            plant.begin_reach("right_arm", "right_palm")
        plant.tick()
        return float(np.abs(plant.controller.last_forces.collision).max())

    home = Model(ICUB).evaluate(ICUB.home)
    palm, elbow = home.position("right_palm"), home.position("right_elbow")
    outward = palm + 0.02 * home.normal("right_palm")
    assert pushed(outward, False) > 0.1
    assert pushed(outward, True) == 0.0
    assert pushed(elbow, True) == pytest.approx(pushed(elbow, False)) and pushed(elbow, True) > 0.1


def test_a_palm_turns_towards_what_it_reaches_for() -> None:
    robot, place = load_robot("icub"), np.array([-0.3, 0.2, 0.1])
    cosines = []
    for faces in (False, True):
        plant = OfflinePlant(Model(robot), 0, active=["right_arm"])
        plant.present(ReachTarget(place, 0.04, "surface", faces=faces))
        outcome = plant.reach("right_arm", "right_palm", stay=True)
        assert outcome.missing < 2e-3
        ahead = place - outcome.marker
        cosines.append(float(plant.model.evaluate(plant.q).normal("right_palm") @ ahead / np.linalg.norm(ahead)))
    assert cosines[0] < np.cos(np.deg2rad(30.0))
    assert cosines[1] > np.cos(np.deg2rad(5.0))


def test_both_hands_reach_at_once() -> None:
    plant = OfflinePlant(Model(ICUB), 0, Gains.published_2014(), dt=0.02, active=("left_arm", "right_arm"))
    plant.present(ReachTarget((-0.3, 0.0, 0.1)))
    plant.begin_reach("left_arm", "left_palm")
    plant.begin_reach("right_arm", "right_palm")
    assert plant.reaching == ("left_palm", "right_palm")
    ended: list[str] = []
    while len(ended) < 2:
        ended += [name for name, _ in plant.advance()]
    assert sorted(ended) == ["left_arm", "right_arm"]
    assert all(plant.reached(part).missing < 0.25 for part in ended)


def test_a_callback_moves_the_target_and_the_hand_follows() -> None:
    plant = bent()
    plant.present(NEAR)
    called = []

    def follow(time: float) -> None:
        called.append(time)
        if len(called) < 10:
            plant.present(replace(NEAR, position=NEAR.position - [0.0, 0.01 * len(called), 0.0]))

    start = plant.time
    plant.every(20, follow)
    outcome = plant.reach("arm", "tip", stay=True)
    assert np.diff(called) == pytest.approx(0.2)
    assert len(called) == pytest.approx((plant.time - start) / 0.2, abs=1)
    assert np.linalg.norm(outcome.marker - (NEAR.position - [0.0, 0.09, 0.0])) == pytest.approx(outcome.missing)
    assert outcome.missing < 0.02
    with pytest.raises(InvalidValue, match="ticks=.*: give a whole number, 1 or more"):
        plant.every(0, follow)
    plant.every(1, None)
    count = len(called)
    plant.run(50)
    assert len(called) == count


def test_a_target_cannot_be_removed_during_a_reach() -> None:
    plant = bent()
    plant.present(NEAR)
    plant.begin_reach("arm", "tip")
    with pytest.raises(InvalidValue, match="can be moved but not removed"):
        plant.present(None)
