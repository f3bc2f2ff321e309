# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from mobee.control import Controller, Forces, Gains
from mobee.control.forces import LARGEST_FORCE
from mobee.control.law import FRICTION, INERTIA
from mobee.errors import InvalidValue, UnknownName
from mobee.model.masses import gravity_torque
from mobee.model.model import Model
from mobee.robot.load import load_robot
from tests.mobee.control.two_parts import STRETCHED, touching, two_part_arm

DT = 0.01
BOTH = pytest.mark.parametrize("gains", [Gains.default(), Gains.published_2014()], ids=lambda g: g.law)
GOAL = np.array([0.5, -0.4, 0.3])


def arm_controller(**options: Any) -> Controller:
    return Controller(Model(two_part_arm()), **options)


def follow(controller: Controller, q: np.ndarray, seconds: float) -> np.ndarray:
    """The path of a robot that follows its commands exactly."""
    path = [q]
    for _ in range(round(seconds / DT)):
        path.append(path[-1] + DT * controller.step(path[-1], DT).velocity)
    return np.array(path)


@BOTH
def test_free_motion_converges_to_the_attractor_without_overshoot(gains: Gains) -> None:
    controller = arm_controller(gains=gains)
    controller.attractor = GOAL
    path = follow(controller, STRETCHED, 12.0)
    assert path[-1] == pytest.approx(GOAL, abs=1e-3)
    assert np.all(np.abs(path) <= np.abs(GOAL) + 1e-9)


@BOTH
def test_the_icub_converges_too(gains: Gains) -> None:
    robot = load_robot("icub")
    controller = Controller(Model(robot), gains)
    controller.reset(robot.home)
    goal = robot.home + np.where(controller.weight > 0, 0.2, 0.0) * np.where(robot.home > robot.limits.mean(axis=1), -1, 1)
    controller.attractor = goal
    free = Forces(np.zeros(len(goal)), np.zeros(len(goal)), np.zeros(len(goal)))
    q = robot.home
    for _ in range(1000):
        q = q + DT * controller.step(q, DT, free).velocity
    assert q == pytest.approx(goal, abs=1e-3)


@BOTH
def test_an_attractor_on_the_limit_is_approached_from_inside(gains: Gains) -> None:
    controller = arm_controller(gains=gains)
    controller.attractor = np.array([3.0, -3.0, 0.0])
    path = follow(controller, np.array([2.0, -2.0, 0.0]), 15.0)
    assert np.all(np.abs(path) < 3.0)
    assert np.abs(path[-1, :2]) == pytest.approx([2.9, 2.9], abs=0.08)


def test_a_wall_of_contact_forces_stops_the_arm_in_the_field() -> None:
    model = touching(+0.2)
    controller = Controller(model)
    controller.attractor = np.array([-0.5, 0.0, 0.0])  # the tip through the ball
    path = follow(controller, STRETCHED, 6.0)
    deepest = max(c.depth for q in path[::10] for c in model.evaluate(q).contacts)
    assert 0.0 < deepest < 0.05
    assert np.abs(controller.velocity).max() < 0.01


def test_velocity_and_acceleration_stay_within_the_motors_limits() -> None:
    gains = replace(Gains.default(), max_spring=500.0)
    controller = arm_controller(gains=gains, speed_scale=0.5)
    controller.attractor = np.array([3.0, -3.0, 0.0])
    velocities = np.diff(follow(controller, STRETCHED, 2.0), axis=0) / DT
    motor = controller.robot.motor_table[0]
    assert np.abs(velocities).max() == pytest.approx(0.5 * motor.max_velocity, rel=0.01)
    assert np.abs(velocities).max() < 0.5 * motor.max_velocity
    assert np.abs(np.diff(velocities, axis=0)).max() < motor.max_acceleration * DT


def test_a_motor_of_weight_zero_is_never_moved() -> None:
    controller = arm_controller(gains=replace(Gains.default(), weights=(("m1", 0.0),)))
    controller.attractor = GOAL
    path = follow(controller, STRETCHED, 1.0)
    assert not path[:, 1].any() and path[-1, 0] > 0.1
    assert controller.acceleration[1] == 0.0


