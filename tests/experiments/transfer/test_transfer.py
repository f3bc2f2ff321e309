from __future__ import annotations

import numpy as np
import pytest

from experiments.sweep import Cell
from experiments.transfer import work

pytestmark = pytest.mark.timeout(120)


def test_parts_learn_at_once_and_each_makes_its_number_of_transitions():
    cell = Cell("arms-s0", 0, {"task": "arms", "transitions": 4})
    first, again = work(cell), work(cell)
    assert set(first) == {"seen_left_arm", "seen_right_arm"}
    for part, rows in first.items():
        assert rows.shape == (4, 3) and np.array_equal(rows, again[part])
        assert np.array_equal(rows[1:, 0], rows[:-1, 2])
