# SPDX-License-Identifier: Apache-2.0
"""Contacts and forces along 1000 random paths of the benchmark's robot, in steps of 1 mrad, among 0 and 100 boxes.

What must hold, with "moved" for how far a pair's volumes have moved relative to each other in a step:
- a pair's depth changes by no more than they moved, so that contacts come and go without a jump;
- between spheres and capsules the force (depth times normal) changes by no more than that times R / (R - depth), R the sum of
  the radii: it has no jump before their cores meet;
- with a box, whose least separation may switch from one face to another, by no more than twice the depth on top of it;
- so that the projection on the motors changes in a step by less than 0.03 m^2/rad without boxes, and 0.1 among them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from experiments.bench.scenes import boxes_world, upper_body
from mobee import Model
from mobee.arrays import Array
from mobee.model.core_tables import bound
from mobee.model.pose import Pose
from mobee.model.world_object import WorldObject
from mobee.robot.robot import Shape

PATHS, POSES, STEP = 1000, 13, 1e-3
PROJECTION = {0: 0.03, 100: 0.1}  # m^2/rad


@dataclass(frozen=True, eq=False)
class Steps:
    """Every pair that touches before or after a step: depths (s, 2), forces (s, 2, 3) in the second's frame, distance moved (s,)."""

    depth: Array
    force: Array
    moved: Array
    radii: Array  # (s,) m, the sum of both; NaN with a box
    projection: Array  # (steps, n), the change in each step


@pytest.fixture(scope="module", params=[0, 100], ids=["no boxes", "100 boxes"])
def steps(request: pytest.FixtureRequest) -> tuple[int, Steps]:
    robot, world = upper_body(), boxes_world(request.param)
    rng = np.random.default_rng(2014)
    low, high = robot.limits.T
    ends = rng.uniform(low, high, (2, PATHS, len(low)))
    motion = ends[1] - ends[0]
    motion *= STEP / abs(motion).max(axis=1, keepdims=True)
    q = ends[0][:, None] + np.arange(POSES)[:, None] * motion[:, None]
    pose = Model(robot, world).evaluate(q)
    return request.param, walked(pose, (*robot.shapes, *world.objects.values()))


def walked(pose: Pose, volumes: tuple[Shape | WorldObject, ...]) -> Steps:
    """Set each pose beside the next of its path."""
    table, count = pose.table, len(volumes)
    transforms = pose.transforms.reshape(-1, *pose.transforms.shape[-3:])
    key = (table.pose * count + table.first) * count + table.second
    starts = np.flatnonzero((np.arange(PATHS * POSES) + 1) % POSES)  # all but the last of each path
    before = key[np.isin(table.pose, starts)]
    after = key[np.isin(table.pose, starts + 1)] - count * count
    both = np.union1d(before, after)
    at, pair = np.divmod(both, count * count)
    first, second = np.divmod(pair, count)
    link = np.array([volume.link if isinstance(volume, Shape) else len(transforms[0]) for volume in volumes])
    fixed = np.concatenate([transforms, np.broadcast_to(np.eye(4), (len(transforms), 1, 4, 4))], axis=1)
    depth, force, seen = np.zeros((len(both), 2)), np.zeros((len(both), 2, 3)), []
    for k in range(2):
        frame = fixed[at + k, link[second]]
        row = np.minimum(np.searchsorted(key, both + k * count * count), len(key) - 1)
        found = key[row] == both + k * count * count
        depth[:, k] = np.where(found, table.depth[row], 0.0)
        force[:, k] = np.einsum("sji,sj->si", frame[:, :3, :3], depth[:, k, None] * table.normal[row])
        seen.append(np.linalg.inv(frame) @ fixed[at + k, link[first]])
    change = seen[1] - seen[0]
    center = np.array([volume.position for volume in volumes])[first]
    radius_of_all = np.array([bound(volume) for volume in volumes])[first]
    shift = np.einsum("sij,sj->si", change[:, :3, :3], center) + change[:, :3, 3]
    moved = np.linalg.norm(shift, axis=1) + np.linalg.norm(change[:, :3, :3], axis=(1, 2)) * radius_of_all
    radius = np.array([np.nan if volume.kind == "box" else volume.size[0] for volume in volumes])
    jumps = np.diff(pose.projection, axis=1).reshape(-1, pose.projection.shape[-1])
    return Steps(depth, force, moved, radius[first] + radius[second], jumps)


def test_paths_meet_many_contacts(steps: tuple[int, Steps]) -> None:
    assert len(steps[1].moved) > (20_000 if steps[0] == 0 else 200_000)


def test_a_depth_changes_by_no_more_than_its_volumes_moved(steps: tuple[int, Steps]) -> None:
    found = steps[1]
    assert (abs(found.depth[:, 1] - found.depth[:, 0]) <= found.moved + 1e-12).all()


def test_forces_between_rounded_volumes_have_no_jump(steps: tuple[int, Steps]) -> None:
    found = steps[1]
    jump = np.linalg.norm(found.force[:, 1] - found.force[:, 0], axis=1)
    depth = found.depth.max(axis=1)
    rounded = depth < found.radii
    assert rounded.sum() > 20_000
    assert (jump <= found.moved * found.radii / (found.radii - depth) + 1e-12)[rounded].all()


def test_forces_of_boxes_jump_only_where_the_smallest_separation_switches(steps: tuple[int, Steps]) -> None:
    found = steps[1]
    jump = np.linalg.norm(found.force[:, 1] - found.force[:, 0], axis=1)
    assert (jump <= 2.0 * found.depth.max(axis=1) + found.moved).all()


def test_the_projection_jumps_by_no_more_than_the_stated_bound(steps: tuple[int, Steps]) -> None:
    boxes, found = steps
    assert 0.0 < abs(found.projection).max() < PROJECTION[boxes]
