from __future__ import annotations

import numpy as np
import pytest

from mobee.engine.compiled import entry
from mobee.engine.narrow.middle import _cut


@entry("uint64(float64[::1], uint64, float64, float64, float64, float64, float64[::1])")
def cut(points, count, x, y, nx, ny, out):
    return _cut(points, count, x, y, nx, ny, out)


def test_a_square_loses_what_is_beyond_the_line():
    square, out = np.array([0.0, 0, 1, 0, 1, 1, 0, 1]), np.zeros(10)
    assert cut(square, 4, 0.5, 0.0, 1.0, 0.0, out) == 4
    assert out[:8].reshape(4, 2) == pytest.approx(np.array([[0.5, 0], [1, 0], [1, 1], [0.5, 1]]))


def test_a_cut_never_writes_beyond_its_memory():
    """A zigzag, as rounding may make of an edge: six corners, of which the line would make nine."""
    zigzag = np.array([0.0, 1, 1, -1, 2, 1, 3, -1, 4, 1, 2, 5])
    whole, memory = np.full(24, np.nan), np.full(24, np.nan)
    assert cut(zigzag, 6, 0.0, 0.0, 0.0, 1.0, whole) == 8
    assert cut(zigzag, 6, 0.0, 0.0, 0.0, 1.0, memory[:12]) == 6
    assert np.isnan(memory[12:]).all()
