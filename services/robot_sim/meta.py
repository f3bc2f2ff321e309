"""What a part is made of."""

from __future__ import annotations

from bus_schema import VERSION
from bus_schema.rpc import PartMeta
from mobee.robot.robot import Robot
from services.common.fingerprint import robot_hash
from services.robot_sim.limits import Limits


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
