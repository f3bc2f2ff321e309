"""The four primitive volumes, in metres."""

from __future__ import annotations

import math
from dataclasses import dataclass
from numbers import Real

from mobee.errors import InvalidValue
from mobee.robot.robot import ShapeKind


@dataclass(frozen=True, slots=True)
class Geometry:
    """A primitive about its own origin.

    `size` in m: sphere (r,); capsule and cylinder (r, height along local z, a capsule's caps lie beyond it);
    box (x, y, z) full edges.
    """

    kind: ShapeKind
    size: tuple[float, ...]


def sphere(radius: float) -> Geometry:
    """A sphere of this radius [m]; raises InvalidValue unless it is positive."""
    return Geometry("sphere", _lengths("sphere", radius=radius))


def box(x: float, y: float, z: float) -> Geometry:
    """A box with these full edges [m] along its own axes; raises InvalidValue unless they are positive."""
    return Geometry("box", _lengths("box", x=x, y=y, z=z))


def cylinder(radius: float, height: float) -> Geometry:
    """A cylinder about its own z [m]; raises InvalidValue unless both are positive."""
    return Geometry("cylinder", _lengths("cylinder", radius=radius, height=height))


def capsule(radius: float, height: float) -> Geometry:
    """A cylinder about its own z with a half sphere beyond each end [m]; raises InvalidValue unless both are positive."""
    return Geometry("capsule", _lengths("capsule", radius=radius, height=height))


def _lengths(kind: str, **given: float) -> tuple[float, ...]:
    for name, value in given.items():
        if isinstance(value, bool) or not isinstance(value, Real) or not 0.0 < float(value) < math.inf:
            raise InvalidValue(f"{kind}: {name} is {value!r}; it must be a positive length in metres.")
    return tuple(float(value) for value in given.values())
