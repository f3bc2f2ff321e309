from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from mobee.roadmap.graph import components, graph


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(2, 25), st.integers(0, 60))
def test_the_way_is_as_short_as_dijkstra_says(seed: int, count: int, edges: int) -> None:
    rng = np.random.default_rng(seed)
    q = rng.normal(size=(count, 3))
    pairs = np.sort(rng.integers(0, count, (edges, 2)), axis=1)
    pairs = np.unique(pairs[pairs[:, 0] < pairs[:, 1]], axis=0).reshape(-1, 2)
    lengths = np.linalg.norm(q[pairs[:, 0]] - q[pairs[:, 1]], axis=1)
    apart = dijkstra(coo_array((lengths, (pairs[:, 0], pairs[:, 1])), shape=(count, count)).tocsr(), directed=False)
    there = {(int(a), int(b)) for a, b in pairs}
    roads = graph(q, pairs)
    for start, goal in rng.integers(0, count, (4, 2)).tolist():
        way = roads.shortest(start, goal)
        if way is None:
            assert apart[start, goal] == np.inf
            continue
        assert way[0] == start and way[-1] == goal
        assert all((min(a, b), max(a, b)) in there for a, b in zip(way, way[1:], strict=False))
        assert np.linalg.norm(np.diff(q[way], axis=0), axis=1).sum() == pytest.approx(apart[start, goal], abs=1e-12)


def test_components_are_numbered_by_size() -> None:
    np.testing.assert_array_equal(components(6, np.array([[1, 2], [2, 5], [3, 4]])), [2, 0, 0, 1, 1, 0])


def test_a_graph_may_be_without_edges() -> None:
    roads = graph(np.zeros((2, 3)), np.empty((0, 2), dtype=np.intp))
    assert roads.shortest(0, 1) is None
    assert roads.shortest(1, 1) == [1]
