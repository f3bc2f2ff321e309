# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from mobee.arrays import Array
from mobee.check import check_file
from mobee.check.shapes import excess
from mobee.robot.load import load_robot
from mobee.robot.urdf.hull import convex_hull
from tests.mobee.robot.urdf_files import arm_with, foreign, tetrahedron, write_stl

CUBE = np.array(np.meshgrid([-1.0, 1.0], [-1.0, 1.0], [-1.0, 1.0])).reshape(3, -1).T


@pytest.mark.parametrize(
    ("corner", "far"),
    [((1.5, 0.2, 0.3), 0.5), ((1.3, 1.4, 0.0), 0.5), ((2.0, 2.0, 2.0), 3**0.5), ((0.5, 0.5, 0.5), 0.0), ((1.0, 0.0, 0.0), 0.0)],
    ids=["a face", "an edge", "a corner", "inside", "on a face"],
)
def test_a_corner_is_as_far_as_the_nearest_place_of_the_hull(corner: tuple[float, float, float], far: float) -> None:
    assert excess(np.array([corner]), CUBE) == pytest.approx(far, abs=1e-7)


def ball(seed: int) -> Array:
    points = np.random.default_rng(seed).normal(size=(2000, 3))
    return points / np.linalg.norm(points, axis=1)[:, None]


@pytest.mark.parametrize("seed", range(3))
def test_the_farthest_of_all_corners_counts_and_no_plane_of_the_hull_says_more(seed: int) -> None:
    points = ball(seed)
    corners = convex_hull(points, 40)
    found = excess(corners, points)
    assert found == pytest.approx(max(excess(corner[None], points) for corner in corners), abs=1e-9)
    planes = ConvexHull(points).equations
    beyond = float((corners @ planes[:, :3].T + planes[:, 3]).max())
    assert beyond - 1e-7 <= found < beyond + 0.01  # the hull of a ball has no sharp edges
    assert excess(convex_hull(points, "all"), points) < 1e-9


def test_check_says_by_how_much_hulls_stand_out_and_what_to_do() -> None:
    path = foreign("kuka_iiwa/model.urdf")
    (found,) = [finding for finding in check_file(path).findings if finding.check == "reduced-hulls"]
    assert found.severity == "note"
    assert found.what == "the hulls of 8 meshes extend beyond the exact hulls, by 8.3 mm at most ('lbr_iiwa_link_3')"
    assert found.where == load_robot(path).where["shape", "lbr_iiwa_link_3"]
    assert "--corners N" in found.remedy and "576 corners" in found.remedy
    fewer = [finding.what for finding in check_file(path, corners=200).findings if finding.check == "reduced-hulls"]
    assert len(fewer) == 1 and "by 8.3 mm" not in fewer[0]
    assert not [finding for finding in check_file(path, corners="all").findings if finding.check == "reduced-hulls"]


def test_hulls_that_are_exact_need_no_word(tmp_path: Path) -> None:
    write_stl(tmp_path / "t.stl", tetrahedron())
    path = arm_with(tmp_path, '<mesh filename="t.stl"/>')
    assert not [finding for finding in check_file(path).findings if finding.check == "reduced-hulls"]
