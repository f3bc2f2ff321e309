# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mobee.arrays import Array
from mobee.control import Gains
from mobee.derivation.separation import LIMIT_GAP, SHALLOW, with_cuts
from mobee.model.model import Model
from mobee.robot.robot import Robot, Shape
from tests.mobee.planar import planar_arm

POSES = 2000


def arm_beside_a_wall(distance: float) -> Robot:
    """The planar arm without fields; a wall on its base, at y = `distance`, that its second and third link may touch."""
    robot = planar_arm()
    wall = Shape("wall", 0, "box", (2.0, 0.1, 0.2), np.array([0.0, distance + 0.05, 0.0]), np.eye(3), "solid", "arm")
    shapes = (*robot.shapes, wall)
    number = {shape.name: index for index, shape in enumerate(shapes)}
    pairs = np.array([[number["wall"], number["segment1"]], [number["wall"], number["segment2"]]])
    return replace(robot, shapes=shapes, solid_pairs=pairs, field_pairs=pairs[:0])


def touching(robot: Robot, poses: Array) -> float:
    """Return the share of the poses in which solids touch by more than SHALLOW."""
    table = Model(robot).evaluate(poses).table
    return len(np.unique(table.pose[table.depth > SHALLOW])) / len(poses)


@pytest.mark.parametrize("distance", [0.4, 0.6])
def test_hardly_a_position_within_limits_and_clauses_touches(distance: float, rng: np.random.Generator) -> None:
    robot = arm_beside_a_wall(distance)
    cut, narrowed, left = with_cuts(robot, robot.solid_pairs, 0)
    assert bool(cut.clauses) == (distance == 0.4)
    assert {robot.motors[k] for k in np.flatnonzero((cut.limits != robot.limits).any(axis=1))} == set(narrowed) != set()
    poses = rng.uniform(*cut.limits.T, (POSES, 3))
    held = np.all([np.ones(POSES, dtype=bool), *((poses @ clause.a[0] + clause.b[0] > 0.0) for clause in cut.clauses)], axis=0)
    assert held.mean() > 0.3 and not len(left)
    before = touching(robot, rng.uniform(*robot.limits.T, (POSES, 3)))
    assert touching(cut, poses[held]) < 0.25 * before > 0.02  # positions are drawn, so that a few between them are overlooked


def test_clauses_do_not_push_at_home_and_limits_stay_away_from_it() -> None:
    robot = arm_beside_a_wall(0.25)
    cut, _, _ = with_cuts(robot, robot.solid_pairs, 0)
    assert (cut.home == robot.home).all()
    for clause in cut.clauses:
        value = clause.a @ cut.home + clause.b
        assert value / np.linalg.norm(clause.a, axis=1) > Gains.default().constraint_width
    assert np.all(np.abs(cut.limits - cut.home[:, None]) >= LIMIT_GAP)


def test_links_that_do_not_touch_and_links_of_two_parts_are_left_alone() -> None:
    robot = arm_beside_a_wall(1.5)
    cut, narrowed, left = with_cuts(robot, robot.solid_pairs, 0)
    assert narrowed == () and cut.clauses == () and not len(left)
    near = arm_beside_a_wall(0.12)
    apart = replace(near, motor_table=(replace(near.motor_table[0], part="trunk"), *near.motor_table[1:]))
    cut, narrowed, _ = with_cuts(apart, apart.solid_pairs, 0)
    assert narrowed == () and cut.clauses == ()
