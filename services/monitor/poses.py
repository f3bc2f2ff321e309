"""Draws the poses in which actions ended, over each other (paper fig. 8)."""

from __future__ import annotations

from collections import deque

import numpy as np
import rerun as rr

from mobee.arrays import Array
from mobee.model.kinematics import link_transforms
from mobee.rendering import palette
from mobee.robot.robot import Robot
from services.monitor.blueprint import ROOT

KEPT = 600  # poses
OPACITY = 40  # of 255, of one pose
CHAINS = {"left_arm": ("left_elbow", "left_palm"), "right_arm": ("right_elbow", "right_palm")}
SHOULDERS = {"left_arm": "l_shoulder_pitch", "right_arm": "r_shoulder_pitch"}


class Poses:
    """Logs a cloud of arms to a stream: shoulder, elbow and palm of each pose as a thin line."""

    def __init__(self, stream: rr.RecordingStream, robot: Robot) -> None:
        self._stream, self._robot = stream, robot
        joints = {joint.name: index for index, joint in enumerate(robot.joints)}
        known = (set(robot.markers), set(joints))
        self._chains = {
            part: (joints[SHOULDERS[part]], markers)
            for part, markers in CHAINS.items()
            if set(markers) <= known[0] and SHOULDERS[part] in known[1]
        }
        self._kept: deque[tuple[str, Array]] = deque(maxlen=KEPT)
        stream.log("scene/poses", rr.CoordinateFrame(ROOT), static=True)

    def note(self, q: Array) -> None:
        """The robot at q (n,) rad when an action has ended."""
        transforms = link_transforms(self._robot, q)
        for part, (joint, markers) in self._chains.items():
            shoulder = self._robot.joints[joint]
            points = [transforms[shoulder.parent, :3, :3] @ shoulder.point + transforms[shoulder.parent, :3, 3]]
            for name in markers:
                marker = self._robot.marker(name)
                points.append(transforms[marker.link, :3, :3] @ marker.position + transforms[marker.link, :3, 3])
            self._kept.append((part, np.array(points)))
        colors = [(*palette.PARTS[part], OPACITY) for part, _ in self._kept]
        self._stream.log("scene/poses", rr.LineStrips3D([points for _, points in self._kept], colors=colors, radii=0.0015))
