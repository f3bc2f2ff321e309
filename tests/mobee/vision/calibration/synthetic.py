# SPDX-License-Identifier: Apache-2.0
"""What a robot with drawn errors would see of its tag: corners by the prediction, and noise."""

from __future__ import annotations

from functools import cache

import numpy as np

from mobee.model.model import Model
from mobee.model.world_file import load_world
from mobee.robot.cameras import cameras_of
from mobee.robot.load import load_robot
from mobee.vision.calibration.calibration import Observation
from mobee.vision.calibration.observing import choose_postures
from mobee.vision.encoders import Moment
from mobee.vision.imperfections import CameraSettings
from mobee.vision.rig import Rig, see_tag
from mobee.vision.tag import Tag

ROBOT = load_robot("icub")
SETTINGS = CameraSettings()
RIG = Rig(ROBOT, cameras_of(ROBOT), SETTINGS.lens, Tag("left_palm"))
MODEL = Model(ROBOT, load_world("table"))
ENCODERS, CORNERS = np.deg2rad(0.053), 0.25  # rad and px: standard deviations


@cache
def postures() -> np.ndarray:
    return choose_postures(RIG, MODEL, SETTINGS, "left_arm", 40, seed=0)


def observations(x: np.ndarray, seed: int) -> list[Observation]:
    """Two pictures at rest and one in motion in each posture."""
    rng = np.random.default_rng(seed)
    found = []
    for number, q in enumerate(np.repeat(postures(), 3, axis=0)):
        dq = rng.normal(0.0, 0.3, len(q)) * (number % 3 == 0)
        late = dq * rng.normal(0.0, SETTINGS.jitter)
        exact = {camera: see_tag(RIG, camera, x, (q + late)[None], dq[None]).pixels[0] for camera in RIG.cameras}
        corners = {camera: pixels + rng.normal(0.0, CORNERS, (4, 2)) for camera, pixels in exact.items()}
        moment = Moment(q + rng.normal(0.0, ENCODERS, len(q)), dq, np.full(len(q), ENCODERS**2))
        found.append(Observation(moment, corners))
    return found
