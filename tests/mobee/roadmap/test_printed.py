# SPDX-License-Identifier: Apache-2.0
"""Why Algorithm 4 is not built as it is printed: what becomes of it, and of each reading left out (docs/roadmaps.md)."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from mobee.roadmap.building.frontier_builder import scaled_cost
from mobee.roadmap.ik.terms import Term
from tests.mobee.roadmap.printed import D, run, scalar, vector


def _nearest(places: list[np.ndarray]) -> np.ndarray:
    apart = np.linalg.norm(np.array(places)[:, None] - np.array(places), axis=-1)
    np.fill_diagonal(apart, np.inf)
    return np.asarray(apart.min(axis=1))


def test_with_the_weight_lowered_only_outside_v_it_searches_from_one_vertex_for_ever() -> None:
    """Reading 1: e* falls and is at once replaced by arg max e over V, where every e is still 1, so that arg max is always the first."""
    printed = run(scalar, weight_kept=False, separated=True, half_width=2.0, loops=150)
    assert not printed.ended
    assert set(printed.began[1:]) == {0}
    ours = run(scalar, weight_kept=True, separated=True, half_width=2.0, loops=150)
    assert ours.ended
    assert len(set(ours.began)) > 5


def test_with_d_taken_from_every_coordinate_the_map_is_a_diagonal() -> None:
    """Reading 2: | |y - y'| - d | is meant; (y - y') - d has its minimum at one place beside each vertex."""
    printed, ours = (run(one, weight_kept=True, separated=False, half_width=4.0, loops=14) for one in (vector, scalar))

    def off_the_diagonal(places: list[np.ndarray]) -> float:
        return float(np.median([abs(place[0] - place[1]) for place in places]))

    assert off_the_diagonal(printed.places) < 0.2 * D
    assert off_the_diagonal(ours.places) > 0.6 * D


def test_without_the_test_against_all_vertices_they_pile_up() -> None:
    """Reading 3: the two nearest are repelled, and a sample outside all simplices is added at any distance."""
    printed, ours = (run(scalar, weight_kept=True, separated=one, half_width=2.0, loops=150) for one in (False, True))
    assert _nearest(printed.places).min() < 0.3 * D
    assert _nearest(ours.places).min() >= 0.8 * D
    assert len(printed.places) > 1.5 * len(ours.places)


@pytest.mark.parametrize("missing", [0.0, 0.0025, 0.005, 0.01])
def test_a_term_counts_as_much_as_it_misses_in_tolerances(missing: float) -> None:
    """Reading 7."""
    residual: Any = None  # not called: its values are given
    values = np.array([missing])
    assert scaled_cost(Term("a", residual, 20.0, 0.005), values)[0] == pytest.approx((missing / 0.005) ** 2)
    assert scaled_cost(Term("b", residual, 0.05, None), values)[0] == pytest.approx(0.05 * missing)
    strict = scaled_cost(Term("c", residual, 20.0, 0.0), values)[0]
    assert strict == pytest.approx(1.0 + 200.0 * missing if missing else 0.0)
