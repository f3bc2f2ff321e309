from __future__ import annotations

import numpy as np
import pytest

import mobee
from mobee.errors import MobeeError
from mobee.roadmap import graph as free_way
from mobee.roadmap.edges import check_edges
from mobee.roadmap.graph import graph
from mobee.roadmap.roadmap import Roadmap

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


def steps(way: list[int]) -> np.ndarray:
    return np.sort(np.stack([way[:-1], way[1:]], axis=1), axis=1)


def test_where_nothing_is_in_the_way_the_free_way_is_the_shortest(trm: Roadmap) -> None:
    assert trm.way(trm.q[0], trm.y[-1], free=True) == trm.way(trm.q[0], trm.y[-1])
    np.testing.assert_array_equal(trm.path(trm.q[0], trm.y[-1], free=True), trm.path(trm.q[0], trm.y[-1]))


@pytest.mark.parametrize("lazy", [free_way.LAZY, 0], ids=["lazily", "all at once"])
def test_it_goes_round_what_touches_and_no_farther_than_it_must(trm: Roadmap, lazy: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(free_way, "LAZY", lazy)
    put(trm, MIDDLE)
    start, goal = MIDDLE - 3, MIDDLE + 3
    free = check_edges(trm.model, trm.q, trm.edges)
    way = trm.way(trm.q[start], trm.y[goal], free=True)
    assert way[0] == start and way[-1] == goal and MIDDLE not in way
    assert check_edges(trm.model, trm.q, steps(way)).all()
    best = graph(trm.q, trm.edges[free]).shortest(start, goal)
    assert best is not None and len(way) == len(best) > len(trm.way(trm.q[start], trm.y[goal]))


def test_it_enters_and_leaves_the_map_where_it_can(trm: Roadmap) -> None:
    put(trm, MIDDLE)
    beside = trm.q[0] - 0.01
    assert trm.way(beside, trm.y[MIDDLE])[-1] == MIDDLE
    way = trm.way(beside, trm.y[MIDDLE], free=True)
    assert np.abs(trm.y[way[-1]] - trm.y[MIDDLE]).max() <= 1.0 and way[-1] != MIDDLE
    assert check_edges(trm.model, trm.q, steps(way)).all()


def test_a_first_step_that_touches_is_gone_round(trm: Roadmap) -> None:
    put(trm, MIDDLE, 0.002)
    start = trm.q[MIDDLE] + 0.4 * (trm.q[MIDDLE + 1] - trm.q[MIDDLE])
    way = trm.way(start, trm.y[0], free=True)
    assert trm.way(start, trm.y[0])[0] == MIDDLE != way[0]
    assert trm.model.evaluate(start).count == 0
    assert check_edges(trm.model, np.stack([start, trm.q[way[0]]]), np.array([[0, 1]])).all()


def test_where_no_way_is_free_it_says_why(trm: Roadmap) -> None:
    put(trm, 0, 0.05)
    with pytest.raises(MobeeError, match="the straight ones from the start to the 24 nearest poses of the map all touch"):
        trm.way(trm.q[0], trm.y[-1], free=True)
    with pytest.raises(MobeeError, match="in all poses of the map that are near the goal"):
        trm.way(trm.q[-1], trm.y[0] - 1.0, free=True)
    for row in range(SIDE):
        put(trm, row * SIDE + 3, 0.03)
    with pytest.raises(MobeeError, match=r"\d+ of 84 edges touch something, and without them none leads"):
        trm.way(trm.q[SIDE * 3 + 6], trm.y[SIDE * 5], free=True)
