from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from experiments.table.cycles import at_second_peak, is_cyclic, second_peak
from experiments.table.interest import autocorrelation

RUNS, WINDOWS, LONGEST = 6, 300, 100
PERIOD = 30


def noise(seed):
    return np.random.default_rng(seed).normal(size=(RUNS, WINDOWS))


def curves(rates):
    return np.array([autocorrelation(rate, LONGEST) for rate in rates])


def waves(periods):
    """A period of each run, with a phase of its own."""
    return np.sin(2.0 * np.pi * (np.arange(WINDOWS) / np.array(periods)[:, None] + np.linspace(0.0, 1.0, RUNS)[:, None]))


GHOSTS = curves(noise(1))


def test_touching_that_comes_and_goes_with_one_period_is_cyclic():
    found = curves(waves([PERIOD] * RUNS) + noise(0))
    assert second_peak(found) % PERIOD in (0, 1, PERIOD - 1)
    assert is_cyclic(found, GHOSTS) is True


def test_bouts_that_do_not_return_in_time_are_not():
    bouts = curves(lfilter([1.0], [1.0, -0.4], noise(0)))
    assert bouts[:, 1].min() > GHOSTS[:, 1].max()
    assert is_cyclic(bouts, GHOSTS) is False


def test_what_stands_out_at_longer_lags_without_a_second_peak_is_open():
    assert is_cyclic(curves(lfilter([1.0], [1.0, -0.9], noise(0))), GHOSTS) is None


def test_runs_with_a_period_each_have_none_in_common():
    assert is_cyclic(curves(waves([13, 17, 22, 29, 37, 47]) + noise(0)), GHOSTS) is None


def test_a_period_that_the_ghosts_have_too_shows_nothing():
    waving = waves([PERIOD] * RUNS)
    assert is_cyclic(curves(waving + noise(0)), curves(waving + noise(1))) is not True


def test_a_run_is_looked_at_where_the_others_have_their_peak():
    alone = curves(np.concatenate([waves([PERIOD] * RUNS)[:1], waves([PERIOD / 2] * RUNS)[1:]]))
    here, there = at_second_peak(alone, np.zeros_like(alone))
    assert here[0] == pytest.approx(alone[0, second_peak(alone[1:])])
    assert there == [0.0] * RUNS
