# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import sys

import pytest

from experiments.kit.cells import load_cells
from experiments.kit.engines import RayMissing
from experiments.kit.sweep import CellsFailed, run_cells
from tests.experiments.kit.toy_sweep import cells, options, work


def test_without_ray_the_error_says_what_to_install(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(RayMissing, match=r'pip install "mobee\[cluster\]"'):
        run_cells(work, cells(2), tmp_path, options(str(tmp_path), "--engine", "ray"))


@pytest.mark.system
@pytest.mark.untimed
def test_cells_run_on_ray_and_failed_or_dead_ones_are_named(tmp_path):
    pytest.importorskip("ray")
    with pytest.raises(CellsFailed, match=r"toy-s1: ValueError: the toy is broken\n  toy-s2: its process died|toy-s2: its process died"):
        run_cells(work, cells(5, fails=1, dies=2), tmp_path, options(str(tmp_path), "--engine", "ray", "--jobs", "2"))
    found = load_cells(tmp_path)
    assert set(found) == {"toy-s0", "toy-s3", "toy-s4"}
    assert found["toy-s4"].values["square"] == 16
