# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mobee.errors import InvalidValue
from mobee.learning.object_space import Grid

GRID = Grid((-0.4, -0.1), (0.0, 0.4), (3, 2), margin=0.02)


def test_cells_are_numbered_along_x_first_and_places_outside_belong_to_the_nearest() -> None:
    assert [GRID.cell_of(GRID.centre(cell)) for cell in range(len(GRID))] == list(range(6))
    assert GRID.centre(4) == pytest.approx([-0.25, 0.3])
    assert GRID.cell_of((-9.0, 0.1, 5.0)) == 0 and GRID.cell_of((9.0, 9.0)) == 5
    assert Grid(**GRID.settings).settings == GRID.settings


@given(st.floats(-0.6, 0.1), st.floats(-0.2, 0.6), st.integers(0, 5), st.integers(0, 2**32))
def test_errors_below_half_the_margin_never_change_the_cell_of_an_object_at_rest(x, y, before, seed) -> None:
    rng = np.random.default_rng(seed)
    cells = [GRID.cell_of((x, y), before)]
    for _ in range(20):
        cells.append(GRID.cell_of(np.array([x, y]) + rng.uniform(-0.0099, 0.0099, 2), cells[-1]))
    assert len(set(cells[1:])) == 1


def test_the_cell_changes_beyond_the_margin() -> None:
    assert GRID.cell_of((-0.29, 0.1)) == 1 and GRID.cell_of((-0.29, 0.1), before=0) == 0
    assert GRID.cell_of((-0.27, 0.1), before=0) == 1
    assert GRID.cell_of((-9.0, 0.1), before=1) == 0


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"x": (0.1, 0.1)}, "lowest and highest"),
        ({"x": (0.1,)}, "x and y of the grid is"),
        ({"x": (0.0, 0.1, 0.2), "y": (0.0, 0.1, 0.2)}, "lowest and highest"),
        ({"x": "ab"}, "x and y of the grid is"),
        ({"shape": 3}, "number of cells"),
        ({"margin": "none"}, "margin='none'"),
        ({"y": (0.0, np.inf)}, "lowest and highest"),
        ({"shape": (1, 1)}, "two cells or more"),
        ({"shape": (0, 3)}, "two cells or more"),
        ({"margin": 0.05}, "below 0.05 m"),
        ({"margin": -0.01}, "half of a cell"),
    ],
)
def test_arguments_that_do_not_fit_are_refused(change, message) -> None:
    with pytest.raises(InvalidValue, match=message):
        Grid(**({"x": (0.0, 0.3), "y": (0.0, 0.3), "shape": (3, 3)} | change))


def test_numbers_of_numpy_make_the_same_grid_as_plain_ones() -> None:
    made = Grid(np.array([-0.4, -0.1]), np.array([0.0, 0.4]), np.array([3, 2]), margin=np.float64(0.02))  # type: ignore[arg-type]
    assert json.dumps(made.settings) == json.dumps(GRID.settings)


@pytest.mark.parametrize("place", [(np.nan, 0.0), (0.0,), "here"])
def test_a_place_must_be_finite_numbers(place) -> None:
    with pytest.raises(InvalidValue):
        GRID.cell_of(place)
