# SPDX-License-Identifier: Apache-2.0
"""Lenses: projection, its inverse and its derivative."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mobee import InvalidValue
from mobee.model.world import World
from mobee.rendering.scene import Scene
from mobee.robot.cameras import cameras_of
from mobee.robot.load import load_robot
from mobee.vision.lens import DRAGONFLY, Lens

PIXELS = st.tuples(st.floats(0.0, 319.0), st.floats(0.0, 239.0))
POINTS = st.tuples(st.floats(-0.8, 0.8), st.floats(-0.6, 0.6), st.floats(0.05, 3.0)).map(
    lambda p: np.array([p[0] * p[2], p[1] * p[2], p[2]])
)


@given(PIXELS)
def test_a_pixel_is_where_its_ray_is_projected(pixel: tuple[float, float]) -> None:
    ray = DRAGONFLY.unproject(np.array(pixel))
    assert np.linalg.norm(ray) == pytest.approx(1.0)
    np.testing.assert_allclose(DRAGONFLY.project(0.7 * ray), pixel, atol=1e-9)


@given(POINTS)
def test_projection_is_that_of_opencv(point: np.ndarray) -> None:
    wanted, _ = cv2.projectPoints(point[None], np.zeros(3), np.zeros(3), DRAGONFLY.matrix, np.array([*DRAGONFLY.distortion, 0.0]))
    np.testing.assert_allclose(DRAGONFLY.project(point), wanted.ravel(), atol=1e-9)


@given(POINTS)
def test_the_derivative_of_the_projection_is_its_slope(point: np.ndarray) -> None:
    step = 1e-6 * point[2]
    numbers = [(DRAGONFLY.project(point + step * axis) - DRAGONFLY.project(point - step * axis)) / (2.0 * step) for axis in np.eye(3)]
    np.testing.assert_allclose(DRAGONFLY.projection_slope(point), np.stack(numbers, axis=1), rtol=1e-5, atol=1e-4 / point[2])


def test_a_direction_that_the_lens_does_not_show_has_no_ray_and_no_pixel() -> None:
    barrel = Lens(200.0, 200.0, 160.0, 120.0, k1=-0.4)  # folds back beyond 1 / sqrt(1.2)
    assert np.isnan(barrel.unproject(np.array([160.0 + 200.0, 120.0]))).all()
    assert np.isnan(DRAGONFLY.project(np.array([0.0, 0.0, -1.0]))).all()


@pytest.mark.parametrize(
    ("k1", "k2", "fold"),
    [(-0.4, 0.0, 1.0 / np.sqrt(1.2)), (-0.5, 0.1, 1.0), (-0.1, -0.05, np.sqrt((np.sqrt(0.3**2 + 1.0) - 0.3) / 0.5)), (0.2, 0.1, np.inf)],
    ids=["barrel", "barrel that unfolds again", "both", "pincushion"],
)
def test_a_point_beyond_the_fold_of_the_lens_has_no_pixel(k1: float, k2: float, fold: float) -> None:
    """Opposite signs, a lens that folds, and then grows again: only what is before the first fold is shown."""
    lens = Lens(200.0, 200.0, 160.0, 120.0, k1, k2)
    radii = np.array([0.5, 0.98, 1.02, 1.2, 1.45, 1.6, 3.0]) * (1.0 if np.isinf(fold) else fold)
    points = np.stack([0.6 * radii, -0.8 * radii, np.ones(len(radii))], axis=1)
    pixels = lens.project(points)
    shown = radii < fold
    assert np.isfinite(pixels[shown]).all() and np.isnan(pixels[~shown]).all()
    np.testing.assert_allclose(lens.unproject(pixels[shown])[:, :2], (points / np.linalg.norm(points, axis=1, keepdims=True))[shown, :2])


@given(st.tuples(st.floats(-3.0, 3.0), st.floats(-3.0, 3.0)), st.tuples(st.floats(-0.6, 0.6), st.floats(-0.3, 0.3)))
def test_no_two_points_have_the_same_pixel(flat: tuple[float, float], radial: tuple[float, float]) -> None:
    lens = Lens(200.0, 200.0, 160.0, 120.0, *radial, 1e-3, -1e-3)
    ray = lens.unproject(lens.project(np.array([*flat, 1.0])))
    assert np.isnan(ray).all() or ray[:2] / ray[2] == pytest.approx(flat, abs=1e-6)


def test_the_ideal_lens_is_that_of_the_renderer() -> None:
    robot = load_robot("icub")
    scene = Scene(robot, World())
    ideal = Lens.ideal(cameras_of(robot)["left"].view_deg, 320, 240)
    np.testing.assert_allclose(ideal.matrix, scene.intrinsics("left"), rtol=1e-12)


def test_a_lens_without_a_focal_length_is_refused() -> None:
    with pytest.raises(InvalidValue, match="fx fy cx cy"):
        Lens(0.0, 200.0, 160.0, 120.0)
