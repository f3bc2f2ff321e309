# SPDX-License-Identifier: Apache-2.0
"""The page in a browser: two pictures, and the robot has moved between them."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest

from experiments.kit.live.launch import stop
from experiments.live_picture import find_chromium

SIZE, DRAWN = (800, 500), 85_000  # pixels; bytes: 54 000 without the scene, 75 000 with half of it, 96 000 with all
SCENE = (slice(60, 360), slice(0, 505))  # rows and columns of the 3D panel
BACKGROUND = 40  # brighter than the empty panel

pytestmark = pytest.mark.system


@pytest.mark.skipif(find_chromium() is None, reason="live picture: no Chromium")
def test_the_page_shows_a_robot_that_moves(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "experiments.live_picture", "--scenario", str(Path(__file__).with_name("picture.toml"))]
    command += ["--size", *map(str, SIZE), "--drawn", str(DRAWN), "--shots", "2", "--gap", "5", "--warm-up", "1", "--out", str(tmp_path)]
    page = subprocess.Popen(command, stderr=subprocess.PIPE, text=True, process_group=0)
    try:
        _, said = page.communicate(timeout=240)
    finally:
        stop(page)
    assert page.returncode == 0, said[-3000:]
    before, after = (cv2.imread(str(tmp_path / f"live-{shot}.png"))[SCENE].astype(int) for shot in (1, 2))
    assert (before.max(axis=2) > BACKGROUND).mean() > 0.2  # robot and table are drawn
    assert (np.abs(after - before).max(axis=2) > BACKGROUND).mean() > 0.002  # hundreds of pixels are elsewhere
