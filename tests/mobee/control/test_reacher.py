# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from mobee.arrays import Array
from mobee.control import Controller, Gains
from mobee.control.reach import Reacher, reach_path
from mobee.errors import InvalidValue, UnknownName
from mobee.model import World, sphere
from mobee.model.model import Model
from mobee.reach import ReachTarget
from mobee.robot.load import load_robot
from mobee.simulation import MotorParameters, Motors
from tests.mobee.planar import planar_arm

DT = 0.01
EACH_MOTOR = pytest.mark.parametrize("motors", [MotorParameters(), MotorParameters.ideal()], ids=["noisy", "ideal"])
PLANAR = Model(planar_arm())
BENT = np.array([0.3, 0.7, 0.4])


@dataclass
class Drawn:
    """The record of a reach: the position of the marker at every tick, and the reported states."""

    path: Array  # (ticks, 3) m
    said: list[str]
    angle: float  # rad

    def distance(self, position: Array) -> Array:
        return np.linalg.norm(self.path - position, axis=1)

    def swing(self, seconds: float) -> float:
        """How far it is from its mean at most [m], at the end."""
        last = self.path[-round(seconds / DT) :]
        return float(np.linalg.norm(last - last.mean(axis=0), axis=1).max())


def draw(
    model: Model, marker: str, position: Array, start: Array, seconds: float, normal: Array | None = None,
    motors: MotorParameters | None = None, gains: Gains | None = None,
) -> Drawn:  # fmt: skip
    """A reach with motors that have lag, delay, play and noise, their commands one tick old."""
    parameters = motors or MotorParameters()
    plant = Motors(model.robot, parameters, 0, start)
    controller = Controller(model, gains)
    controller.reset(start)
    reacher = Reacher(controller, marker, position, normal)
    path, said = [], []
    velocity = np.zeros(len(start))
    for k in range(1, round(seconds / DT) + 1):
        plant.command(slice(None), "velocity", velocity)
        q = plant.encoders(k, DT)
        said.append(reacher.update(q, DT))
        velocity = controller.step(q, DT).velocity
        plant.move(2, DT / 2)
        path.append(model.evaluate(plant.q).position(marker))
    return Drawn(np.array(path), said, reacher.angle)


@EACH_MOTOR
def test_a_target_in_reach_is_reached_without_overshoot(motors: MotorParameters) -> None:
    position = PLANAR.evaluate(np.array([1.0, 0.5, 0.8])).position("tip")
    drawn = draw(PLANAR, "tip", position, BENT, 9.0, motors=motors)
    assert drawn.said[-1] == "reached"
    assert drawn.distance(position)[-1] < 2e-3
    assert drawn.swing(1.0) < 1e-3
    line = position - drawn.path[0]
    assert np.all((drawn.path - drawn.path[0]) @ line < (np.linalg.norm(line) + 2e-3) * np.linalg.norm(line))


@EACH_MOTOR
def test_with_the_published_gains_the_marker_rests_where_the_springs_are_as_strong(motors: MotorParameters) -> None:
    position = PLANAR.evaluate(np.array([1.0, 0.5, 0.8])).position("tip")
    drawn = draw(PLANAR, "tip", position, BENT, 15.0, motors=motors, gains=Gains.published_2014())
    assert drawn.said[-1] == "stuck"
    assert 5e-3 < drawn.distance(position)[-1] < 0.1
    assert drawn.swing(1.0) < 1e-3


@EACH_MOTOR
def test_out_of_a_stretched_arm_a_target_straight_inward_is_reached(motors: MotorParameters) -> None:
    position = np.array([0.5, 0.0, 0.0])
    drawn = draw(PLANAR, "tip", position, np.zeros(3), 9.0, motors=motors)
    assert drawn.said[-1] == "reached"
    assert drawn.distance(position)[-1] < 2e-3


@EACH_MOTOR
def test_a_target_20_cm_out_of_reach_is_approached_and_the_marker_rests(motors: MotorParameters) -> None:
    position = np.array([0.0, 1.1, 0.0])
    drawn = draw(PLANAR, "tip", position, BENT, 25.0, motors=motors)
    assert drawn.said[-1] == "stuck"
    assert drawn.distance(position)[-1] == pytest.approx(0.2, abs=2e-3)
    assert drawn.swing(3.0) < 1e-3


def test_the_icubs_arm_leaves_its_stretched_pose_and_rests_at_it() -> None:
    model = Model(load_robot("icub"))
    home = model.robot.home
    stretched = reach_path(model, "left_palm", np.array([-3.0, 0.0, 0.9]), home).q[-1]
    end = model.evaluate(stretched).position("left_palm")
    away = (np.array([-3.0, 0.0, 0.9]) - end) / np.linalg.norm(np.array([-3.0, 0.0, 0.9]) - end)
    inward = draw(model, "left_palm", end - 0.25 * away, stretched, 12.0)
    assert inward.distance(end - 0.25 * away)[-1] < 3e-3
    outward = draw(model, "left_palm", end + 0.2 * away, stretched, 12.0)
    assert outward.said[-1] == "stuck"
    assert outward.swing(1.0) < 1e-3


def test_the_normal_is_turned_too() -> None:
    model = Model(load_robot("icub"))
    low, high = model.robot.limits.T
    there = model.evaluate(model.robot.home + 0.2 * np.sign((low + high) / 2 - model.robot.home))
    drawn = draw(model, "left_palm", there.position("left_palm"), model.robot.home, 8.0, there.normal("left_palm"))
    assert drawn.distance(there.position("left_palm"))[-1] < 5e-3
    assert drawn.angle < 0.05


