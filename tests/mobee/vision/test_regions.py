# SPDX-License-Identifier: Apache-2.0
"""Regions of masks are those that SciPy finds."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import ndimage
from scipy.spatial import ConvexHull

from mobee._core.vision import regions
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


@pytest.mark.parametrize("seed", range(40))
def test_coloured_regions_and_the_areas_of_their_hulls_are_scipys(seed: int) -> None:
    rng = np.random.default_rng(seed)
    smooth = ndimage.gaussian_filter(rng.standard_normal((40, 60)), rng.uniform(0.7, 4.0))
    likeness = np.where(smooth > rng.uniform(-0.5, 1.0) * smooth.std(), 100.0 + 100.0 * rng.random(smooth.shape), 0.0).astype(np.float32)
    expected = []
    rough = label(likeness > 0.0, diagonal=True)
    for number in range(1, rough.max(initial=0) + 1):
        own = np.where(rough == number, likeness, 0.0)
        share = np.minimum(own / np.maximum(ndimage.maximum_filter(own, 5), 1.0), 1.0)
        parts = label(share >= 0.5, diagonal=False)
        masks = [without_holes(parts == part) for part in range(1, parts.max(initial=0) + 1) if (parts == part).sum() >= 40]
        expected += masks if (rough == number).sum() >= 40 else []
    found = regions(likeness, 40.0, 5)
    assert [one.area for one in found] == [mask.sum() for mask in expected]
    for one, mask in zip(found, expected, strict=True):
        assert len(one.outline) == sum(np.count_nonzero(np.diff(np.pad(mask, 1).astype(np.int8), axis=axis)) for axis in (0, 1))
        assert one.hull == pytest.approx(ConvexHull(one.outline).volume)
        angles = np.arctan2(*(one.outline - one.outline.mean(axis=0)).T[::-1])
        assert (np.diff(angles) >= -1e-9).all()
        inside = np.round(one.outline).astype(int)  # half a pixel beside the region at most
        assert ndimage.binary_dilation(mask, np.ones((3, 3)))[inside[:, 1].clip(0, 39), inside[:, 0].clip(0, 59)].all()


def test_a_picture_without_the_colour_has_no_regions() -> None:
    assert regions(np.zeros((6, 9), np.float32), 40.0, 5) == []
