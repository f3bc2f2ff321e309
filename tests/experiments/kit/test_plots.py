# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import sys

import numpy as np
import pytest

from experiments.kit.plots import MatplotlibMissing, draw_bars, draw_curve, draw_points, draw_stacked_bars, new_figure
from experiments.kit.statistics import interquartile_mean, interval
from mobee.errors import InvalidValue

RUNS = np.random.default_rng(0).normal(size=(8, 3))


@pytest.fixture
def axes():
    pytest.importorskip("matplotlib")
    return new_figure(4.0, 3.0).subplots()


def test_a_curve_goes_through_the_means_in_a_band_of_the_intervals(axes):
    draw_curve(axes, [1, 2, 4], RUNS, "red", "runs")
    assert axes.lines[0].get_ydata() == pytest.approx([interquartile_mean(runs) for runs in RUNS.T])
    corners = {tuple(corner) for corner in axes.collections[0].get_paths()[0].vertices.round(9)}
    assert {(4.0, round(bound, 9)) for bound in interval(RUNS[:, 2])} <= corners


def test_bars_are_as_high_as_the_means_and_whiskers_as_long_as_the_intervals(axes):
    draw_bars(axes, [0.0, 1.0, 2.0], list(RUNS.T), 0.4, "red", "runs")
    assert [bar.get_height() for bar in axes.patches] == pytest.approx([interquartile_mean(runs) for runs in RUNS.T])
    whiskers = axes.collections[0].get_segments()
    assert [tuple(line[:, 1]) for line in whiskers] == [pytest.approx(interval(runs)) for runs in RUNS.T]


def test_an_interval_beside_the_mean_is_no_error(axes):
    draw_bars(axes, [0.0], [np.full(5, 0.1)], 0.4, "red", "runs")
    assert axes.patches[0].get_height() == pytest.approx(0.1)


def test_points_stand_at_the_means(axes):
    draw_points(axes, ["a", "b", "c"], list(RUNS.T), label="runs")
    assert axes.lines[0].get_ydata() == pytest.approx([interquartile_mean(runs) for runs in RUNS.T])


def test_stacked_bars_are_as_high_as_the_sums(axes):
    assert draw_stacked_bars(axes, [np.array([1.0, 2.0]), np.array([0.0, 4.0])]).tolist() == [1.0, 6.0]
    assert max(patch.get_path().vertices[:, 1].max() for patch in axes.patches) == 6.0


def test_a_figure_without_rows_is_refused():
    with pytest.raises(InvalidValue, match="--resume"):
        new_figure(13.0, 2.4 * 0)


def test_without_matplotlib_the_error_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    with pytest.raises(MatplotlibMissing, match=r'pip install "mobee\[figures\]"'):
        new_figure(4.0, 3.0)
