# SPDX-License-Identifier: Apache-2.0
"""The page with its 3D view in a browser that draws in software: two pictures, and the robot has moved between them."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest

from experiments.kit.live.launch import stop
from experiments.live_picture import find_chromium

SIZE = (1000, 560)  # pixels
SCENE = (slice(80, 330), slice(12, 530))  # rows and columns of the 3D view
BACKGROUND = 40  # brighter than the empty view

pytestmark = pytest.mark.system


@pytest.mark.skipif(find_chromium() is None, reason="live picture: no Chromium")
def test_the_page_shows_a_robot_that_moves(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "experiments.live_picture", "--scenario", str(Path(__file__).with_name("picture.toml"))]
    command += ["--size", *map(str, SIZE), "--shots", "2", "--gap", "8", "--warm-up", "8", "--out", str(tmp_path)]
    page = subprocess.Popen(command, stderr=subprocess.PIPE, text=True, process_group=0)
    try:
        _, said = page.communicate(timeout=280)
    finally:
        stop(page)
    assert page.returncode == 0, said[-3000:]
    before, after = (cv2.imread(str(tmp_path / f"live-{shot}.png"))[SCENE].astype(int) for shot in (1, 2))
    assert (before.max(axis=2) > BACKGROUND).mean() > 0.2  # robot and table are drawn
    assert (np.abs(after - before).max(axis=2) > BACKGROUND).mean() > 0.002  # hundreds of pixels are elsewhere
