# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from experiments.claims.ch4_vision.robots_teaching_robots import CALIBRATED, EXPERIMENT, LEARNED, UNCALIBRATED, findings, plot
from mobee.vision.teaching.localisers import CORRECTED
from tests.experiments.options import options_of


def cells(off: dict[str, float]) -> dict[str, Any]:
    """Finished cells whose errors have the median `off` cm, and the double at the first point of the learning curve."""

    def values(seed: int) -> dict[str, Any]:
        rng = np.random.default_rng(seed)
        errors = {f"errors, {name}": 1e-2 * cm * (1.0 + 0.01 * rng.standard_normal(101)) for name, cm in off.items()}
        curves = {name: [2e-2 * off[name], 1e-2 * off[name]] for name in LEARNED}
        own = {"counts": [50, 90], "held_out": 20, "poses": 30, "looks": 200, "reported": 5e-4, "robot_seconds": 600.0}
        return {**errors, "curves": curves, **own}

    every = EXPERIMENT.method.cells(options_of(EXPERIMENT))
    return {one.name: SimpleNamespace(cell=one, values=values(one.seed)) for one in every}


GOOD = {UNCALIBRATED: 6.0, CALIBRATED: 0.3, **dict.fromkeys(LEARNED, 1.5), CORRECTED: 0.4}


@pytest.mark.parametrize(
    "worse, verdicts",
    [
        ({}, ["met", "met", "confirmed", "confirmed"]),
        ({CORRECTED: 2.5}, ["not met", "met", "confirmed", "confirmed"]),
        ({"Gaussian process": 2.5}, ["met", "not met", "confirmed", "confirmed"]),
        ({"neural network": 6.0, "genetic programming": 6.0}, ["met", "met", "not reproduced", "not reproduced"]),
    ],
)
def test_each_claim_is_judged_by_its_own_localiser(worse, verdicts):
    found = findings(cells(GOOD | worse))
    assert [claim["verdict"] for claim in found["claims"]] == verdicts
    assert list(found["localisers"]) == [UNCALIBRATED, CALIBRATED, *LEARNED]
    assert found["localisers"][CALIBRATED]["better than uncalibrated stereo"].startswith("20.")


def test_its_figure_is_drawn():
    pytest.importorskip("matplotlib")
    assert len(plot(cells(GOOD)).axes) == 2
