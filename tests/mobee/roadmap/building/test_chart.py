from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from mobee.roadmap.building.chart import FIRST, NEAREST, OTHERS, Chart


def _grown(seed: int, dimensions: int, count: int = 400) -> Chart:
    """A chart of places drawn at random about what is there already."""
    rng = np.random.default_rng(seed)
    chart = Chart(np.full(dimensions, -4.0), np.full(dimensions, 4.0))
    chart.add(np.zeros(dimensions))
    for _ in range(count):
        place = chart.places[rng.integers(len(chart))] + rng.uniform(-1.3, 1.3, dimensions)
        if chart.accepts(place):
            chart.add(place)
    return chart


@settings(max_examples=10, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), dimensions=st.integers(1, 3))
def test_what_is_free_is_kept_as_it_would_be_told_anew(seed: int, dimensions: int) -> None:
    chart = _grown(seed, dimensions, 150)
    for vertex in range(len(chart)):
        aims = chart.places[vertex] + chart.ways
        inside = ((aims >= chart.low) & (aims <= chart.high)).all(axis=1)
        apart = np.linalg.norm(aims[:, None] - chart.places, axis=-1).min(axis=1) >= NEAREST
        assert np.array_equal(chart.free[vertex], inside & apart & ~chart.region.covers(aims))


def test_vertices_keep_their_distance_and_stay_near_enough() -> None:
    chart = _grown(1, 2)
    apart = np.linalg.norm(chart.places[:, None] - chart.places, axis=-1)
    assert len(chart) > 25
    assert apart[np.triu_indices(len(chart), 1)].min() >= NEAREST
    for number in range(2, len(chart)):
        before = np.sort(apart[number, :number])
        assert before[0] <= FIRST
        assert before[1] <= OTHERS


def test_each_vertex_is_joined_to_its_n_nearest_of_those_before_it() -> None:
    chart = _grown(2, 2, 100)
    apart = np.linalg.norm(chart.places[:, None] - chart.places, axis=-1)
    for number in range(len(chart)):
        joined = {int(a) for a, b in chart.edges if b == number}
        assert joined == set(np.argsort(apart[number, :number], kind="stable")[:2].tolist())


def test_the_first_vertices_have_as_many_neighbours_as_there_are_and_no_simplex() -> None:
    chart = Chart(np.full(2, -5.0), np.full(2, 5.0))
    chart.add(np.zeros(2))
    assert len(chart.edges) == 0
    chart.add(np.array([1.0, 0.0]))
    assert chart.edges.tolist() == [[0, 1]]
    assert len(chart.region) == 0
    chart.add(np.array([0.5, 0.9]))
    assert sorted(chart.edges.tolist()) == [[0, 1], [0, 2], [1, 2]]
    assert len(chart.region) == 1


def test_nothing_is_accepted_outside_the_box_too_near_too_far_or_where_it_is_covered() -> None:
    chart = Chart(np.array([0.0, 0.0]), np.array([3.0, 3.0]))
    for place in ([0.0, 0.0], [1.4, 0.0], [0.7, 1.25]):
        chart.add(np.array(place))
    assert chart.region.covers(np.array([[0.7, 0.42]]))[0]
    assert np.linalg.norm(chart.places - [0.7, 0.42], axis=1).min() > NEAREST
    for place, fits in (([0.7, 0.42], False), ([-0.1, 1.0], False), ([1.9, 0.1], False), ([3.0, 2.0], False), ([1.8, 1.0], True)):
        assert chart.accepts(np.array(place)) is fits


def test_a_chart_cannot_hold_more_than_is_packed() -> None:
    chart = _grown(4, 2, 3000)
    room = (8.0 + NEAREST) ** 2
    assert len(chart) <= room / (NEAREST**2 * np.sqrt(3.0) / 2.0)
