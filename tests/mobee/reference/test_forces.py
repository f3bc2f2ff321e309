# SPDX-License-Identifier: Apache-2.0
"""The forces of the definition: the guaranteed properties of each, and equality with the forces of the controller."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import mobee
from mobee.arrays import Array
from mobee.control import Gains
from mobee.model.model import Model
from mobee.model.world_file import load_world
from mobee.reference.forces import (
    State,
    bounded_client,
    bounded_contact,
    clause_force,
    config_force,
    contact_force,
    damping,
    limit_force,
    projected,
    spring,
    squash,
    squash_norm,
    work_force,
)
from mobee.robot.load import load_robot
from mobee.robot.robot import LEVER, Clause, Robot
from tests.mobee.control.posed_forces import forces_at
from tests.mobee.control.two_parts import STRETCHED, touching
from tests.mobee.planar import planar_arm
from tests.mobee.reference.drawn import apart, drawn_gains, drawn_pose, drawn_robot

SEEDS = st.integers(0, 2**32 - 1)
SIZES = st.floats(0.1, 100.0)
BOTH = pytest.mark.parametrize("gains", [Gains.default(), Gains.published_2014()], ids=lambda g: g.law)
# The compiled law adds the same numbers in another order, and a norm or a row of a clause has at most a few dozen of them.
ROUNDING = 1e-12
WIDTH, MAXIMUM = 0.2, 30.0


def at(robot: Robot, gains: Gains, q: Array, **more: Any) -> State:
    return State(robot, gains, q, np.zeros(len(q)), q, **more)


@given(st.lists(st.floats(-1e4, 1e4), min_size=1, max_size=6).map(np.array), SIZES, SIZES)
def test_a_squashed_vector_stays_below_its_maximum_and_keeps_sign_or_direction(v: Array, m: float, k: float) -> None:
    each, whole = squash(v, m, k), squash_norm(v, m, k)
    assert np.all(np.abs(each) < m) and np.all(each * v >= 0.0)
    assert np.linalg.norm(whole) < m
    assert np.linalg.norm(whole) * v == pytest.approx(np.linalg.norm(v) * whole, rel=1e-9, abs=1e-9)


@given(SIZES, SIZES)
def test_the_slope_of_the_squash_at_zero_is_k_and_far_out_its_maximum_is_reached(m: float, k: float) -> None:
    tiny = np.array([1e-7 * m / k])
    assert squash(tiny, m, k) == pytest.approx(k * tiny, rel=1e-5)
    assert squash(1e14 * tiny, m, k) == pytest.approx(m, rel=1e-5)


@given(SEEDS)
def test_limits_push_inward_continuously_and_are_silent_in_the_middle(seed: int) -> None:
    rng = np.random.default_rng(seed)
    robot, gains = drawn_robot(rng), drawn_gains(rng)
    q, step = drawn_pose(rng, robot, 0.5), 1e-7 * rng.normal(size=len(robot.motors))
    force, (low, high) = limit_force(at(robot, gains, q)), robot.limits.T
    assert np.all(force * (0.5 * (low + high) - q) >= 0.0)
    assert not limit_force(at(robot, gains, 0.5 * (low + high))).any()
    slope = gains.of_robot("max_limit", robot) / gains.of_robot("limit_width", robot)
    assert np.all(np.abs(limit_force(at(robot, gains, q + step)) - force) <= 1.001 * slope * np.abs(step) + 1e-9 * slope)


@pytest.mark.parametrize(("depth", "share"), [(-WIDTH, 0.0), (-WIDTH / 2, 0.5), (0.0, 1.0), (WIDTH, 2.0)])
def test_a_clause_pushes_along_its_normal_to_the_maximum_at_the_boundary_and_beyond(depth: float, share: float) -> None:
    normal = np.array([1.0, -1.0, 0.0]) / np.sqrt(2.0)
    robot = replace(planar_arm(), clauses=(Clause("arm", 1.71 * np.sqrt(2.0) * normal[None], np.array([0.5])),))
    gains = replace(Gains.default(), constraint_width=WIDTH, max_constraint=MAXIMUM)
    q = -normal * (0.5 / (1.71 * np.sqrt(2.0)) + depth)
    assert clause_force(at(robot, gains, q)) == pytest.approx(share * MAXIMUM * normal, abs=1e-9)


@given(SEEDS)
def test_clauses_are_silent_where_all_hold_with_margin_and_continuous(seed: int) -> None:
    rng = np.random.default_rng(seed)
    robot, gains = planar_arm(), replace(Gains.default(), constraint_width=WIDTH, max_constraint=MAXIMUM)
    clauses = tuple(Clause("arm", rng.normal(size=(rows, 3)), rng.normal(size=rows)) for rows in (1, 2, 3))
    robot, q, step = replace(robot, clauses=clauses), rng.uniform(-2.0, 2.0, 3), 1e-7 * rng.normal(size=3)
    force = clause_force(at(robot, gains, q))
    margins = [((c.a @ q + c.b) / np.linalg.norm(c.a, axis=1)).max() for c in clauses]
    assert force.any() == (min(margins) < WIDTH)
    steepest = MAXIMUM / WIDTH * sum(map(len, (c.b for c in clauses)))
    assert np.linalg.norm(clause_force(at(robot, gains, q + step)) - force) <= steepest * np.linalg.norm(step)


@BOTH
def test_a_contact_pushes_the_tip_out(gains: Gains) -> None:
    model = touching(-0.02)
    pose = model.evaluate(STRETCHED)
    force = contact_force(at(model.robot, gains, STRETCHED, contacts=pose.contacts))
    (before,), (after,) = pose.contacts, model.evaluate(STRETCHED + 1e-3 * force / np.linalg.norm(force)).contacts
    assert after.depth < before.depth
    cut = contact_force(at(model.robot, gains, STRETCHED, contacts=pose.contacts, propagate="part"))
    assert cut[0] == 0.0 and cut[1] * force[1] > 0.0


@given(SEEDS)
def test_a_clients_force_keeps_its_direction_in_each_part_where_the_gains_say_so(seed: int) -> None:
    rng = np.random.default_rng(seed)
    robot = drawn_robot(rng)
    gains = replace(drawn_gains(rng), client_squash="direction")
    f = rng.normal(size=len(robot.motors)) * 10.0 ** rng.uniform(-2, 3)
    bounded, most = bounded_client(robot, gains, f), gains.of_robot("max_client", robot)
    assert np.all(np.abs(bounded) < most)
    for part in robot.parts.values():
        assert bounded[part.slice] * f[part.start] == pytest.approx(f[part.slice] * bounded[part.start], rel=1e-9)


@given(SEEDS)
def test_the_controllers_forces_are_these(seed: int) -> None:
    rng = np.random.default_rng(seed)
    robot, gains = drawn_robot(rng), drawn_gains(rng)
    q, torque = drawn_pose(rng, robot), rng.normal(size=len(robot.motors)) * 10.0 ** rng.uniform(-6, 1)
    found = forces_at(robot, gains, q, torque)
    assert apart(found.limits, limit_force(at(robot, gains, q))) < ROUNDING
    assert apart(found.constraints, clause_force(at(robot, gains, q))) < ROUNDING
    assert apart(found.collision, bounded_contact(robot, gains, torque)) < ROUNDING


@BOTH
@pytest.mark.parametrize("name", ["icub", "icub_2014"])
def test_a_humanoids_forces_at_the_table_are_these(name: str, gains: Gains, rng: np.random.Generator) -> None:
    model, touched = Model(load_robot(name), load_world("table")), 0
    robot = model.robot
    for propagate in ("tree", "part"):
        controller = mobee.Controller(model, gains, propagate=propagate)
        for q in rng.uniform(*robot.limits.T, (10, len(robot.motors))):
            pose = model.evaluate(q)
            found, state = controller.forces(pose), at(robot, gains, q, contacts=pose.contacts, propagate=propagate)
            assert apart(found.limits, limit_force(state)) < ROUNDING
            assert apart(found.constraints, clause_force(state)) < ROUNDING
            assert apart(found.collision, contact_force(state)) < ROUNDING
            touched += found.collision.any()
    assert touched > 10


@given(SEEDS)
def test_the_controllers_acceleration_is_spring_damping_and_client(seed: int) -> None:
    """Of a robot without limits, clauses and contacts that act; from rest the first step shows the sum."""
    rng = np.random.default_rng(seed)
    robot, gains = replace(drawn_robot(rng), clauses=()), drawn_gains(rng)
    fast = [replace(m, limits=np.array([-1e3, 1e3]), max_velocity=1e9, max_acceleration=1e9) for m in robot.motor_table]
    robot = replace(robot, motor_table=tuple(fast))
    model, n = Model(robot), len(robot.motors)
    controller = mobee.Controller(model, gains)
    q, goal, f = rng.uniform(-2.0, 2.0, (3, n)) * [[1.0], [1.0], [100.0]]
    pushes = {f"marker{link}": rng.normal(size=size) for link, size in ((5, 3), (12, 6))}
    controller.reset(q)
    controller.attractor = goal
    controller.force(f)
    for marker, push in pushes.items():
        controller.push(marker, push)
    state, dt = State(robot, gains, q, np.zeros(n), goal, force=f, pushes=pushes), 0.001
    for _ in range(2):
        controller.step(q, dt)
        expected = spring(state) + damping(state) + config_force(state) + work_force(state)
        moved = gains.weight(robot.motors) > 0
        assert apart(controller.acceleration, np.where(moved, expected, 0.0)) < 1e-11  # a difference of velocities, over dt
        state = replace(state, velocity=controller.velocity)


def test_contacts_with_a_least_lever_push_as_defined(rng: np.random.Generator) -> None:
    robot = replace(load_robot("icub"), least_lever=0.03)
    model, touched = Model(robot, load_world("table")), 0
    for q in rng.uniform(*robot.limits.T, (15, len(robot.motors))):
        pose = model.evaluate(q)
        expected = projected(robot, q, pose.contacts)
        assert apart(pose.projection, expected) < ROUNDING
        touched += expected.any()
    assert touched > 10


def test_with_a_least_lever_the_push_undoes_a_contact_by_the_smallest_motion() -> None:
    robot = replace(planar_arm(), least_lever=1e-6)
    q = np.array([0.0, 0.3, 2.6])  # the fields of the tip and of the first link overlap
    (contact,) = (one for one in Model(robot).evaluate(q).contacts if one.kind == "field")
    motion = Model(robot).evaluate(q).projection / LEVER**2
    (after,) = (one for one in Model(robot).evaluate(q + 0.01 * motion).contacts if one.kind == "field")
    assert contact.depth - after.depth == pytest.approx(0.01 * contact.depth, rel=0.02)
    slope = np.array([Model(robot).evaluate(q + 1e-6 * axis).contacts[-1].depth - contact.depth for axis in np.eye(3)]) / 1e-6
    assert motion == pytest.approx(-contact.depth * slope / (slope @ slope), rel=1e-3, abs=1e-6)


def test_solids_make_no_force() -> None:
    model = touching(-0.02)
    contacts = [replace(contact, kind="solid") for contact in model.evaluate(STRETCHED).contacts]
    assert contacts and not projected(model.robot, STRETCHED, contacts).any()
