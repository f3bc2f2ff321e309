from __future__ import annotations

import numpy as np
import pytest

from mobee.roadmap.building.lattice_points import APART, LatticePoints

SPACING = {1: [0.1], 2: [0.1, 0.2], 3: [0.1, 0.2, 0.3], 4: [0.1, 0.2, 0.3, 0.4]}
AROUND = {1: 2, 2: 6, 3: 12, 4: 8}


def lattice(dimensions: int) -> tuple[LatticePoints, np.ndarray, np.ndarray]:
    box = np.array([(-1.0, 2.0)] * dimensions)
    spacing = np.array(SPACING[dimensions])
    return LatticePoints(box, spacing), box, spacing


@pytest.mark.parametrize("dimensions", [1, 2, 3, 4])
def test_neighbours_are_a_spacing_away(dimensions: int) -> None:
    points, box, spacing = lattice(dimensions)
    middle = np.zeros((1, dimensions), dtype=np.intp)
    np.testing.assert_allclose(points.y(middle)[0], box.mean(axis=1))
    beside = points.around(middle)[0]
    assert len(beside) == AROUND[dimensions]
    np.testing.assert_allclose(np.linalg.norm((points.y(np.array(beside)) - points.y(middle)) / spacing, axis=1), 1.0)


def test_no_neighbour_is_outside_the_box() -> None:
    points, box, _ = lattice(2)
    corner = points.nearest(np.array([[2.0, 2.0]]))
    beside = points.y(np.array(points.around(corner)[0]))
    assert 0 < len(beside) < 6 and (beside <= box[:, 1] + 1e-9).all()


@pytest.mark.parametrize("dimensions", [1, 2, 3, 4])
def test_the_nearest_point_is_in_the_box_and_near(dimensions: int) -> None:
    points, box, spacing = lattice(dimensions)
    y = np.random.default_rng(0).uniform(-1.3, 2.3, (200, dimensions))
    found = points.nearest(y)
    there = points.y(found)
    assert (found % 2 == 0).all() and (np.abs(there - box.mean(axis=1)) <= 1.5 + 1e-9).all()
    far = np.linalg.norm((there - np.clip(y, -1.0, 2.0)) / spacing, axis=1)
    assert far.max() <= 1.5 and np.median(far) < 1.0


@pytest.mark.parametrize("dimensions", [2, 3])
def test_points_between_are_either_too_near_or_far_enough(dimensions: int) -> None:
    points, _, spacing = lattice(dimensions)
    middle = (0,) * dimensions
    halves = points.between(np.array([middle]))[0]
    assert all(any(number % 2 for number in half) and half in points.close(middle) for half in halves)
    close = set(points.close(halves[0]))
    lattice_points = [point for step in points.around(np.array([middle]))[0] for point in points.around(np.array([step]))[0]]
    for point in lattice_points:
        far = np.linalg.norm((points.y(np.array([point])) - points.y(np.array([halves[0]]))) / spacing)
        assert (point in close) == bool(far < APART)


def test_a_box_narrower_than_the_spacing_has_its_middle() -> None:
    points = LatticePoints(np.array([(0.0, 0.01), (0.0, 1.0)]), np.array([0.1, 0.1]))
    y = points.y(points.nearest(np.array([[0.3, 0.52]])))
    np.testing.assert_allclose(y, [[0.005, 0.5]])
