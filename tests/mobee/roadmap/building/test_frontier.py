# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import Delaunay

from mobee.roadmap.building.frontier import (
    MAX_NEAREST,
    MAX_NEIGHBOURS,
    MIN_DETERMINANT,
    MIN_DISTANCE,
    Frontier,
    SimplexRegion,
    directions,
)


def _grown(seed: int, dimensions: int, count: int = 400) -> Frontier:
    """A frontier of random points around those that it has already."""
    rng = np.random.default_rng(seed)
    frontier = Frontier(np.full(dimensions, -4.0), np.full(dimensions, 4.0))
    frontier.add(np.zeros(dimensions))
    for _ in range(count):
        place = frontier.points[rng.integers(len(frontier))] + rng.uniform(-1.3, 1.3, dimensions)
        if frontier.accepts(place):
            frontier.add(place)
    return frontier


@settings(max_examples=10, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), dimensions=st.integers(1, 3))
def test_the_updated_free_directions_are_those_computed_from_all_vertices(seed: int, dimensions: int) -> None:
    frontier = _grown(seed, dimensions, 150)
    for vertex in range(len(frontier)):
        aims = frontier.points[vertex] + frontier.directions
        inside = ((aims >= frontier.low) & (aims <= frontier.high)).all(axis=1)
        apart = np.linalg.norm(aims[:, None] - frontier.points, axis=-1).min(axis=1) >= MIN_DISTANCE
        assert np.array_equal(frontier.free[vertex], inside & apart & ~frontier.region.covers(aims))


def test_vertices_keep_their_distance_and_stay_near_enough() -> None:
    frontier = _grown(1, 2)
    apart = np.linalg.norm(frontier.points[:, None] - frontier.points, axis=-1)
    assert len(frontier) > 25
    assert apart[np.triu_indices(len(frontier), 1)].min() >= MIN_DISTANCE
    for number in range(2, len(frontier)):
        before = np.sort(apart[number, :number])
        assert before[0] <= MAX_NEAREST
        assert before[1] <= MAX_NEIGHBOURS


def test_each_vertex_is_joined_to_its_n_nearest_of_those_before_it() -> None:
    frontier = _grown(2, 2, 100)
    apart = np.linalg.norm(frontier.points[:, None] - frontier.points, axis=-1)
    for number in range(len(frontier)):
        joined = {int(a) for a, b in frontier.edges if b == number}
        assert joined == set(np.argsort(apart[number, :number], kind="stable")[:2].tolist())


def test_the_first_vertices_have_as_many_neighbours_as_there_are_and_no_simplex() -> None:
    frontier = Frontier(np.full(2, -5.0), np.full(2, 5.0))
    frontier.add(np.zeros(2))
    assert len(frontier.edges) == 0
    frontier.add(np.array([1.0, 0.0]))
    assert frontier.edges.tolist() == [[0, 1]]
    assert len(frontier.region) == 0
    frontier.add(np.array([0.5, 0.9]))
    assert sorted(frontier.edges.tolist()) == [[0, 1], [0, 2], [1, 2]]
    assert len(frontier.region) == 1


def test_nothing_is_accepted_outside_the_box_too_near_too_far_or_where_it_is_covered() -> None:
    frontier = Frontier(np.array([0.0, 0.0]), np.array([3.0, 3.0]))
    for place in ([0.0, 0.0], [1.4, 0.0], [0.7, 1.25]):
        frontier.add(np.array(place))
    assert frontier.region.covers(np.array([[0.7, 0.42]]))[0]
    assert np.linalg.norm(frontier.points - [0.7, 0.42], axis=1).min() > MIN_DISTANCE
    for place, fits in (([0.7, 0.42], False), ([-0.1, 1.0], False), ([1.9, 0.1], False), ([3.0, 2.0], False), ([1.8, 1.0], True)):
        assert frontier.accepts(np.array(place)) is fits


