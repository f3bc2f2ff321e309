"""How far a volume must move along a direction until a plane across it separates it from another: an exact judge of depths.

It knows of a volume only how far it reaches along a direction.  A depth and a normal are right if that is the way along the normal,
and the depth is minimal if it is no longer along any other direction: whoever names a shorter way has found that it is not.
"""

from __future__ import annotations

import numpy as np

from mobee.collision.world_object import WorldObject
from mobee.robot.robot import Array, Shape

Volume = Shape | WorldObject
Place = tuple[Array, Array]
"""Where a volume is: position (3,) m and rotation (3, 3), root frame."""


def way_out(first: Volume, at: Place, second: Volume, there: Place, direction: Array) -> float:
    """How far [m] the first must move along the unit vector (3,) until it is clear of the second."""
    return reach(second, there, direction) + reach(first, at, -direction)


def reach(volume: Volume, place: Place, direction: Array) -> float:
    """How far the volume reaches along the unit vector (3,), from the root's origin [m]."""
    position, rotation = place
    along = rotation.T @ direction
    return float(direction @ position) + _own_reach(volume, along)


def _own_reach(volume: Volume, along: Array) -> float:
    size = volume.size
    if volume.kind == "box":
        return 0.5 * float(np.abs(along) @ size)
    if volume.kind == "convex":
        assert isinstance(volume, Shape) and volume.vertices is not None
        return float((volume.vertices @ along).max())
    if volume.kind == "sphere":
        return size[0]
    side = float(np.hypot(along[0], along[1])) if volume.kind == "cylinder" else 1.0
    return size[0] * side + 0.5 * size[1] * abs(float(along[2]))
