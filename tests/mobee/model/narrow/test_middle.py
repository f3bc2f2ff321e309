# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest

from mobee._core.narrow import cut


def test_a_square_is_clipped_by_the_line():
    square = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]])
    left = cut(square, [0.5, 0.0, 1.0, 0.0], room=5)
    assert left == pytest.approx(np.array([[0.5, 0], [1, 0], [1, 1], [0.5, 1]]))


def test_a_cut_never_writes_beyond_its_memory():
    """A zigzag, as rounding may make of an edge: six corners, of which the line would make nine."""
    zigzag = np.array([[0.0, 1], [1, -1], [2, 1], [3, -1], [4, 1], [2, 5]])
    assert len(cut(zigzag, [0.0, 0.0, 0.0, 1.0], room=12)) == 8
    assert len(cut(zigzag, [0.0, 0.0, 0.0, 1.0], room=6)) == 6
