"""Red regions: the same pixels and the same borders as OpenCV finds."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from services.vision.blobs import Mask, Picture, enclosed_area, outer_borders, red_pixels


def red_by_opencv(picture: Picture) -> Mask:
    hsv = cv2.cvtColor(picture, cv2.COLOR_RGB2HSV)
    return cv2.bitwise_or(cv2.inRange(hsv, (0, 130, 50), (8, 255, 255)), cv2.inRange(hsv, (172, 130, 50), (180, 255, 255))) > 0


def test_every_colour_with_every_fifth_red_is_red_or_not_as_opencv_says() -> None:
    green, blue = np.meshgrid(np.arange(256, dtype=np.uint8), np.arange(256, dtype=np.uint8))
    for red in range(0, 256, 5):
        picture = np.stack([np.full_like(green, red), green, blue], axis=-1)
        assert (red_pixels(picture) == red_by_opencv(picture)).all()


@pytest.mark.parametrize("blur", [0.0, 1.0, 2.0])
@pytest.mark.parametrize("share", [0.05, 0.3, 0.6, 0.9])
def test_borders_and_areas_are_those_of_opencv(rng: np.random.Generator, blur: float, share: float) -> None:
    noise = gaussian_filter(rng.random((60, 80)), blur) if blur else rng.random((60, 80))
    mask = noise > np.quantile(noise, 1.0 - share)
    contours, hierarchy = cv2.findContours(mask.astype(np.uint8), cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    outer = [contour[:, 0] for contour, place in zip(contours, hierarchy[0], strict=True) if place[3] < 0]
    expected = {frozenset(map(tuple, border.tolist())): (len(border), cv2.contourArea(border)) for border in outer}
    found = {frozenset(map(tuple, border.tolist())): (len(border), enclosed_area(border)) for border in outer_borders(mask, 1)}
    assert expected
    assert found == expected


def test_small_regions_are_left_out() -> None:
    mask = np.zeros((20, 20), dtype=bool)
    mask[2:4, 2:4] = mask[10:15, 10:15] = True
    (border,) = outer_borders(mask, 5)
    assert enclosed_area(border) == 16.0
    assert outer_borders(np.zeros((5, 5), dtype=bool), 1) == []


def test_a_picture_that_is_all_red_has_one_border() -> None:
    (border,) = outer_borders(np.ones((6, 9), dtype=bool), 1)
    assert enclosed_area(border) == 5 * 8
