from __future__ import annotations

import numpy as np
import pytest

from mobee.errors import InvalidValue
from mobee.roadmap.ik.costs import angle_between, lengths, unit_vector, units, vector


@pytest.mark.parametrize("angle", [0.0, 1e-6, 0.5, np.pi / 2, 3.0, np.pi - 1e-6, np.pi])
def test_angles_are_exact_near_their_ends(angle: float) -> None:
    one, other = np.array([1.0, 0.0, 0.0]), np.array([np.cos(angle), np.sin(angle), 0.0])
    assert angle_between(one, other) == pytest.approx(angle, abs=1e-12)


def test_directions_have_length_one_and_nothing_stays_nothing(rng: np.random.Generator) -> None:
    given = rng.standard_normal((20, 3))
    np.testing.assert_allclose(lengths(units(given)), 1.0)
    np.testing.assert_allclose(units(given) * lengths(given)[:, None], given)
    np.testing.assert_array_equal(units(np.zeros(3)), np.zeros(3))


@pytest.mark.parametrize("given", [[1.0, 2.0], [[1.0, 2.0, 3.0]], [1.0, np.nan, 0.0]])
def test_what_is_not_three_finite_numbers_is_told_by_name(given: list[float]) -> None:
    with pytest.raises(InvalidValue, match="place"):
        vector("place", given)


def test_nothing_is_no_direction() -> None:
    with pytest.raises(InvalidValue, match="goal.*direction"):
        unit_vector("goal", [0.0, 0.0, 0.0])
