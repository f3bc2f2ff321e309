"""A fingerprint by which two processes see that they mean the same robot."""

from __future__ import annotations

import hashlib

import numpy as np

from mobee.robot.robot import Robot


def robot_hash(robot: Robot) -> str:
    """Hash of names, tree and motors; the shapes do not matter to who drives it."""
    digest = hashlib.sha256(repr((robot.name, robot.links, robot.motors)).encode())
    for joint in robot.joints:
        digest.update(repr((joint.name, joint.parent, joint.kind)).encode())
        digest.update(np.concatenate([joint.axis, joint.point, joint.limits]).tobytes())
    digest.update(np.array([(*m.limits, m.max_velocity, m.max_acceleration, m.max_torque) for m in robot.motor_table]).tobytes())
    return digest.hexdigest()[:16]
