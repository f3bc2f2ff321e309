from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import Delaunay

from mobee.roadmap.building.chart import FLAT, Region


@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), dimensions=st.integers(1, 4))
def test_a_place_is_covered_where_one_of_the_simplices_has_it_inside(seed: int, dimensions: int) -> None:
    rng = np.random.default_rng(seed)
    region, simplices = Region(dimensions), []
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


def test_all_simplices_of_a_triangulation_cover_what_scipy_finds_in_them() -> None:
    rng = np.random.default_rng(3)
    mesh = Delaunay(rng.uniform(0.0, 4.0, (40, 2)))
    region = Region(2)
    kept = np.array([region.add(mesh.points[simplex]) is not None for simplex in mesh.simplices])
    places = rng.uniform(-0.5, 4.5, (500, 2))
    # Triangles whose origin is further off than REACH are none of a map's: its edges are at most 1.5 long.
    short = np.array([np.linalg.norm(mesh.points[s[1:]] - mesh.points[s[0]], axis=1).max() < 1.5 for s in mesh.simplices])
    found = mesh.find_simplex(places)
    sure = (found < 0) | (kept & short)[found]
    assert sure.sum() > 300
    assert np.array_equal(region.covers(places)[sure], found[sure] >= 0)


def test_corners_and_sides_are_covered() -> None:
    region = Region(2)
    region.add(np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]))
    assert region.covers(np.array([[0.0, 0.0], [1.0, 0.0], [0.5, 0.5], [0.0, 0.3]])).all()
    assert not region.covers(np.array([[0.51, 0.51], [-0.01, 0.0]])).any()


@pytest.mark.parametrize("height", [0.0, 0.9 * FLAT])
def test_flat_simplices_cover_nothing(height: float) -> None:
    region = Region(2)
    assert region.add(np.array([[0.0, 0.0], [1.0, 0.0], [0.5, height]])) is None
    assert not region.covers(np.array([[0.5, height / 2.0]])).any()


def test_nothing_covers_nothing() -> None:
    assert not Region(3).covers(np.zeros((4, 3))).any()
    assert Region(2).covers(np.empty((0, 2))).shape == (0,)