def test_the_velocity_is_the_controllers_own_and_not_a_difference_of_encoders() -> None:
    steady, shaken = arm_controller(), arm_controller()
    free = Forces(np.zeros(3), np.zeros(3), np.zeros(3))
    noise = np.deg2rad(0.1)
    for k in range(100):
        steady.step(STRETCHED, DT, free)
        shaken.step(STRETCHED + (-noise if k % 2 else noise), DT, free)
    assert np.abs(shaken.velocity).max() < 0.01 * 2 * noise / DT


def test_given_forces_are_used_and_remembered() -> None:
    controller = arm_controller()
    given = {"limits": np.array([1.0, 0.0, 0.0]), "collision": np.array([0.0, 0.0, -2.0])}
    forces = Forces(**{**controller.last_forces, **given})
    command = controller.step(STRETCHED, DT, forces)
    assert command.velocity == pytest.approx(DT * forces.total)
    assert controller.last_forces is forces
    assert controller.acceleration == pytest.approx(forces.total)


def test_position_commands_integrate_the_reference_and_not_the_encoders() -> None:
    controller = arm_controller(modality="position")
    controller.attractor = GOAL
    free = Forces(np.zeros(3), np.zeros(3), np.zeros(3))
    reference = STRETCHED
    for k in range(50):
        command = controller.step(np.full(3, 1e-3 * (-1) ** k), DT, free)
        reference = reference + DT * command.velocity
        assert command.position == pytest.approx(reference, abs=1e-12)


def test_the_position_reference_does_not_run_away_from_a_blocked_motor() -> None:
    controller = arm_controller(modality="position")
    controller.attractor = np.array([2.0, 0.0, 0.0])
    for _ in range(1000):
        command = controller.step(STRETCHED, DT)
    assert 0.1 < command.position[0] < 0.4


def test_torque_commands_move_the_motor_they_are_made_for() -> None:
    controller = arm_controller(modality="torque")
    controller.attractor = GOAL
    q, v = STRETCHED, np.zeros(3)
    for _ in range(1000):
        v = v + DT / INERTIA * (controller.step(q, DT).torque - FRICTION * v)
        q = q + DT * v
    assert q == pytest.approx(GOAL, abs=5e-3)


@BOTH
def test_a_client_force_displaces_the_part_until_cleared(gains: Gains) -> None:
    controller = arm_controller(gains=gains)
    controller.force(np.array([0.0, 2.0, 0.0]))
    assert follow(controller, STRETCHED, 3.0)[-1, 1] > 0.01
    controller.clear()
    assert follow(controller, STRETCHED, 3.0)[-1] == pytest.approx(STRETCHED, abs=1e-3)


@BOTH
def test_a_client_force_of_any_size_is_bounded(gains: Gains) -> None:
    controller = arm_controller(gains=gains)
    controller.force(np.array([0.0, 0.0, 1e9]))
    controller.step(STRETCHED, DT, Forces(np.zeros(3), np.zeros(3), np.zeros(3)))
    assert controller.acceleration[2] <= gains.max_client


def test_a_push_on_a_marker_acts_through_its_jacobian() -> None:
    controller = arm_controller()
    controller.push("tip", np.array([0.0, 1e-3, 0.0]))
    controller.step(STRETCHED, DT)
    assert controller.acceleration == pytest.approx(1e-3 * np.array([0.9, 0.6, 0.3]), rel=1e-3)


def test_reset_is_rest_at_the_measured_pose() -> None:
    controller = arm_controller()
    controller.attractor = GOAL
    follow(controller, STRETCHED, 0.5)
    controller.reset(0.1 * GOAL)
    assert not controller.velocity.any()
    assert np.array_equal(controller.attractor, 0.1 * GOAL)
    assert np.array_equal(controller.step(0.1 * GOAL, DT).velocity, np.zeros(3))


