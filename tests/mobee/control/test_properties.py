# SPDX-License-Identifier: Apache-2.0
"""Guaranteed properties of the forces and of the system, for any pose and motion."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mobee.arrays import Array
from mobee.control import Controller, Gains, constraint_forces
from mobee.control.law import largest_step, stack_clauses
from mobee.model.model import Model
from mobee.model.world_file import load_world
from mobee.robot.load import load_robot
from mobee.robot.robot import Robot
from tests.mobee.control.posed_forces import forces_at
from tests.mobee.control.two_parts import touching, two_part_arm

ICUB = load_robot("icub")
AT_TABLE = Model(ICUB, load_world("table"))
SETS = [Gains.default(), Gains.published_2014()]
BOTH = pytest.mark.parametrize("gains", SETS, ids=lambda g: g.law)
seeds = st.integers(0, 2**32 - 1)


def random_pose(seed: int, beyond: float = 0.0) -> Array:
    low, high = ICUB.limits.T
    return np.random.default_rng(seed).uniform(low - beyond, high + beyond)


def satisfied(robot: Robot, q: Array, width: float) -> bool:
    """Whether every clause has a row that is satisfied by the width, along its normal."""
    rows = stack_clauses(robot.clauses, len(q))
    return bool(np.all(np.maximum.reduceat((rows.a @ q + rows.b) / rows.norms, rows.starts) >= width))


@given(seeds)
def test_no_force_outside_the_zones(seed: int) -> None:
    gains = Gains.default()
    q = random_pose(seed)
    forces = forces_at(ICUB, gains, q)
    inside = (q >= ICUB.limits[:, 0] + gains.limit_width) & (q <= ICUB.limits[:, 1] - gains.limit_width)
    assert not forces.limits[inside].any()
    assert not forces.constraints.any() or not satisfied(ICUB, q, gains.constraint_width)
    assert not forces.collision.any()


@given(seeds)
def test_limit_forces_point_inward_and_reach_their_maximum_at_the_limit(seed: int) -> None:
    gains = Gains.default()
    q = random_pose(seed, beyond=0.5)
    force = forces_at(ICUB, gains, q).limits
    middle = ICUB.limits.mean(axis=1)
    assert np.all(force * (middle - q) >= 0)
    assert np.all(np.abs(force)[(q < ICUB.limits[:, 0]) | (q > ICUB.limits[:, 1])] >= gains.max_limit)


@given(seeds, seeds)
def test_limits_and_clauses_push_continuously_with_the_steepness_that_the_bound_of_the_step_counts(seed: int, toward: int) -> None:
    gains = Gains.default()
    q, step = random_pose(seed, 0.5), 1e-6 * np.random.default_rng(toward).normal(size=len(ICUB.motors))
    before, after = forces_at(ICUB, gains, q), forces_at(ICUB, gains, q + step)
    limit, rows = gains.max_limit / gains.limit_width, stack_clauses(ICUB.clauses, len(q))
    clause = gains.max_constraint / gains.constraint_width
    assert np.linalg.norm(after.limits - before.limits) <= 2.001 * limit * np.linalg.norm(step)
    assert np.linalg.norm(after.constraints - before.constraints) <= 1.001 * clause * len(rows.b) * np.linalg.norm(step)


@given(seeds)
def test_a_clause_pushes_toward_where_it_is_satisfied(seed: int) -> None:
    gains = Gains.default()
    clause = ICUB.clauses[seed % len(ICUB.clauses)]
    q = random_pose(seed, 0.5)
    force = forces_at(replace(ICUB, clauses=(clause,)), gains, q).constraints
    nearest = clause.a[int(np.argmax((clause.a @ q + clause.b) / np.linalg.norm(clause.a, axis=1)))]
    assert nearest @ force >= 0.0
    assert nearest @ force > 0.0 or satisfied(replace(ICUB, clauses=(clause,)), q, gains.constraint_width)


def in_contact(seed: int) -> tuple[Model, Array]:
    """A pose of the planar arm with its tip in a ball, at random."""
    rng = np.random.default_rng(seed)
    return touching(-0.05), rng.normal(size=3) * 0.05


@BOTH
@given(seed=seeds)
def test_a_contact_force_moves_out_of_the_contact(gains: Gains, seed: int) -> None:
    model, q = in_contact(seed)
    pose = model.evaluate(q)
    force = constraint_forces(pose, gains).collision
    depth = sum(c.depth for c in pose.contacts if c.kind == "field")
    assert (depth > 0) == bool(force.any())
    if depth > 1e-4:
        after = model.evaluate(q + 1e-4 * depth * force / np.linalg.norm(force))
        assert sum(c.depth for c in after.contacts if c.kind == "field") < depth


@BOTH
@given(seed=seeds)
def test_a_contact_force_does_no_work_on_a_part_that_moves_deeper(gains: Gains, seed: int) -> None:
    rng = np.random.default_rng(seed)
    q = random_pose(seed)
    pose = AT_TABLE.evaluate(q)
    force = constraint_forces(pose, gains).collision
    assert force @ pose.projection >= 0.0
    for part in ICUB.parts.values():
        motion = rng.normal(size=len(part))
        deeper = -float(pose.projection[part.slice] @ motion)
        assert float(force[part.slice] @ motion) * deeper <= 1e-12


def potential(v: Array, maximum: float, slope: float) -> Array:
    """The integral of eq. 5.8 from 0: of L(K e) over e, with v = e and slope K."""
    size, knee = np.abs(v), maximum / slope
    return maximum * (size - knee * np.log1p(size / knee))


def energy(robot: Robot, gains: Gains, q: Array, velocity: Array, attractor: Array) -> float:
    limit = gains.max_limit / gains.limit_width
    beyond = np.maximum(robot.limits[:, 0] + gains.limit_width - q, 0.0) + np.maximum(q - robot.limits[:, 1] + gains.limit_width, 0.0)
    spring = potential(q - attractor, gains.max_spring, gains.stiffness)
    return float(velocity @ velocity / 2.0 + spring.sum() + limit * beyond @ beyond / 2.0)


@BOTH
@given(seed=seeds, share=st.floats(0.01, 0.7))
def test_the_energy_of_the_unforced_system_never_grows(gains: Gains, seed: int, share: float) -> None:
    """The robot with motors so fast that their speed limits have no effect, since these would act as a force from outside."""
    rng = np.random.default_rng(seed)
    arm = two_part_arm()
    strong = tuple(replace(m, max_velocity=1e9, max_acceleration=1e9) for m in arm.motor_table)
    robot = replace(arm, motor_table=strong, shapes=(), field_pairs=arm.field_pairs[:0], solid_pairs=arm.solid_pairs[:0])
    controller = Controller(Model(robot), gains)
    q, dt = rng.uniform(-3.2, 3.2, 3), share * largest_step(robot, gains)
    controller.reset(q)
    controller.attractor = goal = rng.uniform(-3.2, 3.2, 3)
    before = energy(robot, gains, q, np.zeros(3), goal)
    for _ in range(60):
        velocity = controller.step(q, dt).velocity
        q = q + dt * velocity
        after = energy(robot, gains, q, velocity, goal)
        assert after <= before * (1.0 + 1e-9) + 1e-12
        before = after
