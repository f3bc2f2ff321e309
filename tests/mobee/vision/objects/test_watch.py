# SPDX-License-Identifier: Apache-2.0
"""Cameras that fail are noticed, and those that do not are trusted."""

from __future__ import annotations

import numpy as np

from mobee.vision.objects.watch import DARK, SAME, TURN, PictureWatch

Q = np.zeros(6)
PERIOD = 1.0 / 15.0


def noisy(rng: np.random.Generator, brightness: float = 120.0) -> np.ndarray:
    return np.clip(brightness + 2.0 * rng.standard_normal((240, 320, 3)), 0, 255).astype(np.uint8)


def test_new_noisy_pictures_are_trusted(rng: np.random.Generator) -> None:
    watch = PictureWatch(latest=0.3)
    assert [watch.trouble(noisy(rng), k * PERIOD, k * PERIOD + 0.08, Q, True) for k in range(20)] == [None] * 20


def test_a_camera_that_repeats_a_picture_is_frozen_if_it_has_noise_or_turns(rng: np.random.Generator) -> None:
    picture = noisy(rng)
    with_noise, ideal, turning = PictureWatch(0.3), PictureWatch(0.3), PictureWatch(0.3)
    for k in range(SAME + 3):
        t = k * PERIOD
        assert with_noise.trouble(picture, t, t, Q, True) == ("frozen" if k >= SAME - 1 else None)
        assert ideal.trouble(picture, t, t, Q, False) is None  # nothing moves before it
        assert turning.trouble(picture, t, t, Q + k * 0.6 * TURN, False) == ("frozen" if k >= 2 else None)
    assert with_noise.trouble(noisy(rng), 9.0, 9.0, Q, True) is None


def test_old_stamps_and_late_pictures_are_not_used(rng: np.random.Generator) -> None:
    watch = PictureWatch(0.3)
    assert watch.trouble(noisy(rng), 1.0, 1.08, Q, True) is None
    assert watch.trouble(noisy(rng), 1.0, 1.15, Q, True) == "old"
    assert watch.trouble(noisy(rng), 1.1, 1.6, Q, True) == "late"
    assert watch.trouble(noisy(rng), 1.6, 1.68, Q, True) is None


def test_a_black_picture_and_a_dark_room_show_nothing(rng: np.random.Generator) -> None:
    watch = PictureWatch(0.3)
    assert watch.trouble(np.zeros((240, 320, 3), np.uint8), 0.0, 0.0, Q, False) == "dark"
    assert watch.trouble(noisy(rng, 6.0), 0.1, 0.1, Q, True) == "dark"
    lit = noisy(rng, 6.0)
    lit[100:140, 100:140] = 4 * DARK
    assert watch.trouble(lit, 0.2, 0.2, Q, True) is None