def test_hold_stops_one_part_within_the_acceleration_limit_and_leaves_the_other() -> None:
    controller = arm_controller()
    controller.attractor = np.array([2.0, 2.0, 0.0])
    before = follow(controller, STRETCHED, 0.5)[-1]
    v = controller.velocity
    controller.hold("arm", before[1:])
    assert not controller.velocity[1:].any() and controller.velocity[0] == v[0]
    command = controller.step(before, DT)
    assert np.abs(command.velocity - v).max() <= controller.robot.motor_table[0].max_acceleration * DT
    assert controller.acceleration == pytest.approx((command.velocity - v) / DT)  # what a torque command is made of
    end = follow(controller, before, 2.0)[-1]
    assert end[1:] == pytest.approx(before[1:], abs=0.05)
    assert end[0] > before[0] + 0.1


def test_the_attractor_is_copied_in_and_out() -> None:
    controller = arm_controller()
    goal = GOAL.copy()
    controller.attractor = goal
    goal[0] = 9.0
    controller.attractor[1] = 9.0
    assert np.array_equal(controller.attractor, GOAL)
    controller.set_attractor("arm", np.array([0.1, 0.2]))
    assert np.array_equal(controller.attractor, [GOAL[0], 0.1, 0.2])


def test_bad_input_is_refused() -> None:
    controller = arm_controller()
    with pytest.raises(InvalidValue, match="3 finite numbers"):
        controller.step(np.array([0.0, np.nan, 0.0]), DT)
    with pytest.raises(InvalidValue, match="attractor of arm"):
        controller.set_attractor("arm", np.zeros(3))
    with pytest.raises(InvalidValue, match="unstable"):
        controller.step(STRETCHED, 0.1)
    with pytest.raises(InvalidValue, match="speed_scale"):
        arm_controller(speed_scale=0.0)
    with pytest.raises(InvalidValue, match="it must be a Model"):
        Controller(two_part_arm())
    with pytest.raises(InvalidValue, match=r"gains is 'default'; .*Gains.named"):
        arm_controller(gains="default")
    with pytest.raises(UnknownName, match="tip"):
        controller.push("tpi", np.zeros(3))


@pytest.mark.parametrize(
    "forces", [Forces(np.zeros(3), np.float64(1.0), np.zeros(3)), Forces(np.zeros(3), np.ones(1), np.zeros(3)), np.zeros(3)]
)
def test_forces_that_are_not_one_number_for_each_motor_are_refused(forces: Any) -> None:
    controller = arm_controller()
    with pytest.raises(InvalidValue, match="'constraints' of shape .*must be 3 finite numbers|must be Forces"):
        controller.step(STRETCHED, DT, forces)
    assert not controller.velocity.any()


@pytest.mark.parametrize("pose", [Model(load_robot("katana")).evaluate(load_robot("katana").home), "home"], ids=["katana", "text"])
def test_a_pose_of_another_robot_is_refused(pose: Any) -> None:
    controller = arm_controller()
    for use in (controller.forces, lambda given: controller.step(STRETCHED, DT, pose=given)):
        with pytest.raises(InvalidValue, match=f"pose .*must be a pose of '{controller.robot.name}'"):
            use(pose)
    again = Model(two_part_arm()).evaluate(STRETCHED)  # of an equal robot
    assert controller.step(STRETCHED, DT, pose=again).velocity.shape == (3,)


@pytest.mark.parametrize("text", ["0.01", None])
def test_text_or_none_for_a_number_is_refused(text: Any) -> None:
    with pytest.raises(InvalidValue, match=f"time step {text!r} s"):
        arm_controller().step(STRETCHED, text)
    with pytest.raises(InvalidValue, match=f"speed_scale {text!r}"):
        arm_controller(speed_scale=text)


def test_a_misspelt_attribute_is_refused() -> None:
    with pytest.raises(AttributeError, match="atractor"):
        arm_controller().atractor = GOAL


