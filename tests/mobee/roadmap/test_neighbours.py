from __future__ import annotations

import numpy as np
import pytest

from mobee.errors import InvalidValue
from mobee.roadmap.graph import components, nearest, nearest_before, short, sorted_edges

SPACING = np.array([0.1, 10.0])


def places(count: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).uniform(size=(count, 2)) * SPACING * 5.0


def is_list_of_edges(edges: np.ndarray) -> bool:
    return bool((edges[:, 0] < edges[:, 1]).all()) and np.array_equal(edges, np.unique(edges, axis=0))


def test_every_vertex_is_joined_to_its_nearest_in_spacings() -> None:
    y = places(40)
    edges = nearest(y, SPACING, 3)
    apart = np.linalg.norm((y[:, None] - y) / SPACING, axis=2)
    wanted = {tuple(sorted((a, int(b)))) for a in range(40) for b in np.argsort(apart[a])[1:4]}
    assert {tuple(edge) for edge in edges.tolist()} == wanted
    assert is_list_of_edges(edges)


def test_vertices_at_one_place_are_not_joined_to_themselves() -> None:
    edges = nearest(np.zeros((5, 2)), SPACING, 2)
    assert is_list_of_edges(edges)
    assert (np.bincount(edges.ravel(), minlength=5) >= 2).all()


def test_few_vertices_have_few_neighbours() -> None:
    assert nearest(places(2), SPACING, 8).tolist() == [[0, 1]]
    assert nearest(places(1), SPACING, 8).shape == nearest(places(0), SPACING, 8).shape == (0, 2)
    with pytest.raises(InvalidValue, match="at least 1"):
        nearest(places(3), SPACING, 0)


def test_joined_to_those_before_a_map_is_in_one_piece() -> None:
    y = places(60)
    edges = nearest_before(y, SPACING, 2)
    assert is_list_of_edges(edges)
    assert len(edges) == 1 + 2 * 58
    assert (components(60, edges) == 0).all()
    apart = np.linalg.norm((y - y[30]) / SPACING, axis=1)[:30]
    assert {a for a, b in edges.tolist() if b == 30} == set(np.argsort(apart)[:2].tolist())


def test_long_steps_of_a_motor_are_no_edges() -> None:
    q = np.array([[0.0, 0.0], [0.3, 0.3], [0.0, 0.5]])
    edges = sorted_edges([[1, 0], [0, 2], [2, 1]])
    assert short(q, edges, 0.4).tolist() == [[0, 1], [1, 2]]
    assert short(q, edges, None) is edges
