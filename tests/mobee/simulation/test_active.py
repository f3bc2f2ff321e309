# SPDX-License-Identifier: Apache-2.0
"""Motors that are not active: rigid at home, without noise, and for the others as if they were simulated."""

from __future__ import annotations

import gc
import weakref

import numpy as np
import pytest

from mobee import sphere
from mobee.control import Gains
from mobee.errors import InvalidValue, UnknownName
from mobee.model.model import Model
from mobee.model.world_file import load_world
from mobee.robot.load import load_robot
from mobee.simulation import MotorParameters, OfflinePlant
from mobee.simulation.rigid import living, stiffened

QUIET = MotorParameters(encoder_noise=0.0)
JOINTS = ("l_shoulder_pitch", "l_shoulder_roll", "l_shoulder_yaw", "l_elbow")


@pytest.mark.parametrize("name", ["icub", "icub_2014"])
@pytest.mark.parametrize("active", [JOINTS, ("torso",), ("torso", "left_arm"), ("head", "r_*")])
def test_a_stiffened_robot_has_the_forces_of_the_whole_one(name: str, active: tuple[str, ...]) -> None:
    robot = load_robot(name)
    plant = OfflinePlant(Model(robot), active=active)
    alive = np.isin(np.arange(len(robot.motors)), plant.motors.living)
    for keep_parts in (False, True):
        stiff = stiffened(robot, alive, keep_parts)
        assert len(stiff.joints) < len(robot.joints)
        whole, reduced = Model(robot, load_world("table")), Model(stiff, load_world("table"))
        rng = np.random.default_rng(0)
        largest = 0.0
        for _ in range(100):
            q = np.where(alive, rng.uniform(*robot.limits.T), robot.home)
            one, other = whole.evaluate(q), reduced.evaluate(q)
            if keep_parts:
                assert other.projection_of_part[alive] == pytest.approx(
                    one.projection_of_part[alive], rel=1e-6, abs=1e-7
                )  # cylinders meet to 1e-8 m
            else:
                assert other.projection[alive] == pytest.approx(one.projection[alive], rel=1e-6, abs=1e-7)  # cylinders meet to 1e-8 m
            largest = max(largest, float(np.abs(one.projection[alive]).max()))
        assert largest > 0.0


def test_the_rest_of_the_robot_stands_still_and_is_read_without_noise() -> None:
    robot = load_robot("icub")
    plant = OfflinePlant(Model(robot), active=["left_arm"])
    low, high = robot.limits[robot.parts["left_arm"].slice].T
    plant.act("left_arm", low + 0.4 * (high - low))
    still = np.ones(len(robot.motors), dtype=bool)
    still[robot.parts["left_arm"].slice] = False
    trace = plant.run(20)
    assert (trace.encoders[:, still] == robot.home[still]).all()
    assert (trace.encoders[:, ~still].std(axis=0) > 0.0).all()


def test_an_arm_without_noise_moves_as_in_a_whole_robot_without_noise() -> None:
    robot = load_robot("icub")
    low, high = robot.limits[robot.parts["left_arm"].slice].T
    target = low + 0.6 * (high - low)
    found = [OfflinePlant(Model(robot), 0, motors=QUIET, active=active).act("left_arm", target) for active in (None, ("left_arm",))]
    assert found[0].q == pytest.approx(found[1].q, abs=1e-9)
    assert found[0].duration == found[1].duration


def test_objects_that_an_active_arm_carries_cause_forces() -> None:
    robot = load_robot("icub")
    model = Model(robot, load_world("table"))
    plant = OfflinePlant(model, active=["left_arm"])
    model.world.add("tool", sphere(0.05), position=model.evaluate(robot.home).position("left_palm"))
    model.attach("tool", robot.links[robot.marker("left_palm").link], robot.home)
    before = plant.controller.last_forces.collision.copy()
    plant.tick()
    assert before.any() == 0
    assert np.isfinite(plant.controller.last_forces.total).all()


def test_a_pattern_that_means_nothing_is_refused_with_the_nearest_name() -> None:
    with pytest.raises(UnknownName, match="left_arm"):
        OfflinePlant(Model(load_robot("icub")), active=["left_am"])
    with pytest.raises(InvalidValue, match="at least one"):
        OfflinePlant(Model(load_robot("icub")), active=[])


def test_a_part_that_is_not_active_cannot_act() -> None:
    plant = OfflinePlant(Model(load_robot("icub")), active=["left_arm"])
    with pytest.raises(InvalidValue, match="torso cannot act: none of its motors is active"):
        plant.act("torso", np.zeros(3))


def test_plants_of_one_robot_share_the_reduced_robot() -> None:
    robot = load_robot("icub")
    alive = living(robot, ["left_arm"])
    one = stiffened(robot, alive, solids=False)
    assert stiffened(robot, living(robot, ["left_arm"]), solids=False) is one
    assert stiffened(robot, alive) is not one
    assert stiffened(robot, living(robot, ["right_arm"]), solids=False) is not one
    gone = weakref.ref(one)
    del one
    gc.collect()
    assert gone() is None, "nobody keeps it"


@pytest.mark.parametrize("published", [False, True])
def test_a_controller_gives_motors_between_active_ones_no_share_of_the_forces(published: bool) -> None:
    robot, names = load_robot("icub"), ["l_shoulder_pitch", "l_shoulder_yaw", "l_elbow"]
    active = [robot.motor_index(name) for name in names]
    gains = Gains.published_2014() if published else None
    plant = OfflinePlant(Model(robot, load_world("table")), gains=gains, active=names, motors=MotorParameters.ideal())
    rng, touched = np.random.default_rng(1), 0
    low, high = robot.limits[active].T
    for _ in range(40):
        q = robot.home.copy()
        q[active] = low + rng.random(3) * (high - low)
        plant.restart(0, q)
        plant.tick()
        found = plant.controller.forces(plant.model.evaluate(q))
        total = found.limits + found.constraints + found.collision
        np.testing.assert_allclose(found.collision[active], plant.controller.last_forces.collision[active], rtol=1e-9, atol=1e-12)
        assert not total[np.setdiff1d(np.arange(len(q)), active)].any()
        touched += found.collision.any()
    assert touched > 5
