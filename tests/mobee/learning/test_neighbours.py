# SPDX-License-Identifier: Apache-2.0
"""Which points are nearest does not depend on how they are searched for."""

from __future__ import annotations

import numpy as np
import pytest

from mobee.learning import neighbours


@pytest.mark.parametrize("on_a_lattice", [False, True])
def test_a_tree_finds_what_comparing_all_points_finds(on_a_lattice: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(4)
    points = rng.integers(0, 4, (300, 3)) / 3.0 if on_a_lattice else rng.random((300, 3))
    points = np.unique(points, axis=0)
    asked = rng.random((200, 3))
    found = []
    for few in (len(points), 0):
        monkeypatch.setattr(neighbours, "MAX_COMPARED", few)
        nearest = neighbours.nearest_finder(points)
        found.append((neighbours.nearest_goals(points, 8, tie_seed=1), [nearest(point) for point in asked]))
    assert np.array_equal(found[0][0], found[1][0])
    assert found[0][1] == found[1][1]
