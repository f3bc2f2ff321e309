from __future__ import annotations

import numpy as np
import pytest

from mobee.roadmap.building.chart import directions


@pytest.mark.parametrize(("dimensions", "widest"), [(1, 0.0), (2, 8.0), (3, 20.0), (4, 60.0), (6, 75.0)])
def test_no_direction_is_far_from_all_of_them(dimensions: int, widest: float) -> None:
    ways = directions(dimensions)
    drawn = np.random.default_rng(0).standard_normal((300, dimensions))
    drawn /= np.linalg.norm(drawn, axis=1)[:, None]
    assert np.allclose(np.linalg.norm(ways, axis=1), 1.0)
    angle = np.degrees(np.arccos(np.clip((drawn @ ways.T).max(axis=1), -1.0, 1.0)))
    assert angle.max() <= widest
