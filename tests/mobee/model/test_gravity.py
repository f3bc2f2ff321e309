# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import importlib.util
from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mobee.arrays import Array
from mobee.errors import InvalidValue
from mobee.model.masses import EARTH, gravity_torque, potential_energy
from mobee.robot.load import load_robot
from mobee.robot.robot import Robot
from tests.mobee.model.kinematics_oracle import Pinocchio
from tests.mobee.robot.test_write_xml import random_robot
from tests.mobee.robot.urdf_files import foreign

ICUB = load_robot("icub")
STEP = 1e-6


def in_pinocchio(robot: Robot, q: Array, gravity: Array) -> Array:
    """The same from pinocchio, which adds up the weights link by link."""
    twin = Pinocchio(robot)
    for body in robot.bodies:
        inertia = pinocchio.Inertia(body.mass, body.centre - twin.origins[body.link], np.eye(3))
        twin.model.appendBodyToJoint(twin.ids[body.link], inertia, pinocchio.SE3.Identity())
    twin.model.gravity.linear = gravity
    data = twin.model.createData()
    torque = pinocchio.computeGeneralizedGravity(twin.model, data, twin.configuration(q))
    return torque[twin.columns] @ robot.coupling[0]


@pytest.mark.parametrize("gravity", [EARTH, (1.0, -2.0, 3.0)])
def test_the_icubs_torques_are_those_of_pinocchio(rng: np.random.Generator, gravity: tuple[float, float, float]) -> None:
    for q in rng.uniform(*ICUB.limits.T, (20, 41)):
        np.testing.assert_allclose(gravity_torque(ICUB, q, gravity), in_pinocchio(ICUB, q, np.array(gravity)), atol=1e-10)


@pytest.mark.parametrize("name", ["franka_panda/panda.urdf", "xarm/xarm6_with_gripper.urdf", "kuka_iiwa/model.urdf"])
def test_a_urdfs_torques_are_those_that_pinocchio_reads_from_the_file(rng: np.random.Generator, name: str) -> None:
    robot, model = load_robot(foreign(name)), pinocchio.buildModelFromUrdf(str(foreign(name)))
    data = model.createData()
    matrix, offset = robot.coupling
    columns = [model.joints[model.getJointId(joint.name)].idx_q for joint in robot.joints]
    for q in rng.uniform(*robot.limits.T, (10, len(robot.motors))):
        angles = np.zeros(model.nq)
        angles[columns] = matrix @ q + offset
        expected = pinocchio.computeGeneralizedGravity(model, data, angles)[columns] @ matrix
        np.testing.assert_allclose(gravity_torque(robot, q), expected, atol=1e-6)


@settings(max_examples=50)
@given(st.integers(0, 2**32 - 200))
def test_of_any_robot_it_is_the_slope_of_the_potential_energy(seed: int) -> None:
    robot = random_robot(seed, 1.0)
    q = np.random.default_rng(seed).uniform(*robot.limits.T)
    steps = STEP * np.eye(len(q))
    slope = (potential_energy(robot, q + steps) - potential_energy(robot, q - steps)) / (2 * STEP)
    np.testing.assert_allclose(gravity_torque(robot, q), slope, atol=1e-5)


def test_poses_one_by_one_and_all_at_once_give_the_same(rng: np.random.Generator) -> None:
    q = rng.uniform(*ICUB.limits.T, (2, 3, 41))
    torques, energies = gravity_torque(ICUB, q), potential_energy(ICUB, q)
    assert torques.shape == (2, 3, 41) and energies.shape == (2, 3)
    for k in np.ndindex(2, 3):
        np.testing.assert_allclose(torques[k], gravity_torque(ICUB, q[k]), atol=1e-12)
        assert energies[k] == pytest.approx(float(potential_energy(ICUB, q[k])))


def test_lifting_a_kilogram_takes_its_weight() -> None:
    slide = next(robot for robot in map(load_robot, [foreign("pr2_gripper.urdf")]))
    energy = potential_energy(slide, slide.home)
    raised = replace(slide, bodies=tuple(replace(body, centre=body.centre + [0.0, 0.0, 1.0]) for body in slide.bodies))
    assert potential_energy(raised, slide.home) - energy == pytest.approx(9.81 * sum(body.mass for body in slide.bodies))


def test_a_robot_without_masses_weighs_nothing() -> None:
    katana = load_robot("katana")
    assert not gravity_torque(katana, katana.home).any()
    assert potential_energy(katana, katana.home) == 0.0


def test_a_q_of_the_wrong_length_is_refused() -> None:
    with pytest.raises(InvalidValue, match=r"q of shape \(3,\): must be \(\.\.\., 41\)"):
        gravity_torque(ICUB, np.zeros(3))


@pytest.mark.skipif(importlib.util.find_spec("pybullet") is None, reason="PyBullet has no wheel for this Python")
def test_the_icubs_weight_is_that_of_the_simulated_robot(tmp_path: Path, rng: np.random.Generator) -> None:
    from mobee.robot.icub_urdf import write_upper_body_urdf

    model = pinocchio.buildModelFromUrdf(str(write_upper_body_urdf(tmp_path / "icub.urdf")))
    data, motors = model.createData(), [ICUB.motor_index(name) for name in model.names[1:]]
    for q in rng.uniform(*ICUB.limits.T, (20, 41)):
        expected = pinocchio.computeGeneralizedGravity(model, data, q[motors])
        np.testing.assert_allclose(gravity_torque(ICUB, q)[motors], expected, atol=3e-3)  # palms: 0.1 g more; axes to six digits
