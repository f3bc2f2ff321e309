# SPDX-License-Identifier: Apache-2.0
"""The compiled reach law against the Jacobian of the model and against its specification."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mobee.arrays import Array
from mobee.control import Controller, Gains, Settle
from mobee.errors import InvalidValue, UnknownName
from mobee.model.model import Model
from mobee.reach import ReachTarget
from mobee.reference import reach
from mobee.reference.forces import State
from mobee.robot.load import load_robot
from mobee.robot.motor_units import motor_units
from mobee.robot.robot import Part, Robot
from mobee.simulation import MotorParameters, OfflinePlant
from tests.mobee.control.two_parts import two_part_arm
from tests.mobee.planar import planar_arm, tree

ICUB = load_robot("icub_2014")
PUBLISHED = Gains.published_2014()
SEEDS = st.integers(0, 2**32 - 1)
BOTH = pytest.mark.parametrize("gains", [Gains.default(), PUBLISHED], ids=lambda g: g.law)


def poses(robot: Robot, seed: int, count: int = 3) -> Array:
    return np.random.default_rng(seed).uniform(*robot.limits.T, size=(count, len(robot.motors)))


def constraint_force(controller: Controller, q: Array) -> Array:
    """What the reaches add to the acceleration at q, their attractor, (n,) rad/s^2."""
    total = np.zeros(len(q))
    controller.reaches.add_forces(q, q, 0.01, total)
    return total


@given(seed=SEEDS)
def test_marker_and_columns_are_those_of_the_model_for_any_tree(seed: int) -> None:
    """With sliding joints, joints that two motors drive, and motors that drive two joints; ticks that move only some of them."""
    robot, rng = tree(seed), np.random.default_rng(seed)
    model = Model(robot)
    q = robot.home.copy()
    for link in rng.permutation(len(robot.links))[:3]:
        marker = f"marker{link}"
        moving = np.abs(model.jacobian(poses(robot, seed, 1)[0], marker)).max(axis=0) > 0.0
        controller = Controller(model)
        if not moving.any():
            with pytest.raises(InvalidValue, match="none of the motors"):
                controller.reach_toward("body", marker, ReachTarget(np.zeros(3)))
            continue
        controller.reach_toward("body", marker, ReachTarget(rng.normal(size=3), normal=rng.normal(size=3)))
        for _ in range(4):
            some = rng.random(len(q)) < 0.4
            q[some] = poses(robot, int(rng.integers(2**32)), 1)[0][some]
            controller.step(q, 1e-3)
            found = controller.reaches["body"]
            columns = np.zeros((6, len(q)))
            columns[:, found.motors["motor"]] = found.motors["column"].T
            pose = model.evaluate(q)
            assert list(found.struct.marker_position) == pytest.approx(pose.position(marker), abs=1e-12)
            assert list(found.struct.marker_normal) == pytest.approx(pose.normal(marker), abs=1e-12)
            assert columns == pytest.approx(model.jacobian(q, marker) * motor_units(robot), abs=1e-12)


@BOTH
@given(seed=SEEDS)
def test_data_cached_between_ticks_change_no_bit(gains: Gains, seed: int) -> None:
    """Of joints that rest: a law that has just begun says the same.  (The default law's smoothed error is another thing.)"""
    rng = np.random.default_rng(seed)
    model, q = Model(ICUB), ICUB.home.copy()
    target = ReachTarget(rng.uniform(-0.4, 0.4, 3), normal=rng.normal(size=3))
    old = Controller(model, gains)
    old.reach_toward("right_arm", "right_palm", target)
    for new in poses(ICUB, seed, 5):
        some = rng.random(len(q)) < 0.1
        q[some] = new[some]
        old.step(q, 0.01)
        fresh = Controller(model, gains)
        fresh.reach_toward("right_arm", "right_palm", target)
        fresh.step(q, 0.01)
        one, other = old.reaches["right_arm"], fresh.reaches["right_arm"]
        for name in ("marker_position", "marker_normal", "error"):
            assert list(getattr(one.struct, name)) == list(getattr(other.struct, name))
        assert one.struct.distance == other.struct.distance
        for name in ("column", "descent"):
            assert np.array_equal(one.motors[name], other.motors[name])


@BOTH
def test_only_the_parts_own_motors_are_pulled(gains: Gains) -> None:
    controller = Controller(Model(ICUB), gains)
    controller.reach_toward("right_arm", "right_palm", ReachTarget((-0.3, 0.1, 0.1)))
    added = constraint_force(controller, ICUB.home)
    moved = {ICUB.motors[i] for i in np.flatnonzero(added)}
    assert moved and moved <= set(ICUB.part("right_arm").motors[:7])


@BOTH
def test_parts_reach_side_by_side_as_each_alone(gains: Gains) -> None:
    targets = {"right_arm": ReachTarget((-0.3, 0.1, 0.1)), "left_arm": ReachTarget((-0.3, -0.1, 0.2), aim="surface")}
    both, total = Controller(Model(ICUB), gains), np.zeros(len(ICUB.motors))
    for part, target in targets.items():
        alone = Controller(Model(ICUB), gains)
        for one in (alone, both):
            one.reach_toward(part, part.split("_")[0] + "_palm", target)
        total += constraint_force(alone, ICUB.home)
    assert constraint_force(both, ICUB.home) == pytest.approx(total, abs=1e-9)
    both.end_reach("right_arm")
    assert not constraint_force(both, ICUB.home)[ICUB.part("right_arm").slice].any()
    both.end_reach("left_arm")
    assert not constraint_force(both, ICUB.home).any()


def test_a_reach_keeps_its_state_when_the_forces_of_clients_end() -> None:
    controller = Controller(Model(ICUB), Gains.default())
    controller.reach_toward("right_arm", "right_palm", ReachTarget((-3.0, 0.1, 0.1)))
    controller.step(ICUB.home, 0.01)
    assert controller.is_approaching("right_arm")
    for _ in range(100):  # the arm does not move
        controller.force(np.zeros(len(ICUB.motors)))
        controller.clear()
        controller.step(ICUB.home, 0.01)
    assert not controller.is_approaching("right_arm")
    assert constraint_force(controller, ICUB.home).any()


def test_inside_the_surface_nothing_pulls() -> None:
    model = Model(ICUB)
    palm = model.evaluate(ICUB.home).position("right_palm")
    controller = Controller(model, PUBLISHED)
    controller.reach_toward("right_arm", "right_palm", ReachTarget(palm + 0.02, 0.1, "surface"))
    assert not constraint_force(controller, ICUB.home).any()
    controller.reach_toward("right_arm", "right_palm", ReachTarget(palm + 0.02, 0.01, "surface"))
    assert constraint_force(controller, ICUB.home).any()


def test_a_part_that_does_not_move_the_marker_cannot_reach_with_it() -> None:
    controller = Controller(Model(ICUB))
    with pytest.raises(InvalidValue, match="left_arm cannot reach with right_palm on r_hand"):
        controller.reach_toward("left_arm", "right_palm", ReachTarget(np.zeros(3)))
    with pytest.raises(UnknownName, match="Did you mean 'right_palm'"):
        controller.reach_toward("right_arm", "right_plam", ReachTarget(np.zeros(3)))
    with pytest.raises(InvalidValue, match="none of the motors"):
        Controller(Model(ICUB), PUBLISHED.with_motors("r_*", weight=0)).reach_toward("right_arm", "right_palm", ReachTarget(np.zeros(3)))


def test_the_published_reach_rests_where_pull_and_spring_are_equal() -> None:
    long = replace(PUBLISHED, settle=Settle(speed=1e-5, acceleration=1e-4))
    plant = OfflinePlant(Model(two_part_arm()), gains=long, motors=MotorParameters.ideal())
    plant.act("arm", np.array([0.6, 0.8]))
    target = ReachTarget(plant.model.evaluate(np.array([0.0, 0.5, 1.1])).position("tip"), 0.01)
    plant.present(target)
    outcome = plant.reach("arm", "tip")
    q = np.concatenate([[0.0], outcome.q])
    error = np.array([0.6, 0.8]) - outcome.q
    spring = long.max_spring * error / (long.max_spring / long.stiffness + np.abs(error))
    assert outcome.settled and 0.01 < outcome.missing < 0.1
    pull = reach.begin(plant.robot, long, "arm", "tip", target)
    assert reach.reach_force(pull, State(plant.robot, long, q, 0.0 * q, q), 0.01, 0.0 * q)[1:] == pytest.approx(-spring, abs=1e-3)


@given(seed=SEEDS)
def test_reaches_that_pull_the_same_motors_cancel_each_spring_once(seed: int) -> None:
    """Of the whole body and of an arm."""
    q, attractor = poses(ICUB, seed, 2)
    law, totals = Gains.default(), []
    for goal in (q, attractor):
        controller = Controller(Model(ICUB), law)
        for part in (None, "left_arm"):
            controller.reach_toward(part, "left_palm", ReachTarget((-0.3, -0.1, 0.1)))
        total = np.zeros(len(q))
        controller.reaches.add_forces(q, goal, 0.01, total)
        totals.append(total)
    error = attractor - q
    most, stiffness = (law.of_robot(name, ICUB) for name in ("max_spring", "stiffness"))
    spring = most * error / (most / stiffness + np.abs(error))
    spring[np.setdiff1d(np.arange(len(q)), controller.reaches[None].motors["motor"])] = 0.0
    assert totals[1] - totals[0] == pytest.approx(-spring, abs=1e-9)


def one_part(robot: Robot) -> Model:
    return Model(replace(robot, parts={"arm": Part("arm", robot.motors, 0)}))


@pytest.mark.parametrize("dt", [0.01, 0.02])
@pytest.mark.parametrize("seed", range(4))
def test_the_default_reach_ends_at_a_free_target(seed: int, dt: float) -> None:
    """Within 2 mm, as the motors' joint sides are; and it does not swing there."""
    model = one_part(planar_arm())
    rng = np.random.default_rng(seed)
    plant = OfflinePlant(model, seed, dt=dt, contact_forces=False)
    plant.act("arm", rng.uniform([-1.0, 0.4, 0.4], [1.0, 1.5, 1.5]))
    plant.present(ReachTarget(model.evaluate(rng.uniform([-1.0, 0.4, 0.4], [1.0, 1.5, 1.5])).position("tip")))
    plant.begin_reach("arm", "tip")
    outcome = None
    while plant.reaching:
        before = plant.motors.q
        plant.tick()
    outcome = model.evaluate(before).position("tip")
    assert np.linalg.norm(outcome - plant.model.world.objects["reach_target"].position) < 2e-3
    assert np.abs(plant.motors.velocities).max() < np.deg2rad(3.0)


def test_the_default_reach_leaves_the_singular_pose_of_a_stretched_arm() -> None:
    """J^T f is zero there: the target is on the line of the arm."""
    plant = OfflinePlant(one_part(planar_arm()), contact_forces=False, motors=MotorParameters.ideal())
    plant.present(ReachTarget((0.6, 0.0, 0.0)))
    outcome = plant.reach("arm", "tip")
    assert outcome.settled and outcome.missing < 2e-3
    assert plant.measure("arm") == pytest.approx(np.zeros(3), abs=0.02)


def test_a_target_out_of_reach_ends_as_near_as_the_arm_can() -> None:
    plant = OfflinePlant(one_part(planar_arm()), contact_forces=False)
    plant.act("arm", np.array([0.5, 0.6, 0.7]))
    plant.present(ReachTarget((1.2, 0.3, 0.0)))
    outcome = plant.reach("arm", "tip")
    assert outcome.missing == pytest.approx(np.hypot(1.2, 0.3) - 0.9, abs=0.01)
    assert outcome.duration < 40.0


def test_a_motor_at_its_limit_does_not_block_the_others() -> None:
    """Least motion would turn the first joint beyond its limit."""
    free = planar_arm()
    first = replace(free.motor_table[0], limits=np.array([-0.5, 0.5]))
    model = one_part(replace(free, motor_table=(first, *free.motor_table[1:])))
    plant = OfflinePlant(model, contact_forces=False)
    plant.act("arm", np.array([0.3, 0.6, 0.6]))
    plant.present(ReachTarget(model.evaluate(np.array([0.25, 1.6, 0.7])).position("tip")))
    outcome = plant.reach("arm", "tip")
    assert outcome.missing < 4e-3 and outcome.q[0] < 0.45
