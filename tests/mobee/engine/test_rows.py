from __future__ import annotations

import numpy as np
import pytest

from mobee.engine.rows import NUMBERS, sort_rows


@pytest.mark.parametrize("count", [0, 1, 2, 3, 10, 500, 4000])
def test_rows_are_sorted_by_kind_first_and_second(count: int, rng: np.random.Generator) -> None:
    numbers = rng.integers(0, 2**29, (count, NUMBERS))
    numbers[:, 1] = rng.integers(0, 2, count)
    numbers[:, 2] = rng.integers(0, 5, count)
    order = np.empty(count, dtype=np.int64)
    sort_rows(numbers.ravel(), np.uint64(count), np.empty(count, dtype=np.int64), order)
    assert np.array_equal(order, np.lexsort((numbers[:, 3], numbers[:, 2], numbers[:, 1])))
