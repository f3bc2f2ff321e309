# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial import ConvexHull

from mobee.robot.urdf.hull import CORNERS, convex_hull, facets
from mobee.robot.urdf.mesh import read_mesh
from tests.mobee.robot.urdf_files import foreign


def outside(points: np.ndarray, vertices: np.ndarray) -> float:
    """How far the farthest point lies outside of the hull of `vertices`, at most."""
    planes = ConvexHull(vertices).equations
    return float((points @ planes[:, :3].T + planes[:, 3]).max())


@given(st.integers(0, 2**32 - 1), st.integers(4, 400), st.sampled_from([0.001, 0.1, 3.0]))
def test_the_hull_holds_every_point_and_has_few_vertices(seed: int, count: int, size: float) -> None:
    rng = np.random.default_rng(seed)
    points = size * rng.normal(size=(count, 3)) * rng.uniform(0.1, 1.0, size=3) + rng.normal(size=3)
    vertices = convex_hull(points)
    assert 4 <= len(vertices) <= CORNERS
    assert outside(points, vertices) < 1e-12


@pytest.mark.parametrize("corners", [8, 30, 64, 200])
def test_the_number_of_corners_is_kept_and_more_of_them_are_closer(corners: int) -> None:
    points = np.random.default_rng(3).normal(size=(2000, 3))
    points /= np.linalg.norm(points, axis=1)[:, None]
    vertices = convex_hull(points, corners)
    assert corners - 8 <= len(vertices) <= corners
    assert outside(points, vertices) < 1e-12
    assert ConvexHull(vertices).volume < ConvexHull(convex_hull(points, corners // 2 + 4)).volume or corners == 8


def test_an_exact_hull_has_the_corners_of_the_mesh() -> None:
    points = read_mesh(foreign("kuka_iiwa/meshes/link_1.stl"))
    vertices = convex_hull(points, "all")
    assert len(vertices) > CORNERS
    assert np.abs(np.sort(vertices, axis=0) - np.sort(points[ConvexHull(points).vertices], axis=0)).max() < 1e-9
    assert ConvexHull(vertices).volume == pytest.approx(ConvexHull(points).volume, rel=1e-9)


def test_a_hull_of_few_vertices_is_exact() -> None:
    corners = np.array(np.meshgrid([0, 1.0], [0, 2.0], [0, 3.0])).reshape(3, -1).T
    points = np.vstack([corners, np.random.default_rng(0).uniform(0, 1, size=(200, 3))])
    assert np.array_equal(np.unique(convex_hull(points), axis=0), np.unique(corners, axis=0))


def test_a_ball_grows_by_a_few_percent_at_most() -> None:
    points = np.random.default_rng(1).normal(size=(3000, 3))
    points /= np.linalg.norm(points, axis=1)[:, None]
    vertices = convex_hull(points)
    assert len(vertices) > CORNERS - 8
    assert np.linalg.norm(vertices, axis=1).max() < 1.15
    assert ConvexHull(vertices).volume < 1.15 * ConvexHull(points).volume


@pytest.mark.parametrize("name", ["kuka_iiwa/meshes/link_1.stl", "franka_panda/meshes/collision/hand.obj", "laikago/chassis.obj"])
def test_meshes_of_other_makers_are_held_closely(name: str) -> None:
    points = read_mesh(foreign(name))
    vertices = convex_hull(points)
    size = float(np.linalg.norm(np.ptp(points, axis=0)))
    assert outside(points, vertices) < 1e-12
    assert outside(vertices, points[ConvexHull(points).vertices]) < 0.05 * size
    assert ConvexHull(vertices).volume < 1.2 * ConvexHull(points).volume


@pytest.mark.parametrize(
    "points",
    [
        np.eye(3),
        np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0]]),
        np.array([[1.0, 2, 3]]),
        np.eye(3)[[0, 1, 2, 0]] * 1e-3,
        np.random.default_rng(0).normal(size=(300, 3)) * [1e-6, 1e-8, 3e3],
    ],
    ids=["a plane", "a line", "a point", "a small plane", "a needle of a kilometre"],
)
def test_flat_meshes_are_given_a_thickness(points: np.ndarray) -> None:
    vertices = convex_hull(points)
    assert len(vertices) >= 4
    assert outside(points, vertices) < 1e-12
    assert ConvexHull(vertices).volume > 0


def test_facets_point_outwards_and_close_the_hull() -> None:
    vertices = convex_hull(np.random.default_rng(2).normal(size=(40, 3)))
    triangles = facets(vertices)
    cross = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    assert ((triangles.mean(axis=1) - vertices.mean(axis=0)) * cross).sum(axis=1).min() > 0
    assert np.abs(cross.sum(axis=0)).max() < 1e-12
    volume = (triangles[:, 0] * cross).sum() / 6
    assert volume == pytest.approx(ConvexHull(vertices).volume, rel=1e-12)
