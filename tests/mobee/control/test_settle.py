from __future__ import annotations

import numpy as np
import pytest

from mobee.control.settle import Settle, SettleTest
from mobee.errors import InvalidValue

SETTLE = Settle(speed=0.02, acceleration=0.9)
REST = np.zeros(3)


def test_a_resting_part_is_settled_at_the_first_look_and_not_before() -> None:
    test = SettleTest(SETTLE, 5.0)
    assert [test.look(t, REST, REST) for t in (5.0, 5.5, 5.99, 6.0)] == ["moving"] * 3 + ["settled"]


def test_between_two_looks_nobody_looks() -> None:
    test = SettleTest(SETTLE, 0.0)
    assert test.look(1.0, np.array([0.0, 0.03, 0.0]), REST) == "moving"
    assert [test.look(t, REST, REST) for t in (1.1, 1.19, 1.2)] == ["moving", "moving", "settled"]


def test_one_fast_or_accelerated_motor_keeps_the_part_moving() -> None:
    for speeds, accelerations in ((np.array([0.0, -0.021]), np.zeros(2)), (np.zeros(2), np.array([-0.91, 0.0]))):
        assert SettleTest(SETTLE, 0.0).look(1.0, speeds, accelerations) == "moving"
    assert SettleTest(SETTLE, 0.0).look(1.0, np.array([0.02]), np.array([0.9])) == "settled"


def test_a_part_that_never_rests_times_out() -> None:
    test = SettleTest(SETTLE, 1.0)
    verdicts = [test.look(1.0 + 0.01 * k, np.ones(3), REST) for k in range(2001)]
    assert verdicts.count("timeout") == 1 and verdicts[-1] == "timeout"


def test_ticks_that_add_up_to_almost_a_second_count_as_one() -> None:
    test = SettleTest(SETTLE, 0.1)
    assert test.look(sum([0.01] * 110), REST, REST) == "settled"


def test_looks_missed_by_a_late_caller_are_not_made_up_for() -> None:
    test = SettleTest(SETTLE, 0.0)
    assert test.look(1.55, np.ones(3), REST) == "moving"
    assert test.look(1.59, REST, REST) == "moving"
    assert test.look(1.6, REST, REST) == "settled"


def test_a_threshold_of_zero_is_refused() -> None:
    with pytest.raises(InvalidValue, match="speed 0"):
        Settle(speed=0.0, acceleration=1.0)


@pytest.mark.parametrize("change", [{"timeout": np.inf}, {"interval": np.nan}, {"first_look": np.nan}, {"first_look": -1.0}])
def test_times_that_would_never_end_an_action_are_refused(change: dict[str, float]) -> None:
    with pytest.raises(InvalidValue, match=f"settle {next(iter(change))}"):
        Settle(speed=0.02, acceleration=0.9, **change)
