# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import copy
import pickle
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from mobee.arrays import Array
from mobee.control import Gains, Settle
from mobee.control.reach import Reacher
from mobee.errors import ActionInterrupted, InvalidValue, MobeeError, UnknownName
from mobee.model import sphere
from mobee.model.model import Model
from mobee.model.world_file import load_world
from mobee.robot.load import load_robot
from mobee.robot.robot import Robot
from mobee.simulation import MotorParameters, OfflinePlant
from tests.mobee.control.two_parts import touching, two_part_arm

ICUB = load_robot("icub")
BOTH = pytest.mark.parametrize("gains", [Gains.default(), Gains.published_2014()], ids=lambda g: g.law)


def arm_plant(**options: Any) -> OfflinePlant:
    return OfflinePlant(Model(two_part_arm()), **options)


def lattice_target(robot: Robot, part: str, levels: tuple[float, ...]) -> Array:
    """The first motors of the part at these shares of their ranges, the others at half."""
    limits = robot.limits[robot.parts[part].slice]
    share = np.full(len(limits), 0.5)
    share[: len(levels)] = levels
    return limits[:, 0] + share * (limits[:, 1] - limits[:, 0])


@BOTH
def test_an_action_ends_settled_near_its_target(gains: Gains) -> None:
    plant = arm_plant(gains=gains)
    outcome = plant.act("arm", np.array([0.4, -0.3]))
    assert outcome.settled and outcome.touched == ()
    assert outcome.q == pytest.approx([0.4, -0.3], abs=0.05)
    assert outcome.duration == pytest.approx(plant.time)
    assert np.array_equal(outcome.q, plant.measure("arm"))


def test_the_seed_decides_everything() -> None:
    def states(seed: int) -> list[float]:
        plant = OfflinePlant(Model(ICUB, load_world("table")), seed=seed)
        return [x for level in (0.25, 0.75) for x in plant.act("left_arm", lattice_target(ICUB, "left_arm", (level,) * 4)).q]

    assert states(3) == states(3)
    assert states(3) != states(4)


def test_a_command_acts_one_tick_after_the_encoders_it_answers() -> None:
    plant = arm_plant(motors=MotorParameters.ideal())
    plant.begin("arm", np.array([1.0, 0.0]))
    plant.tick()
    commanded = plant.controller.velocity[1]
    assert commanded > 0 and plant.motors.q[1] == 0.0
    plant.tick()
    assert plant.motors.q[1] == pytest.approx(commanded * plant.dt)


def test_published_arm_actions_on_the_rank_3_lattice_take_as_long_as_published() -> None:
    plant = OfflinePlant(Model(ICUB), gains=Gains.published_2014())
    plant.act("left_arm", lattice_target(ICUB, "left_arm", (0.5, 0.5, 0.5, 0.5)))
    goals = [(0.25, 0.5, 0.5, 0.5), (0.25, 0.5, 0.25, 0.5), (0.5, 0.5, 0.25, 0.75), (0.5, 0.25, 0.25, 0.75), (0.75, 0.25, 0.5, 0.75)]
    outcomes = [plant.act("left_arm", lattice_target(ICUB, "left_arm", goal)) for goal in goals]
    assert all(outcome.settled for outcome in outcomes)
    assert 3.0 <= np.median([outcome.duration for outcome in outcomes]) <= 6.5


def test_parts_act_asynchronously_and_the_others_stay_at_their_attractors() -> None:
    plant = arm_plant()
    plant.begin("trunk", np.array([0.2]))
    plant.begin("arm", np.array([1.5, 0.0]))
    (first,) = plant.advance()
    assert first[0] == "trunk"
    (second,) = plant.advance()
    assert second[0] == "arm" and second[1].duration > first[1].duration
    plant.act("arm", np.array([0.5, 0.0]))
    assert plant.measure("trunk") == pytest.approx([0.2], abs=0.02)


def test_acting_while_another_part_acts_is_refused() -> None:
    plant = arm_plant()
    plant.begin("trunk", np.array([0.2]))
    with pytest.raises(InvalidValue, match="trunk is acting"):
        plant.act("arm", np.zeros(2))


def test_the_outcome_names_the_objects_that_the_part_touches() -> None:
    model = touching(+0.1)
    plant = OfflinePlant(model)
    outcome = plant.act("trunk", np.array([-0.3]))
    assert outcome.touched == ("ball",)
    assert plant.act("trunk", np.array([0.3])).touched == ()


def test_without_contact_forces_the_part_goes_through() -> None:
    target = np.array([-0.6])
    through = OfflinePlant(touching(+0.1), contact_forces=False).act("trunk", target)
    stopped = OfflinePlant(touching(+0.1)).act("trunk", target)
    assert through.q == pytest.approx(target, abs=0.05)
    assert stopped.q[0] > -0.4


def test_a_second_of_action_is_a_second_of_control() -> None:
    """The goal counts from the tick after it was set, as in the controller's process."""
    at_once = Settle(speed=1e3, acceleration=1e3, first_check=1.0)
    plant = arm_plant(gains=replace(Gains.default(), settle=at_once))
    for _ in range(2):
        before = plant.time
        assert plant.act("arm", np.array([0.1, 0.1])).duration == pytest.approx(1.0)
        assert plant.time - before == pytest.approx(1.0)


def test_a_timeout_is_an_outcome() -> None:
    never = Settle(speed=1e-9, acceleration=1e-9, timeout=2.0)
    outcome = arm_plant(gains=replace(Gains.default(), settle=never)).act("arm", np.array([0.1, 0.1]))
    assert not outcome.settled
    assert outcome.duration == pytest.approx(2.0)


