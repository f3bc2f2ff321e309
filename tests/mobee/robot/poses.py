# SPDX-License-Identifier: Apache-2.0
"""Reference poses of the shipped robots."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from mobee.arrays import Array
from mobee.model.kinematics import link_transforms
from mobee.robot.robot import Robot

DATA = Path(__file__).parents[2] / "data"


def reference_poses(name: str) -> list[dict[str, Any]]:
    poses: list[dict[str, Any]] = json.loads((DATA / name).read_text(encoding="utf-8"))["poses"]
    return poses


def motor_vector(robot: Robot, q_deg: dict[str, float]) -> Array:
    q = np.zeros(len(robot.motors))
    for motor, angle in q_deg.items():
        q[robot.motor_index(motor)] = np.deg2rad(angle)
    return q


def marker_frame(robot: Robot, name: str, q: Array) -> tuple[Array, Array, Array]:
    """Position, rotation and normal of a marker at q."""
    marker = robot.marker(name)
    moved = link_transforms(robot, q)[marker.link]
    return moved[:3, :3] @ marker.position + moved[:3, 3], moved[:3, :3] @ marker.rotation, moved[:3, :3] @ marker.normal


def satisfied(robot: Robot, q: Array) -> bool:
    return all(((clause.a @ q + clause.b) > 0).any() for clause in robot.clauses)
