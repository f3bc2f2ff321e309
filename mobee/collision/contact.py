"""One contact."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from mobee.robot.robot import Array


@dataclass(frozen=True, slots=True, eq=False)
class Contact:
    """Two volumes that overlap: of the robot's shapes, or a shape of the robot (`first`) and a world object (`second`).

    Moving `first` by depth * normal separates them.  Root frame.  A link of -1 stands for a world object.
    """

    first: str
    second: str
    kind: Literal["solid", "field"]
    depth: float  # m
    normal: Array  # (3,) unit vector, the direction in which `first` must move
    point: Array  # (3,) m, midway between the two deepest points
    first_link: int
    second_link: int
