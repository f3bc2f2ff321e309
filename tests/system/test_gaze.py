# SPDX-License-Identifier: Apache-2.0
"""Behaviours in the running system: head and torso follow the ball that vision finds, until it is gone."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from bus_schema import keys
from bus_schema.rpc import Done, Place
from mobee import load_robot
from mobee.behaviours.gaze import Gaze
from mobee.robot.cameras import cameras_of
from services.common import rpc
from tests.system.live import PARTS, Watcher, running, until

ROBOT = load_robot("icub")
GAZE = Gaze(ROBOT, cameras_of(ROBOT), "head")
FOCAL = 120.0 / np.tan(np.deg2rad(25.0))  # px
ON_TABLE, THERE, OUT_OF_SIGHT = np.array([-0.35, 0.0, -0.07]), np.array([-0.48, 0.03, 0.1]), np.array([0.5, 0.0, 1.0])

pytestmark = pytest.mark.system
pytest.importorskip("pybullet")


def place(watcher: Watcher, at: np.ndarray) -> None:
    rpc.call(watcher.session, "test", keys.sim("place"), Place, Done, name="ball", position=at.tolist())


def pixels(watcher: Watcher, at: np.ndarray) -> float:
    """The larger distance of a place from the centre of a picture, by the encoders."""
    seen = GAZE.offsets(np.concatenate([watcher.states[part][-1].q for part in PARTS]), at)
    return float((FOCAL * np.hypot(seen[:, 0], seen[:, 1]) / np.maximum(seen[:, 2], 1e-6)).max())


def leant(watcher: Watcher) -> float:
    """The largest angle of a motor of the torso, which is upright at 0."""
    return float(np.abs(watcher.states["torso"][-1].q).max()) if watcher.states["torso"] else 0.0


def said(watcher: Watcher) -> list[str]:
    return [event.code for event in list(watcher.events) if event.src == "gaze"]


def test_head_and_torso_follow_the_ball_that_vision_sees_and_pause_when_it_is_gone(tmp_path: Path) -> None:
    with running(tmp_path, "gaze") as (_, watcher):
        until(lambda: "gaze_follows" in said(watcher), 30.0, "the ball on the table is seen")
        until(lambda: leant(watcher) > 0.1, 30.0, "the torso leans towards the ball")
        until(lambda: watcher.speed("torso") < 0.02, 20.0, "the torso has leant")
        until(
            lambda: said(watcher)[-1] == "gaze_follows" and pixels(watcher, ON_TABLE) < 15.0,
            20.0,
            "the ball is in the middle of both pictures",
        )
        place(watcher, THERE)
        until(lambda: pixels(watcher, THERE) < 15.0, 20.0, "the ball is in the middle of both pictures at its new place")
        place(watcher, OUT_OF_SIGHT)
        until(lambda: said(watcher)[-1] == "gaze_pauses", 20.0, "the gaze pauses")
        until(lambda: watcher.speed("head") < 0.02, 5.0, "the head rests")
        assert "no place of ball" in watcher.stat("gaze").text and "no place of ball" in watcher.stat("assist").text
        place(watcher, THERE)
        until(lambda: said(watcher)[-1] == "gaze_follows", 20.0, "the ball is seen again")
