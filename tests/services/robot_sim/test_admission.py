from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bus_schema import Refused
from services.robot_sim.admission import MARGIN, START, Admission, Order
from tests.services.robot_sim.gated import LIMITS, N

FINE = np.full(N, 0.01)


def order(position: float) -> Order:
    reference = LIMITS.upper.copy()
    reference[0] += position
    return Order("controller", 1, 1, 1, "position", reference, 100)


@pytest.mark.parametrize("fine", [np.ones(N), FINE])
def test_a_position_may_be_beyond_its_limit_by_as_much_as_the_motor_is_exact(fine: np.ndarray) -> None:
    admission = Admission("torso", replace(LIMITS, fine=fine), 0.01, None)
    admission.check(order(0.9 * MARGIN * fine[0]), 1)
    with pytest.raises(Refused, match="rad beyond a limit"):
        admission.check(order(1.1 * MARGIN * fine[0]), 1)


@pytest.mark.parametrize("fine", [np.ones(N), FINE])
def test_the_first_position_may_be_as_far_from_the_measured_one(fine: np.ndarray) -> None:
    admission, q = Admission("torso", replace(LIMITS, fine=fine), 0.01, None), np.zeros(N)
    admission.check_step(q + 0.9 * START * fine, None, 1, q)
    with pytest.raises(Refused, match="a jump of"):
        admission.check_step(q + 1.1 * START * fine, None, 1, q)
