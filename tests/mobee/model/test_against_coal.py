# SPDX-License-Identifier: Apache-2.0
"""Every contact against Pinocchio and coal: random poses of the benchmark's robot, 450 alone and 60 among 100 boxes."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from experiments.bench.collision_peers import CoalPeer
from experiments.bench.scenes import boxes_world, upper_body, upper_body_poses
from mobee import Model
from mobee.arrays import Array
from mobee.model.contact import ContactTable

coal = pytest.importorskip("coal")

POSES = {0: 450, 100: 60}  # by the number of boxes
GRAZE = 1e-6  # m; a pair that overlaps by less may be a contact for one of the two only
CLEAR = 1e-7  # m, beyond the depth


class Compared:
    """The contacts of both, and the volumes placed for further questions to coal."""

    def __init__(self, boxes: int) -> None:
        robot, world = upper_body(), boxes_world(boxes)
        self.q = upper_body_poses(POSES[boxes])
        pose = Model(robot, world).evaluate(self.q)
        self.ours: ContactTable = pose.table
        self.transforms: Array = pose.transforms
        peer = CoalPeer(robot, world.snapshot)
        self.theirs = {
            (at, *pair): (depth, normal)
            for at, q in enumerate(self.q)
            for pair, depth, normal in zip(*(column.tolist() for column in peer.touching(q)), strict=True)
        }
        self.volumes = (*robot.shapes, *world.objects.values())
        makers = {"sphere": coal.Sphere, "capsule": coal.Capsule, "box": coal.Box}
        self.shapes: list[Any] = [makers[volume.kind](*volume.size) for volume in self.volumes]

    def rows(self) -> Iterator[tuple[tuple[int, int, int], float, Array]]:
        table = self.ours
        keys = zip(table.pose.tolist(), table.first.tolist(), table.second.tolist(), strict=True)
        return zip(keys, table.depth.tolist(), table.normal, strict=True)

    def placed(self, pose: int, index: int, link: int, shift: Array) -> Any:
        volume = self.volumes[index]
        now = np.eye(4) if link < 0 else self.transforms[pose, link]
        return coal.Transform3s(now[:3, :3] @ volume.rotation, now[:3, :3] @ volume.position + now[:3, 3] + shift)

    def touches_when_moved(self, row: int, far: float) -> bool:
        """Whether the pair still overlaps when its first volume has moved so far along the normal."""
        table = self.ours
        pose, a, b = int(table.pose[row]), int(table.first[row]), int(table.second[row])
        first = self.placed(pose, a, int(table.first_link[row]), far * table.normal[row])
        second = self.placed(pose, b, int(table.second_link[row]), np.zeros(3))
        request, result = coal.CollisionRequest(), coal.CollisionResult()
        request.gjk_tolerance = 1e-9
        return bool(coal.collide(self.shapes[a], first, self.shapes[b], second, request, result))


@pytest.fixture(scope="module", params=[0, 100], ids=["no boxes", "100 boxes"])
def compared(request: pytest.FixtureRequest) -> Compared:
    return Compared(request.param)


def test_both_find_the_same_contacts(compared: Compared) -> None:
    ours = {key: depth for key, depth, _ in compared.rows()}
    assert len(ours) > 1000
    deep = {key for key, depth in ours.items() if depth > GRAZE} ^ {key for key, (depth, _) in compared.theirs.items() if depth > GRAZE}
    assert {key for key in deep if key not in ours or key not in compared.theirs} == set()


def test_depths_are_the_same(compared: Compared) -> None:
    differences = [abs(depth - compared.theirs[key][0]) for key, depth, _ in compared.rows() if key in compared.theirs]
    assert max(differences) < 1e-6


def test_the_depth_along_the_normal_separates_and_a_shorter_one_does_not(compared: Compared) -> None:
    rows = np.flatnonzero(compared.ours.depth > GRAZE)
    depth = compared.ours.depth
    assert [row for row in rows if compared.touches_when_moved(row, depth[row] + CLEAR)] == []
    assert [row for row in rows if not compared.touches_when_moved(row, depth[row] - CLEAR)] == []
