"""The smallest sphere, capsule, cylinder or box around points, as far as a search over their natural axes finds it."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi

import numpy as np

from mobee.robot.robot import Array, ShapeKind
from mobee.robot.xml_volume import Z, align

STEPS = 400  # of the centre towards the farthest point; the radius is then right to a fraction of a percent
ROOM = 1e-9  # m, so that rounding leaves no point outside
LEAST = 1e-6  # m, the least edge, radius or height, for flat and thin meshes


@dataclass(frozen=True, slots=True, eq=False)
class Primitive:
    """A volume without a name: kind and size as in mobee.robot.robot.Shape, centre (3,) m and orientation (3, 3)."""

    kind: ShapeKind
    size: tuple[float, ...]
    centre: Array
    rotation: Array

    @property
    def volume(self) -> float:
        """In [m^3]."""
        match self.kind:
            case "sphere":
                return 4 / 3 * pi * self.size[0] ** 3
            case "capsule":
                return pi * self.size[0] ** 2 * (self.size[1] + 4 / 3 * self.size[0])
            case "cylinder":
                return pi * self.size[0] ** 2 * self.size[1]
            case _:
                return self.size[0] * self.size[1] * self.size[2]


def smallest(points: Array) -> Primitive:
    """The primitive of least volume that holds all points (v, 3) m."""
    axes = _axes(points)
    boxes = [_box(points, frame) for frame in axes]
    round_ones = [fit(points, axis) for frame in axes for axis in frame.T for fit in (capsule_along, _cylinder)]
    return min([bounding_sphere(points), *boxes, *round_ones], key=lambda one: one.volume)


def smallest_capsule(points: Array) -> Primitive:
    """The capsule of least volume that holds all points, its axis one of their natural axes."""
    return min((capsule_along(points, axis) for frame in _axes(points) for axis in frame.T), key=lambda one: one.volume)


def bounding_sphere(points: Array) -> Primitive:
    """A sphere around all points, little larger than the smallest."""
    centre = _centre(points)
    radius = float(np.linalg.norm(points - centre, axis=1).max())
    return Primitive("sphere", (max(radius, LEAST) + ROOM,), centre, np.eye(3))


def capsule_along(points: Array, axis: Array) -> Primitive:
    """The shortest capsule along a unit axis that holds all points, with the radius of the cylinder around them."""
    rotation, centre, radius, off, along = _around(points, axis)
    reach = np.sqrt(np.maximum(radius**2 - off**2, 0.0))  # how far beyond its cap's centre a point may lie
    low, high = float((along + reach).min()), float((along - reach).max())
    middle, height = (low + high) / 2.0, max(high - low, 0.0)
    if height == 0.0:  # then the point that is farthest from the middle sets the radius
        radius = float(np.hypot(off, along - middle).max())
    size = (max(radius, LEAST) + ROOM, max(height, LEAST))
    return Primitive("capsule", size, centre + middle * axis, rotation)


def _cylinder(points: Array, axis: Array) -> Primitive:
    rotation, centre, radius, _, along = _around(points, axis)
    low, high = float(along.min()), float(along.max())
    size = (max(radius, LEAST) + ROOM, max(high - low, LEAST) + 2 * ROOM)
    return Primitive("cylinder", size, centre + (low + high) / 2.0 * axis, rotation)


def _box(points: Array, frame: Array) -> Primitive:
    local = points @ frame
    low, high = local.min(axis=0), local.max(axis=0)
    width, height, depth = (float(edge) for edge in np.maximum(high - low, LEAST) + 2 * ROOM)
    return Primitive("box", (width, height, depth), frame @ ((low + high) / 2.0), frame)


def _around(points: Array, axis: Array) -> tuple[Array, Array, float, Array, Array]:
    """Orientation, a point of the best axis, its radius, and of each point the distance from it and the place along it."""
    rotation = align(Z, axis)
    local = points @ rotation
    middle = _centre(local[:, :2])
    off = np.linalg.norm(local[:, :2] - middle, axis=1)
    return rotation, rotation[:, :2] @ middle, float(off.max()), off, local[:, 2]


def _centre(points: Array) -> Array:
    """About the centre of the smallest ball around points of any dimension (Badoiu and Clarkson's walk)."""
    centre: Array = (points.min(axis=0) + points.max(axis=0)) / 2.0
    best, least = centre, float(np.linalg.norm(points - centre, axis=1).max())
    for step in range(1, STEPS):
        distances = np.linalg.norm(points - centre, axis=1)
        far = int(distances.argmax())
        if distances[far] < least:
            best, least = centre, float(distances[far])
        centre = centre + (points[far] - centre) / (step + 1)
    return best


def _axes(points: Array) -> list[Array]:
    """Frames (3, 3), axes in columns, in which a tight fit is likely: the mesh's own, and the main axes of its points."""
    spread = points - points.mean(axis=0)
    main: Array = np.linalg.svd(spread.T @ spread)[0]
    if np.linalg.det(main) < 0:
        main = main * np.array([1.0, 1.0, -1.0])
    return [np.eye(3), main]
