"""Random boxes in the robot's workspace."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mobee.collision import Geometry, box
from mobee.kinematics.quaternion import to_matrix
from mobee.robot.robot import Array

SPACE = 1.0  # m, edge of the cube that holds the centres
EDGES = (0.02, 0.1)  # m
# Middle of that cube: where the robot reaches.
MIDDLE = {"icub": (-0.5, 0.0, 0.1), "katana": (0.0, 0.0, 0.0)}


@dataclass(frozen=True, slots=True, eq=False)
class Box:
    """What World.add wants."""

    shape: Geometry
    position: Array  # (3,) m
    rotation: Array  # (3, 3)


def random_boxes(rng: np.random.Generator, robot: str, count: int) -> list[Box]:
    """Boxes of random edges, anywhere in the cube, turned anyhow."""
    middle = np.array(MIDDLE[robot])
    boxes = []
    for _ in range(count):
        quaternion = rng.normal(size=4)
        place = middle + rng.uniform(-SPACE / 2.0, SPACE / 2.0, 3)
        boxes.append(Box(box(*rng.uniform(*EDGES, 3)), place, to_matrix(quaternion / np.linalg.norm(quaternion))))
    return boxes
