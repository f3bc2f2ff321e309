"""A volume to be drawn: what its surface looks like, and how far it reaches."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mobee.arrays import Array
from mobee.robot.robot import ShapeKind

Color = tuple[float, float, float]  # red, green, blue in 0..1


@dataclass(frozen=True, slots=True, eq=False)
class Solid:
    """A convex volume, as a robot's Shape or a WorldObject is one.

    `position` (3,) m, `rotation` (3, 3): root frame.  `opacity`: of 1, less is seen through.  `veiled`: how much of it is still seen where
    something opaque hides it, 0 to 1.  `group`: solids of one group have no outline against each other where they touch.
    `aside`: pictures need not show all of it.
    """

    kind: ShapeKind
    size: tuple[float, ...]
    position: Array
    rotation: Array
    color: Color
    opacity: float = 1.0
    veiled: float = 0.0
    group: int = 0
    vertices: Array | None = None
    aside: bool = False

    def reach(self, along: Array) -> float:
        """How far it extends from its position in a direction (3,), a unit vector, m; as far the other way, but for kind "convex"."""
        x, y, z = along @ self.rotation
        if self.kind == "sphere":
            return self.size[0]
        if self.kind == "box":
            return 0.5 * float(np.abs(np.array([x, y, z])) @ np.array(self.size))
        if self.kind == "convex":
            assert self.vertices is not None
            return float((self.vertices @ np.array([x, y, z])).max())
        radius, height = self.size
        return radius * (1.0 if self.kind == "capsule" else float(np.hypot(x, y))) + 0.5 * height * abs(float(z))


def ball(position: Array, radius: float, color: Color, veiled: float = 0.0, group: int = 0) -> Solid:
    """A sphere at a place (3,) m."""
    return Solid("sphere", (radius,), position, np.eye(3), color, veiled=veiled, group=group)


def tube(points: Array, radius: float, colors: Sequence[Color], veiled: float = 0.0, group: int = 0) -> list[Solid]:
    """A round line through points (P, 3) m, with a colour for each of its P - 1 pieces."""
    pieces = []
    for start, end, color in zip(points[:-1], points[1:], colors, strict=True):
        length = float(np.linalg.norm(end - start))
        turn = _along((end - start) / length) if length > 0.0 else np.eye(3)
        pieces.append(Solid("capsule", (radius, length), 0.5 * (start + end), turn, color, veiled=veiled, group=group))
    return pieces


def _along(z: Array) -> Array:
    """Some rotation (3, 3) that has this unit vector as its z axis."""
    least = np.zeros(3)
    least[np.abs(z).argmin()] = 1.0
    x = np.cross(least, z)
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(z, x), z])
