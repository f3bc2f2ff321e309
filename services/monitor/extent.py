"""Where a robot is and how large, for whoever looks at it."""

from __future__ import annotations

import numpy as np

from mobee.kinematics import link_transforms
from mobee.robot.robot import Array, Robot

VIEWPOINT = np.array([-1.0, -0.9, 0.6])  # direction from which a robot is seen
DISTANCE = 1.4  # of the eye, in diameters of the robot
SMALLEST = 0.1  # m


def extent_of(robot: Robot) -> tuple[Array, float]:
    """Centre (3,) and diameter [m] of the robot at home."""
    transforms = link_transforms(robot, np.clip(robot.home, *robot.limits.T))
    links = [shape.link for shape in robot.shapes] + [joint.parent for joint in robot.joints]
    places = [shape.position for shape in robot.shapes] + [joint.point for joint in robot.joints]
    points = np.array([transforms[link, :3, :3] @ place + transforms[link, :3, 3] for link, place in zip(links, places, strict=True)])
    low, high = points.min(axis=0), points.max(axis=0)
    return (low + high) / 2.0, float(max(np.linalg.norm(high - low), SMALLEST))


def eye_of(robot: Robot) -> tuple[Array, Array]:
    """From where the whole robot is seen, and the middle of what is seen, each (3,) m."""
    centre, diameter = extent_of(robot)
    eye: Array = centre + DISTANCE * diameter * VIEWPOINT / np.linalg.norm(VIEWPOINT)
    return eye, centre
