# SPDX-License-Identifier: Apache-2.0
"""`mobee calibrate`: a simulated robot from the draw of its errors to the file, and bad input."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from mobee.vision.calibration.calibration import load_calibration
from mobee_cli.__main__ import main


def test_a_simulated_robot_finds_its_errors_and_saves_them(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "eyes.json"
    assert main(["calibrate", "--seed", "4", "--postures", "8", "--save", str(file), "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed["calibrated"]["metres_median"] < 0.005 < 0.01 < printed["uncalibrated"]["metres_median"]
    off = [abs(one["value"] - one["true"]) / one["deviation"] for one in printed["parameters"].values()]
    assert np.median(off) < 3.0
    assert load_calibration(file).names == tuple(printed["parameters"])


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--marker", "third_palm"], "unknown marker 'third_palm'"),
        (["--robot", "katana"], "cannot see"),
        (["--seed", "-1"], "must be 0 or more"),
        (["--live", "--robot", "icub"], "only valid without --live"),
    ],
)
def test_bad_input_is_answered_in_one_line(options: list[str], message: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["calibrate", *options]) == 2
    assert message in capsys.readouterr().err
