# SPDX-License-Identifier: Apache-2.0
"""The sum of the forces and its steps: the controller moves as the definition, and a user-defined force is added to the others."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mobee.arrays import Array
from mobee.control import Controller, Gains
from mobee.model.model import Model
from mobee.model.world_file import load_world
from mobee.reference.forces import State
from mobee.reference.law import TERMS, acceleration, at_rest, hold, is_settled, step, torque
from mobee.robot.load import load_robot
from tests.mobee.control.two_parts import two_part_arm
from tests.mobee.reference.drawn import apart, drawn_gains, drawn_pose, drawn_robot

SEEDS = st.integers(0, 2**32 - 1)
BOTH = pytest.mark.parametrize("gains", [Gains.default(), Gains.published_2014()], ids=lambda g: g.law)
MODALITIES: tuple[Any, ...] = ("position", "velocity", "torque")
# The compiled law adds the forces in another order.  An acceleration is a difference of velocities over dt, 1 ms at least.
ROUNDING, OF_ACCELERATIONS = 1e-12, 1e-10


@given(SEEDS)
def test_the_controllers_motion_is_this(seed: int) -> None:
    """For any robot, modality and client commands; one part is put in hold during the motion."""
    rng = np.random.default_rng(seed)
    robot, gains = drawn_robot(rng), drawn_gains(rng)
    scale = float(rng.uniform(0.1, 1.0))
    controller = Controller(Model(robot), gains, MODALITIES[rng.integers(3)], speed_scale=scale)
    q = drawn_pose(rng, robot)
    dt = float(min(rng.uniform(0.001, 0.02), 0.9 * controller.max_dt))
    controller.reset(q)
    motion, goal = at_rest(robot, gains, q), q
    force: Array | None = None
    pushes: dict[str, Array] = {}
    moving: Array | None = None
    for tick in range(12):
        if tick % 4 == 1:
            controller.attractor = goal = drawn_pose(rng, robot)
            moving = None
            force, pushes = rng.normal(size=len(q)) * 10.0, {"marker7": rng.normal(size=6)}
            controller.force(force)
            controller.push("marker7", pushes["marker7"])
        if tick == 6:
            controller.hold("one", q[robot.part("one").slice])
            motion, goal = hold(robot, motion, "one"), controller.attractor
        if tick in (3, 7):
            controller.attractor = goal = drawn_pose(rng, robot)
            moving = rng.normal(size=len(q))
            for name, part in robot.parts.items():
                controller.follow(name, goal[part.slice], moving[part.slice])
        state = State(robot, gains, q, motion.velocity, goal, force=force, pushes=pushes, goal_velocity=moving)
        motion = step(robot, gains, motion, q, acceleration(state), dt, scale)
        command = controller.step(q, dt)
        assert apart(command.velocity, motion.velocity) < ROUNDING
        assert apart(command.position, motion.reference) < ROUNDING
        assert apart(controller.acceleration, motion.acceleration) < OF_ACCELERATIONS
        if controller.modality == "torque":
            assert apart(command.torque, torque(robot, motion, q)) < OF_ACCELERATIONS
        q = q + command.velocity * dt + 1e-3 * rng.normal(size=len(q))


@BOTH
def test_a_humanoid_at_the_table_moves_like_this(gains: Gains, rng: np.random.Generator) -> None:
    model = Model(load_robot("icub"), load_world("table"))
    robot, controller, touched = model.robot, Controller(model, gains, "torque"), 0
    q = rng.uniform(*robot.limits.T)
    controller.reset(q)
    motion = at_rest(robot, gains, q)
    for _ in range(20):
        controller.attractor = goal = rng.uniform(*robot.limits.T)
        pose = model.evaluate(q)
        motion = step(robot, gains, motion, q, acceleration(State(robot, gains, q, motion.velocity, goal, pose.contacts)), 0.01)
        command = controller.step(q, 0.01)
        assert apart(command.velocity, motion.velocity) < ROUNDING
        assert apart(command.torque, torque(robot, motion, q)) < OF_ACCELERATIONS
        touched += controller.last_forces.collision.any()
        q = q + 0.01 * command.velocity + 1e-3 * rng.normal(size=len(q))
    assert touched > 10


@given(SEEDS)
def test_commands_keep_the_motors_limits_and_motors_without_weight_rest(seed: int) -> None:
    rng = np.random.default_rng(seed)
    robot, gains = drawn_robot(rng), drawn_gains(rng).with_motors("m2", weight=0)
    q, n = drawn_pose(rng, robot, 0.0), len(robot.motors)
    fastest, hardest = (np.array([getattr(m, name) for m in robot.motor_table]) for name in ("max_velocity", "max_acceleration"))
    motion = at_rest(robot, gains, q)
    for _ in range(10):
        after = step(robot, gains, motion, q, rng.normal(size=n) * 100.0, 0.01)
        assert np.all(np.abs(after.velocity) < fastest)
        assert np.all(np.abs(after.sent - motion.sent) < hardest * 0.01 + 1e-15)
        assert np.all((after.reference >= robot.limits[:, 0]) & (after.reference <= robot.limits[:, 1]))
        motion = after
    assert motion.velocity[2] == 0.0 and motion.reference[2] == q[2]
    assert motion.velocity.any()


def test_a_part_is_settled_when_none_of_its_motors_is_fast_or_accelerated() -> None:
    robot, gains = two_part_arm(), Gains.default()
    still = at_rest(robot, gains, np.zeros(3))
    assert is_settled(robot, gains, still, "arm")
    for name, most in (("velocity", gains.settle.speed), ("acceleration", gains.settle.acceleration)):
        moving = replace(still, **{name: np.array([0.0, 0.0, 1.01 * most])})
        assert not is_settled(robot, gains, moving, "arm") and is_settled(robot, gains, moving, "trunk")


def test_a_force_of_ones_own_is_one_more_in_the_list() -> None:
    robot, gains = two_part_arm(), Gains.default()
    state = State(robot, gains, np.array([0.1, 0.2, 0.3]), np.array([0.5, 0.0, -0.5]), np.zeros(3))

    def viscous(s: State) -> Array:
        return -10.0 * s.velocity

    assert acceleration(state, (*TERMS, viscous)) - acceleration(state) == pytest.approx([-5.0, 0.0, 5.0])
    assert acceleration(state, ()).tolist() == [0.0] * 3
