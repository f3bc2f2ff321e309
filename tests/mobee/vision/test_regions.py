# SPDX-License-Identifier: Apache-2.0
"""Regions of masks are those that SciPy finds."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import ndimage

from mobee.vision.regions import border, boxes, label, without_holes


@pytest.mark.parametrize("seed", range(300))
def test_regions_boxes_holes_and_borders_are_scipys(seed: int) -> None:
    rng = np.random.default_rng(seed)
    mask = rng.random(rng.integers(1, 40, 2)) < rng.uniform(0.02, 0.98)
    labels, diagonally = label(mask, diagonal=False), label(mask, diagonal=True)
    expected = ndimage.label(mask, np.ones((3, 3)))[0]
    assert np.array_equal(labels, ndimage.label(mask)[0])
    assert np.array_equal(diagonally, expected)
    assert boxes(diagonally) == ndimage.find_objects(expected)
    assert np.array_equal(without_holes(mask), ndimage.binary_fill_holes(mask))
    assert np.array_equal(border(mask), mask & ~ndimage.binary_erosion(mask))


@pytest.mark.parametrize("value", [False, True])
def test_a_mask_of_one_value(value: bool) -> None:
    mask = np.full((5, 7), value)
    assert (label(mask, diagonal=True) == int(value)).all()
    assert boxes(label(mask, diagonal=True)) == ([(slice(0, 5), slice(0, 7))] if value else [])


def test_a_spiral_is_one_region() -> None:
    spiral = np.array([[1, 1, 1, 1, 1], [0, 0, 0, 0, 1], [1, 1, 1, 0, 1], [1, 0, 0, 0, 1], [1, 1, 1, 1, 1]], dtype=bool)
    assert label(spiral, diagonal=False).max() == 1