@BOTH
@pytest.mark.parametrize("modality", ["position", "torque"])
def test_other_modalities_reach_the_same_target(gains: Gains, modality: str) -> None:
    plant = arm_plant(gains=gains, modality=modality)
    outcome = plant.act("arm", np.array([0.6, -0.5]))
    assert outcome.settled
    assert outcome.q == pytest.approx([0.6, -0.5], abs=0.06)


def test_default_gains_hold_the_hand_above_the_table_that_it_is_sent_into() -> None:
    plant = OfflinePlant(Model(ICUB, load_world("table")))
    plant.begin("torso", np.array([0.0, 0.0, 0.7]))
    plant.begin("left_arm", lattice_target(ICUB, "left_arm", (0.5, 0.25, 0.5, 0.5)))
    fields, solids = 0.0, 0.0
    for _ in range(500):
        plant.tick()
        for contact in plant.pose.contacts:
            if contact.second == "table":
                fields = max(fields, contact.depth if contact.kind == "field" else 0.0)
                solids = max(solids, contact.depth if contact.kind == "solid" else 0.0)
    assert fields > 0.005
    assert solids == 0.0


def test_a_plant_that_is_not_finite_interrupts_the_action() -> None:
    plant = arm_plant()
    plant.begin("arm", np.array([0.5, 0.0]))
    plant.tick()
    plant.motors.adopt(np.array([0.0, np.nan, 0.0]))
    with pytest.raises(ActionInterrupted, match="not finite"):
        plant.advance()


def test_bad_input_is_refused() -> None:
    plant = arm_plant()
    with pytest.raises(InvalidValue, match="m2"):
        plant.act("arm", np.array([0.0, 3.5]))
    with pytest.raises(InvalidValue, match="attractor of arm"):
        plant.act("arm", np.zeros(3))
    with pytest.raises(InvalidValue, match="begin first"):
        plant.advance()
    with pytest.raises(UnknownName, match="trunk"):
        plant.measure("trunc")
    with pytest.raises(InvalidValue, match="motors is 'identified'; it must be MotorParameters"):
        arm_plant(motors="identified")
    for dt in (0.04, "0.01"):
        with pytest.raises(InvalidValue, match="tick"):
            arm_plant(gains=Gains.published_2014(), dt=dt)


@pytest.mark.parametrize("copied", [copy.copy, copy.deepcopy, pickle.dumps])
def test_a_copy_that_would_move_with_its_original_is_refused(copied: Any) -> None:
    plant = arm_plant()
    for thing, remedy in ((plant, "OfflinePlant"), (plant.controller, "Controller")):
        with pytest.raises(MobeeError, match=rf"cannot be copied or pickled.*as {remedy}\(model"):
            copied(thing)


@pytest.mark.parametrize("target", [["a"] * 6, [1j] * 6, [1.0] * 4, [np.nan] * 6, [99] * 6, [[0.0] * 6]])
def test_a_target_that_is_none_is_refused(target: Any) -> None:
    robot = load_robot("katana")
    plant = OfflinePlant(Model(robot))
    part = next(iter(robot.parts))
    with pytest.raises(InvalidValue):
        plant.begin(part, target)
    assert plant.acting == ()
    plant.begin(part, robot.home[robot.parts[part].slice].tolist())
    assert part in plant.acting


def test_q_holds_the_encoders_of_all_parts() -> None:
    plant = arm_plant(seed=1)
    plant.act("arm", np.array([0.4, -0.3]))
    assert np.array_equal(plant.q, np.concatenate([plant.measure(part) for part in plant.robot.parts]))
    plant.q[:] = 0.0
    assert plant.q.any()


def test_after_run_and_tick_objects_are_attached_where_they_are() -> None:
    for finish in (lambda plant: plant.run(600), lambda plant: [plant.tick() for _ in range(600)]):
        world = load_world("table")
        world.add("cup", sphere(0.03), position=(-0.4, -0.3, 0.2), role="ghost")
        robot = load_robot("icub")
        plant = OfflinePlant(Model(robot, world), motors=MotorParameters.ideal(), active=["left_arm"])
        goal = plant.measure("left_arm")
        goal[3] += 0.3
        plant.act("left_arm", goal)
        goal[3] += 0.5
        plant.begin("left_arm", goal)
        finish(plant)
        assert plant.acting == ()
        world.attach("cup", robot.links[robot.marker("left_palm").link])
        now = plant.model.evaluate(plant.q).objects["cup"].position
        np.testing.assert_allclose(now, (-0.4, -0.3, 0.2), atol=0.02)  # the arm settles further after the end of its action


def test_a_restart_ends_the_reaches_of_the_controller() -> None:
    model = Model(load_robot("icub"))
    plant = OfflinePlant(model, seed=1)
    Reacher(plant.controller, "right_palm", np.array([-0.3, 0.2, 0.1]))
    plant.run(50)
    plant.restart(1)
    np.testing.assert_array_equal(plant.run(50).q, OfflinePlant(model, seed=1).run(50).q)


@pytest.mark.parametrize("target", [(-0.3, 0.2, 0.1), np.array([-0.3, 0.2, 0.1]), "ball"])
def test_what_is_no_reach_target_is_refused_and_pulls_nothing(target: Any) -> None:
    plant = OfflinePlant(Model(load_robot("icub")), motors=MotorParameters.ideal())
    with pytest.raises(InvalidValue, match="must be a ReachTarget"):
        plant.present(target)
    with pytest.raises(InvalidValue, match="no target is presented"):
        plant.reach("right_arm", "right_palm")
    with pytest.raises(InvalidValue, match="must be a ReachTarget"):
        plant.controller.reach_toward("right_arm", "right_palm", target)
    same = OfflinePlant(Model(load_robot("icub")), motors=MotorParameters.ideal())
    np.testing.assert_array_equal(plant.run(50).q, same.run(50).q)
