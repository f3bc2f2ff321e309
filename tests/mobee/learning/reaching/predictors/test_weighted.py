# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest

from mobee.errors import InvalidValue
from mobee.learning.reaching.predictors import PREDICTORS, Reaches

HERE, THERE = np.zeros(3), np.array([0.0, 0.03, 0.0])


def test_it_is_optimistic_where_nothing_was_tried_and_far_away():
    predictor = PREDICTORS["weighted"](Reaches(np.zeros((3, 2)), np.zeros((3, 3))))
    assert predictor.mean(HERE).tolist() == [1.0, 1.0, 1.0]
    predictor.add(1, HERE, 0.2, 1.0)
    assert predictor.mean(HERE) == pytest.approx([1.0, 0.6, 1.0])
    assert predictor.mean(THERE) == pytest.approx([1.0, (1 + 0.25 * 0.2) / 1.25, 1.0])
    predictor.add(1, THERE, 0.5, predictor.mean(THERE)[1])
    assert predictor.mean(HERE)[1] == pytest.approx((1 + 0.2 + 0.25 * 0.5) / 2.25)


def test_the_unit_of_distances_is_the_scale():
    predictor = PREDICTORS["weighted"](Reaches(np.zeros((1, 2)), np.zeros((1, 3)), scale=1.0))
    predictor.add(0, HERE, 0.0, 1.0)
    assert predictor.mean(THERE) == pytest.approx([1 / (1 + 1 / 1.03)])


@pytest.mark.parametrize(
    ("samples", "hands", "scale"), [((3, 2), (2, 3), 0.01), ((3,), (3, 3), 0.01), ((3, 2), (3, 3), 0.0), ((3, 2), (3, 3), np.inf)]
)
def test_reaches_that_do_not_fit_are_refused(samples, hands, scale):
    with pytest.raises(InvalidValue, match="hands"):
        Reaches(np.zeros(samples), np.zeros(hands), scale)


@pytest.mark.parametrize("jacobians", [np.zeros((3, 2, 3)), np.full((3, 3, 2), np.nan)])
def test_jacobians_that_do_not_fit_are_refused(jacobians):
    with pytest.raises(InvalidValue, match="jacobians"):
        Reaches(np.zeros((3, 2)), np.zeros((3, 3)), jacobians=jacobians)