@BOTH
def test_forces_of_any_size_that_is_taken_leave_the_law_with_numbers(gains: Gains) -> None:
    controller = arm_controller(gains=gains)
    marker = next(iter(controller.robot.markers))
    for size in (LARGEST_FORCE, -LARGEST_FORCE):
        controller.reset(STRETCHED)
        controller.force(np.full(3, size))
        controller.push(marker, np.array([size, -size, size]))
        velocity = controller.step(STRETCHED, DT, Forces(np.full(3, size), np.zeros(3), np.zeros(3))).velocity
        assert np.sign(velocity).tolist() == [np.sign(size)] * 3
    for beyond in (1.01 * LARGEST_FORCE, 1.7e308):
        with pytest.raises(InvalidValue, match="at most 1e[+]09"):
            controller.force(np.full(3, beyond))
        with pytest.raises(InvalidValue, match="at most 1e[+]09"):
            controller.push(marker, np.array([0.0, -beyond, 0.0]))
        with pytest.raises(InvalidValue, match="at most 1e[+]09"):
            controller.step(STRETCHED, DT, Forces(np.full(3, beyond), np.zeros(3), np.zeros(3)))


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_numbers_that_are_none_are_refused_and_nothing_changes(bad: float) -> None:
    controller = arm_controller()
    zero, broken = np.zeros(3), np.array([0.0, bad, 0.0])
    for give in (
        lambda: controller.force(broken),
        lambda: controller.push("tip", broken),
        lambda: controller.set_attractor("arm", broken[:2]),
        lambda: setattr(controller, "attractor", broken),
        lambda: controller.reset(broken),
        lambda: controller.step(broken, DT),
        lambda: controller.step(zero, DT, Forces(zero, broken, zero)),
    ):
        with pytest.raises(InvalidValue, match=r"number 1 is -?(nan|inf); must be . finite numbers"):
            give()
    assert not controller.step(zero, DT).velocity.any()


@BOTH
def test_an_attractor_far_outside_the_limits_does_not_pull_a_motor_out_of_them(gains: Gains) -> None:
    controller = arm_controller(gains=gains)
    controller.attractor = np.array([100.0, -100.0, 0.0])
    path = follow(controller, STRETCHED, 15.0)
    assert np.abs(path).max() < 3.0


def test_a_push_with_a_moment_acts_through_the_whole_jacobian() -> None:
    controller = arm_controller()
    controller.push("tip", np.array([0.0, 0.0, 0.0, 0.0, 0.0, 1e-3]))
    controller.step(STRETCHED, DT)
    assert controller.acceleration == pytest.approx(1e-3 * np.ones(3), rel=1e-3)


def test_client_forces_keep_their_direction_where_the_gains_say_so() -> None:
    controller = arm_controller(gains=replace(Gains.default(), client_squash="direction").with_motors("m2", max_client=2.0))
    controller.force(np.array([0.0, 300.0, 400.0]))
    controller.step(STRETCHED, DT, Forces(np.zeros(3), np.zeros(3), np.zeros(3)))
    a = controller.acceleration[1:]
    assert a[1] / a[0] == pytest.approx(4.0 / 3.0)
    assert np.linalg.norm(a) == pytest.approx(2.0, rel=0.01)


def test_torque_commands_carry_the_robots_weight() -> None:
    robot = load_robot("icub")
    controller = Controller(Model(robot), modality="torque")
    free = Forces(*np.zeros((3, len(robot.motors))))
    assert controller.step(robot.home, DT, free).torque == pytest.approx(gravity_torque(robot, robot.home))
    assert not Controller(Model(robot), modality="velocity").step(robot.home, DT, free).torque.any()


def test_an_unknown_modality_or_propagation_is_refused() -> None:
    with pytest.raises(UnknownName, match="modality 'force'.*position, torque, velocity"):
        arm_controller(modality="force")
    with pytest.raises(UnknownName, match="propagation 'arm'.*part, tree"):
        arm_controller(propagate="arm")


@pytest.mark.parametrize("alive", [np.ones(99, dtype=bool), np.ones(3), [True, True, True]], ids=["count", "numbers", "list"])
def test_motors_that_are_not_one_boolean_each_are_refused(alive: Any) -> None:
    with pytest.raises(InvalidValue, match="(?s)alive is .*must be an array of 3 booleans"):
        arm_controller(alive=alive)
