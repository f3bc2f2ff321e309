# SPDX-License-Identifier: Apache-2.0
"""Places a ball by calibrated cameras, with a covariance that holds all that is uncertain."""

from __future__ import annotations

from collections.abc import Sequence

from mobee.model.kinematics import link_transforms
from mobee.vision.ball import Fix, Sighting, triangulate
from mobee.vision.calibration.calibration import Calibration
from mobee.vision.encoders import Moment
from mobee.vision.imperfections import CameraSettings
from mobee.vision.mount import camera_frames
from mobee.vision.rig import Rig
from mobee.vision.stereo import Sighted, locate

BALL_NOISE = 0.16  # px, standard deviation of a ball's middle along column and row, measured in rendered pictures


def locate_calibrated(
    rig: Rig,
    calibration: Calibration,
    moment: Moment,
    seen: tuple[Sequence[Sighting], Sequence[Sighting]],
    radius: float,
    jitter: float = CameraSettings().jitter,
) -> Fix | None:
    """Return the place of a ball of a radius [m] from the sightings of two cameras that agree best; None if no pair agrees.

    `jitter`: standard deviation of the pictures' stamps, s.
    """
    names = list(rig.cameras)
    transforms = link_transforms(rig.robot, rig.posture(calibration.x, moment.q, moment.dq))
    first, second = (camera_frames(rig.cameras[name], transforms, calibration.x[rig.where(name)]) for name in names)
    pairs = [(fix, a, b) for a in seen[0] for b in seen[1] if (fix := triangulate(a, b, (first, second), radius)) is not None]
    if not pairs:
        return None
    fix, *chosen = min(pairs, key=lambda pair: pair[0].gap)
    pixels = {name: Sighted(rig.lens.project(one.direction), BALL_NOISE) for name, one in zip(names, chosen, strict=True)}
    place = locate(rig, calibration.x, moment, pixels, calibration.covariance, jitter)
    return None if place is None else Fix(place.position, place.covariance, fix.gap)