def test_it_is_the_controllers_reach_by_all_motors_that_move_the_marker() -> None:
    model = Model(load_robot("icub"))
    q, position = model.robot.home, np.array([-0.3, -0.2, 0.1])
    reaching, alone, still = Controller(model), Controller(model), Controller(model)
    reacher = Reacher(reaching, "left_palm", position)
    alone.reach_toward(None, "left_palm", ReachTarget(position))
    for _ in range(3):
        assert reacher.update(q, DT) == "reaching"
        velocity, at_rest = reaching.step(q, DT).velocity, still.step(q, DT).velocity
        assert np.array_equal(velocity, alone.step(q, DT).velocity)
    moved = {model.robot.motor_table[i].part for i in np.flatnonzero(velocity != at_rest)}
    assert moved == {"torso", "left_arm"}
    assert np.array_equal(reaching.attractor, q)


def test_a_target_in_the_world_does_not_repel_the_hand_that_reaches_for_it() -> None:
    robot = load_robot("icub")
    world, position = World(), Model(robot).evaluate(robot.home).position("right_palm")
    world.add("cup", sphere(0.03), position=position, role="target")
    controller = Controller(Model(robot, world))
    controller.step(robot.home, DT)
    assert np.abs(controller.last_forces["collision"]).max() > 1.0
    controller.reach_toward("right_arm", "right_palm", ReachTarget(position))
    controller.step(robot.home, DT)
    assert np.abs(controller.last_forces["collision"]).max() == 0.0


def test_a_new_reacher_replaces_the_last_one() -> None:
    first, second = PLANAR.evaluate(np.array([[1.0, 0.5, 0.8], [0.5, 0.4, 0.3]])).position("tip")
    one, other = Controller(PLANAR), Controller(PLANAR)
    Reacher(one, "tip", first)
    for controller in (one, other):
        Reacher(controller, "tip", second)
    assert np.array_equal(one.step(BENT, DT).velocity, other.step(BENT, DT).velocity)


def test_a_reach_is_stuck_after_three_seconds_without_progress() -> None:
    reacher = Reacher(Controller(PLANAR), "tip", np.array([0.0, 1.1, 0.0]))
    states = [reacher.update(BENT, 0.125) for _ in range(26)]  # the marker does not move
    assert states == ["reaching"] * 24 + ["stuck"] * 2
    assert reacher.distance == pytest.approx(np.linalg.norm(np.array([0.0, 1.1, 0.0]) - PLANAR.evaluate(BENT).position("tip")))


def test_its_distance_is_averaged_over_a_quarter_of_a_second() -> None:
    there, nearer = (PLANAR.evaluate(q).position("tip") for q in (BENT, 0.9 * BENT))
    reacher = Reacher(Controller(PLANAR), "tip", there)
    reacher.update(0.9 * BENT, DT)
    assert reacher.distance == pytest.approx(np.linalg.norm(there - nearer))
    reacher.update(BENT, DT)
    assert reacher.distance == pytest.approx(np.linalg.norm(there - nearer) * (1.0 - DT / 0.25))


def test_stop_leaves_every_motor_that_moves_the_marker_where_it_is() -> None:
    model = Model(load_robot("icub"))
    controller, q = Controller(model), model.robot.home + 0.05
    before = controller.attractor.copy()
    Reacher(controller, "left_palm", np.array([-0.3, -0.2, 0.1])).stop(q)
    moves = np.abs(model.jacobian(q, "left_palm")).max(axis=0) > 0
    assert 8 <= moves.sum() < len(moves)
    assert np.array_equal(controller.attractor[moves], q[moves])
    assert np.array_equal(controller.attractor[~moves], before[~moves])


def test_stop_ends_the_pull_and_leaves_the_other_motors_at_their_attractors() -> None:
    model = Model(load_robot("icub"))
    controller, q = Controller(model), model.robot.home + 0.05
    right = model.robot.part("right_arm").slice
    reacher = Reacher(controller, "left_palm", np.array([-0.3, -0.2, 0.1]))
    controller.set_attractor("right_arm", q[right] + 0.1)
    reacher.stop(q)
    assert np.array_equal(controller.attractor[right], q[right] + 0.1)
    inside = Controller(model)
    inside.reset(model.robot.home)
    inside.attractor = controller.attractor
    assert controller.attractor[model.robot.part("left_arm").slice][:7] == pytest.approx(q[model.robot.part("left_arm").slice][:7])
    assert np.array_equal(controller.step(q, DT).velocity, inside.step(q, DT).velocity)


def test_an_invalid_reach_is_refused() -> None:
    controller = Controller(PLANAR)
    with pytest.raises(UnknownName, match="tip"):
        Reacher(controller, "tpi", np.zeros(3))
    for tolerance in (0.0, "1 mm"):
        with pytest.raises(InvalidValue, match=f"tolerance {tolerance!r} m"):
            Reacher(controller, "tip", np.zeros(3), tolerance=tolerance)
    with pytest.raises(InvalidValue, match="the robot cannot reach with tip on link3: none of the motors"):
        Reacher(Controller(PLANAR, Gains.default().with_motors("*", weight=0)), "tip", np.zeros(3))


@pytest.mark.parametrize("wrong", [np.zeros((2, 3)), np.zeros(2), np.full(3, np.nan)], ids=["batch", "short", "nan"])
def test_an_invalid_pose_or_time_is_refused(wrong: Array) -> None:
    controller = Controller(PLANAR)
    reacher = Reacher(controller, "tip", np.zeros(3))
    for call in (lambda: reacher.update(wrong, 0.01), lambda: reacher.stop(wrong)):
        with pytest.raises(InvalidValue, match="q.*finite numbers"):
            call()
    for dt in (0.0, -0.01, np.nan):
        with pytest.raises(InvalidValue, match="dt .*above 0"):
            reacher.update(np.zeros(3), dt)
    assert controller.reaches.markers == ("tip",)
