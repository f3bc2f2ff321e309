# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import mobee
from experiments.bench.scenes import boxes_world, upper_body, upper_body_poses
from mobee import Model
from mobee.model.contact import ContactTable
from mobee.robot.robot import Robot
from tests.mobee.model.random_scenes import loaded, posed, random_robot, random_world
from tests.mobee.planar import planar_arm

FCL = 5e-6  # m: fcl's own tolerance is 1e-6, in each of a few places


def assert_same(ours: ContactTable, reference: ContactTable) -> int:
    """Pairs, kinds, links and depths are the same; returns how many contacts there are."""
    found = {tuple(row): depth for row, depth in zip(ours.numbers.tolist(), ours.depth.tolist(), strict=True)}
    expected = {tuple(row): depth for row, depth in zip(reference.numbers.tolist(), reference.depth.tolist(), strict=True)}
    assert [row for row in found.keys() ^ expected.keys() if found.get(row, expected.get(row)) > FCL] == []
    assert [row for row in found.keys() & expected.keys() if abs(found[row] - expected[row]) > FCL] == []
    return len(expected)


def engines(robot: Robot, world: mobee.World) -> tuple[Model, Model]:
    return Model(robot, world), Model(robot, world, engine="fcl")


def touched(seed: int) -> int:
    rng = np.random.default_rng(seed)
    robot = random_robot(rng, joints=6, shapes=15)
    world = random_world(rng, robot, 15)
    q = posed(rng, robot, 3)
    compiled, reference = engines(robot, world)
    return assert_same(compiled.evaluate(q).table, reference.evaluate(q).table)


def test_volumes_of_all_kinds_and_roles_touch_as_in_the_compiled_engine() -> None:
    assert sum(touched(seed) for seed in range(60)) > 2000


@pytest.mark.parametrize("boxes", [0, 100])
def test_the_benchmark_has_the_same_contacts_normals_points_and_forces(boxes: int) -> None:
    q = upper_body_poses(40)
    ours, reference = (model.evaluate(q) for model in engines(upper_body(), boxes_world(boxes)))
    assert assert_same(ours.table, reference.table) > 50
    assert ours.table.numbers.tolist() == reference.table.numbers.tolist()
    assert ours.table.normal == pytest.approx(reference.table.normal, abs=0.03)
    assert ours.table.point == pytest.approx(reference.table.point, abs=1e-3)
    assert ours.projection == pytest.approx(reference.projection, abs=1e-4)
    assert abs(ours.projection).max() > 1e-3


def test_contacts_with_a_least_lever_push_as_in_the_compiled_engine() -> None:
    robot = replace(upper_body(), least_lever=0.05)
    ours, reference = (model.evaluate(upper_body_poses(20)) for model in engines(robot, boxes_world(50)))
    assert ours.projection == pytest.approx(reference.projection, abs=2e-3)
    assert abs(ours.projection).max() > 0.02


def test_forces_of_a_part_end_where_it_ends(rng: np.random.Generator) -> None:
    robot = loaded("icub")
    q = posed(rng, robot, 10)
    ours, reference = (model.evaluate(q) for model in engines(robot, mobee.load_world("table")))
    assert ours.projection_of_part == pytest.approx(reference.projection_of_part, abs=1e-4)
    assert abs(reference.projection_of_part - reference.projection).max() > 1e-3


def test_places_and_jacobians_are_those_of_the_compiled_engine(rng: np.random.Generator) -> None:
    robot = loaded("icub")
    q = posed(rng, robot, 3)
    compiled, reference = engines(robot, mobee.World())
    assert compiled.evaluate(q).transforms == pytest.approx(reference.evaluate(q).transforms, abs=1e-12)
    assert compiled.jacobian(q, "left_palm") == pytest.approx(reference.jacobian(q, "left_palm"), abs=1e-12)


def test_one_pose_without_contacts_has_an_empty_table() -> None:
    pose = Model(planar_arm(), engine="fcl").evaluate(np.zeros(3))
    assert (pose.contacts, pose.count, len(pose.table)) == ((), 0, 0)
    assert pose.projection == pytest.approx(np.zeros(3))
