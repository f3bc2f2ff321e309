# SPDX-License-Identifier: Apache-2.0
"""Where rays meet; the rest of stereo is tested with the calibration."""

from __future__ import annotations

import numpy as np

from mobee.vision.stereo import nearest_to_rays


def test_rays_through_a_point_meet_there_and_parallel_ones_nowhere(rng: np.random.Generator) -> None:
    points, origins = rng.normal(size=(50, 3)), rng.normal(size=(50, 3, 3))
    rays = points[:, None] - origins
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    np.testing.assert_allclose(nearest_to_rays(origins, rays), points, atol=1e-9)
    rays[0], rays[1, 0] = rays[0, 0], np.nan
    found = nearest_to_rays(origins, rays)
    assert np.isnan(found[:2]).all()
    np.testing.assert_allclose(found[2:], points[2:], atol=1e-9)


def test_the_point_is_as_near_to_skew_rays_as_any_other(rng: np.random.Generator) -> None:
    origins, rays = rng.normal(size=(2, 3)), rng.normal(size=(2, 3))
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)

    def miss(point: np.ndarray) -> float:
        return float((np.cross(point - origins, rays) ** 2).sum())

    best = nearest_to_rays(origins, rays)
    assert all(miss(best + step) > miss(best) for step in 1e-3 * rng.normal(size=(100, 3)))
