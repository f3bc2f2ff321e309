# SPDX-License-Identifier: Apache-2.0
"""`mobee calibrate --live`: the running robot looks at its own hand, and vision uses what it has found."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from mobee.robot.cameras import cameras_of
from mobee.robot.load import load_robot
from mobee.vision.calibration.calibration import load_calibration
from mobee.vision.imperfections import CameraSettings, camera_errors
from tests.system.live import running

pytestmark = pytest.mark.system
pytest.importorskip("pybullet")


def test_the_running_robot_finds_its_cameras(tmp_path: Path) -> None:
    file, robot = tmp_path / "eyes.json", load_robot("icub")
    options = ["--live", "--postures", "3", "--save", str(file), "--json"]
    with running(tmp_path, "eyes") as (launched, _):
        command = [sys.executable, "-m", "mobee_cli", "calibrate", *options, "--endpoint", launched.endpoint]
        done = subprocess.run(command, capture_output=True, text=True, timeout=200.0)
    assert done.returncode == 0, done.stderr
    printed = json.loads(done.stdout)
    assert printed["calibrated"]["metres_median"] < 0.006 < 0.012 < printed["uncalibrated"]["metres_median"]
    found = load_calibration(file)
    rig = found.rig(robot, cameras_of(robot))
    true = rig.parameters(camera_errors(CameraSettings(), robot, list(found.cameras), seed=0))
    assert np.median(np.abs(found.x - true) / found.deviations) < 3.0
