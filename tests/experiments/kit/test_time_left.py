from __future__ import annotations

import pytest

from experiments.kit.sweep import TimeLeft


def test_the_time_left_follows_the_costs_of_what_is_done_now():
    time_left = TimeLeft([1.0, 1.0, 4.0, 4.0], [1.0, 4.0, 4.0], start=100.0)
    assert time_left.fraction == pytest.approx(0.1)
    time_left.finished(4.0, 140.0)
    assert time_left.fraction == 0.5 and time_left.seconds == 50.0
    assert str(time_left) == "50 s left"


def test_long_times_are_told_in_minutes_and_hours():
    time_left = TimeLeft([1.0, 100.0], [1.0, 100.0], start=0.0)
    time_left.finished(1.0, 18.0)
    assert str(time_left) == "30 min left"
    time_left = TimeLeft([1.0, 100.0], [1.0, 100.0], start=0.0)
    time_left.finished(1.0, 180.0)
    assert str(time_left) == "5 h 00 min left"


def test_a_sweep_without_work_is_over():
    assert TimeLeft([1.0], [], 0.0).fraction == 1.0
