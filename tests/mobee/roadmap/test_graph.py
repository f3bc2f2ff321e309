# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

import mobee
from mobee.errors import InvalidValue, MobeeError
from mobee.roadmap import graph as graph_module
from mobee.roadmap.edges import check_edges
from mobee.roadmap.graph import components, graph, nearest, nearest_before, short, sorted_edges
from mobee.roadmap.roadmap import Roadmap


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(2, 25), st.integers(0, 60))
def test_the_path_is_as_short_as_by_dijkstra(seed: int, count: int, edges: int) -> None:
    rng = np.random.default_rng(seed)
    q = rng.normal(size=(count, 3))
    pairs = np.sort(rng.integers(0, count, (edges, 2)), axis=1)
    pairs = np.unique(pairs[pairs[:, 0] < pairs[:, 1]], axis=0).reshape(-1, 2)
    lengths = np.linalg.norm(q[pairs[:, 0]] - q[pairs[:, 1]], axis=1)
    apart = dijkstra(coo_array((lengths, (pairs[:, 0], pairs[:, 1])), shape=(count, count)).tocsr(), directed=False)
    there = {(int(a), int(b)) for a, b in pairs}
    roads = graph(q, pairs)
    for start, goal in rng.integers(0, count, (4, 2)).tolist():
        path = roads.shortest(start, goal)
        if path is None:
            assert apart[start, goal] == np.inf
            continue
        assert path[0] == start and path[-1] == goal
        assert all((min(a, b), max(a, b)) in there for a, b in zip(path, path[1:], strict=False))
        assert np.linalg.norm(np.diff(q[path], axis=0), axis=1).sum() == pytest.approx(apart[start, goal], abs=1e-12)


def test_components_are_numbered_by_size() -> None:
    np.testing.assert_array_equal(components(6, np.array([[1, 2], [2, 5], [3, 4]])), [2, 0, 0, 1, 1, 0])


def test_a_graph_may_be_without_edges() -> None:
    roads = graph(np.zeros((2, 3)), np.empty((0, 2), dtype=np.intp))
    assert roads.shortest(0, 1) is None
    assert roads.shortest(1, 1) == [1]


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


SIDE, STEP = 7, 0.2
MIDDLE = SIDE * SIDE // 2


@pytest.fixture
def trm(icub: mobee.Robot) -> Roadmap:
    """A lattice over the shoulder of the right arm, away from the body."""
    start = icub.home.copy()
    start[icub.motor_index("r_elbow")] = 0.8
    rows, columns = (one.ravel() for one in np.meshgrid(range(SIDE), range(SIDE), indexing="ij"))
    q = np.repeat(start[None], SIDE**2, axis=0)
    q[:, icub.motor_index("r_shoulder_pitch")] = -1.3 + STEP * rows
    q[:, icub.motor_index("r_shoulder_roll")] = 0.5 + STEP * columns
    edges = np.argwhere(np.triu(np.abs(rows[:, None] - rows) + np.abs(columns[:, None] - columns) == 1))
    y = np.stack([rows, columns], axis=1).astype(float)
    return Roadmap(mobee.Model(icub, mobee.World()), q, y, edges, np.ones(2), {"motors": ["r_shoulder_pitch", "r_shoulder_roll"]})


def put(trm: Roadmap, vertex: int, radius: float = 0.01) -> None:
    """Something where the palm is in a vertex."""
    place = trm.model.evaluate(trm.q[vertex]).position("right_palm")
    trm.model.world.add(f"block {vertex}", mobee.sphere(radius), position=place)


def steps(path: list[int]) -> np.ndarray:
    return np.sort(np.stack([path[:-1], path[1:]], axis=1), axis=1)


def test_without_obstacles_the_free_path_is_the_shortest(trm: Roadmap) -> None:
    assert trm.vertex_path(trm.q[0], trm.y[-1], free=True) == trm.vertex_path(trm.q[0], trm.y[-1])
    np.testing.assert_array_equal(trm.path(trm.q[0], trm.y[-1], free=True), trm.path(trm.q[0], trm.y[-1]))


@pytest.mark.parametrize("lazy", [graph_module.MAX_LAZY_SEARCHES, 0], ids=["lazily", "all at once"])
def test_the_free_path_is_the_shortest_around_an_obstacle(trm: Roadmap, lazy: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(graph_module, "MAX_LAZY_SEARCHES", lazy)
    put(trm, MIDDLE)
    start, goal = MIDDLE - 3, MIDDLE + 3
    free = check_edges(trm.model, trm.q, trm.edges)
    path = trm.vertex_path(trm.q[start], trm.y[goal], free=True)
    assert path[0] == start and path[-1] == goal and MIDDLE not in path
    assert check_edges(trm.model, trm.q, steps(path)).all()
    best = graph(trm.q, trm.edges[free]).shortest(start, goal)
    assert best is not None and len(path) == len(best) > len(trm.vertex_path(trm.q[start], trm.y[goal]))


def test_a_free_path_enters_and_leaves_the_map_at_vertices_without_contacts(trm: Roadmap) -> None:
    put(trm, MIDDLE)
    beside = trm.q[0] - 0.01
    assert trm.vertex_path(beside, trm.y[MIDDLE])[-1] == MIDDLE
    path = trm.vertex_path(beside, trm.y[MIDDLE], free=True)
    assert np.abs(trm.y[path[-1]] - trm.y[MIDDLE]).max() <= 1.0 and path[-1] != MIDDLE
    assert check_edges(trm.model, trm.q, steps(path)).all()


def test_a_first_line_with_contacts_is_avoided(trm: Roadmap) -> None:
    put(trm, MIDDLE, 0.002)
    start = trm.q[MIDDLE] + 0.4 * (trm.q[MIDDLE + 1] - trm.q[MIDDLE])
    path = trm.vertex_path(start, trm.y[0], free=True)
    assert trm.vertex_path(start, trm.y[0])[0] == MIDDLE != path[0]
    assert trm.model.evaluate(start).count == 0
    assert check_edges(trm.model, np.stack([start, trm.q[path[0]]]), np.array([[0, 1]])).all()


def test_if_every_path_has_contacts_the_error_gives_the_reason(trm: Roadmap) -> None:
    put(trm, 0, 0.05)
    lines = "the straight lines from the start to the 24 nearest poses of the map all have contacts"
    with pytest.raises(MobeeError, match=rf"{lines}, since \w+ and block 0.* touch in the start itself\.$"):
        trm.vertex_path(trm.q[0], trm.y[-1], free=True)
    with pytest.raises(MobeeError, match="all poses of the map near the goal have contacts"):
        trm.vertex_path(trm.q[-1], trm.y[0] - 1.0, free=True)
    for row in range(SIDE):
        put(trm, row * SIDE + 3, 0.03)
    with pytest.raises(MobeeError, match=r"\d+ of 84 edges have contacts, and the other edges do not connect"):
        trm.vertex_path(trm.q[SIDE * 3 + 6], trm.y[SIDE * 5], free=True)