def test_a_frontier_holds_no_more_vertices_than_a_dense_packing() -> None:
    frontier = _grown(4, 2, 3000)
    room = (8.0 + MIN_DISTANCE) ** 2
    assert len(frontier) <= room / (MIN_DISTANCE**2 * np.sqrt(3.0) / 2.0)


@pytest.mark.parametrize(("dimensions", "widest"), [(1, 0.0), (2, 8.0), (3, 20.0), (4, 60.0), (6, 75.0)])
def test_no_direction_is_far_from_all_of_them(dimensions: int, widest: float) -> None:
    vectors = directions(dimensions)
    drawn = np.random.default_rng(0).standard_normal((300, dimensions))
    drawn /= np.linalg.norm(drawn, axis=1)[:, None]
    assert np.allclose(np.linalg.norm(vectors, axis=1), 1.0)
    angle = np.degrees(np.arccos(np.clip((drawn @ vectors.T).max(axis=1), -1.0, 1.0)))
    assert angle.max() <= widest


@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), dimensions=st.integers(1, 4))
def test_a_place_is_covered_where_one_of_the_simplices_has_it_inside(seed: int, dimensions: int) -> None:
    rng = np.random.default_rng(seed)
    region, simplices = SimplexRegion(dimensions), []
    for origin in rng.uniform(-2.0, 2.0, (6, dimensions)):
        corners = np.concatenate([origin[None], origin + rng.uniform(-0.9, 0.9, (dimensions, dimensions))])
        if region.add(corners) is not None:
            simplices.append(corners)
    places = rng.uniform(-3.0, 3.0, (200, dimensions))

    def oracle(place: np.ndarray) -> bool:
        if dimensions == 1:
            return any(corners.min() <= place[0] <= corners.max() for corners in simplices)
        return any(Delaunay(corners).find_simplex(place[None], tol=1e-9)[0] >= 0 for corners in simplices)

    assert len(region) == len(simplices)
    assert np.array_equal(region.covers(places), [oracle(place) for place in places])


def test_simplices_cover_the_points_that_scipy_finds_in_them() -> None:
    rng = np.random.default_rng(3)
    mesh = Delaunay(rng.uniform(0.0, 4.0, (40, 2)))
    region = SimplexRegion(2)
    kept = np.array([region.add(mesh.points[simplex]) is not None for simplex in mesh.simplices])
    places = rng.uniform(-0.5, 4.5, (500, 2))
    # Triangles larger than SIMPLEX_EXTENT do not occur in a roadmap: its edges are at most 1.5 long.
    short = np.array([np.linalg.norm(mesh.points[s[1:]] - mesh.points[s[0]], axis=1).max() < 1.5 for s in mesh.simplices])
    found = mesh.find_simplex(places)
    sure = (found < 0) | (kept & short)[found]
    assert sure.sum() > 300
    assert np.array_equal(region.covers(places)[sure], found[sure] >= 0)


def test_corners_and_sides_are_covered() -> None:
    region = SimplexRegion(2)
    region.add(np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]))
    assert region.covers(np.array([[0.0, 0.0], [1.0, 0.0], [0.5, 0.5], [0.0, 0.3]])).all()
    assert not region.covers(np.array([[0.51, 0.51], [-0.01, 0.0]])).any()


@pytest.mark.parametrize("height", [0.0, 0.9 * MIN_DETERMINANT])
def test_flat_simplices_cover_nothing(height: float) -> None:
    region = SimplexRegion(2)
    assert region.add(np.array([[0.0, 0.0], [1.0, 0.0], [0.5, height]])) is None
    assert not region.covers(np.array([[0.5, height / 2.0]])).any()


def test_nothing_covers_nothing() -> None:
    assert not SimplexRegion(3).covers(np.zeros((4, 3))).any()
    assert SimplexRegion(2).covers(np.empty((0, 2))).shape == (0,)
