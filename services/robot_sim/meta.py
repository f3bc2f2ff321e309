"""What a part is made of, and a fingerprint by which two processes see that they mean the same robot."""

from __future__ import annotations

import hashlib

import numpy as np

from bus_schema import VERSION
from bus_schema.rpc import PartMeta
from mobee.robot.robot import Robot
from services.robot_sim.limits import Limits


def robot_hash(robot: Robot) -> str:
    """Hash of names, tree and motors; the shapes do not matter to who drives it."""
    digest = hashlib.sha256(repr((robot.name, robot.links, robot.motors)).encode())
    for joint in robot.joints:
        digest.update(repr((joint.name, joint.parent, joint.kind)).encode())
        digest.update(np.concatenate([joint.axis, joint.point, joint.limits]).tobytes())
    digest.update(np.array([(*m.limits, m.max_velocity, m.max_acceleration, m.max_torque) for m in robot.motor_table]).tobytes())
    return digest.hexdigest()[:16]


def part_meta(robot: Robot, part: str) -> PartMeta:
    """The part's motors and their limits."""
    limits = Limits.of(robot, part)
    return PartMeta(
        v=VERSION,
        part=part,
        motors=list(robot.part(part).motors),
        lower=limits.lower.tolist(),
        upper=limits.upper.tolist(),
        max_velocity=limits.velocity.tolist(),
        max_acceleration=limits.acceleration.tolist(),
        max_torque=limits.torque.tolist(),
        robot=robot.name,
        robot_hash=robot_hash(robot),
    )
