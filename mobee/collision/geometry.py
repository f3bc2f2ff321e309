"""The four primitive volumes, in metres."""

from __future__ import annotations

from dataclasses import dataclass
from numbers import Real

from mobee.errors import InvalidValue
from mobee.robot.robot import ShapeKind

SMALLEST, LARGEST = 1e-9, 1e5  # m: from lengths between these, depths and forces are finite, and exact to a part of the length


@dataclass(frozen=True, slots=True)
class Geometry:
    """A primitive about its own origin.

    `size` in m: sphere (r,); capsule and cylinder (r, height along local z, a capsule's caps lie beyond it);
    box (x, y, z) full edges.
    """

    kind: ShapeKind
    size: tuple[float, ...]


def sphere(radius: float) -> Geometry:
    """A sphere of this radius [m]; raises InvalidValue unless it is 1e-9 to 1e5."""
    return Geometry("sphere", _lengths("sphere", radius=radius))


def box(x: float, y: float, z: float) -> Geometry:
    """A box with these full edges [m] along its own axes; raises InvalidValue unless they are 1e-9 to 1e5."""
    return Geometry("box", _lengths("box", x=x, y=y, z=z))


def cylinder(radius: float, height: float) -> Geometry:
    """A cylinder about its own z [m]; raises InvalidValue unless both are 1e-9 to 1e5."""
    return Geometry("cylinder", _lengths("cylinder", radius=radius, height=height))


def capsule(radius: float, height: float) -> Geometry:
    """A cylinder about its own z with a half sphere beyond each end [m]; raises InvalidValue unless both are 1e-9 to 1e5."""
    return Geometry("capsule", _lengths("capsule", radius=radius, height=height))


def is_length(value: object) -> bool:
    """Whether that is a number from SMALLEST to LARGEST."""
    return isinstance(value, Real) and not isinstance(value, bool) and SMALLEST <= float(value) <= LARGEST


def _lengths(kind: str, **given: float) -> tuple[float, ...]:
    for name, value in given.items():
        if not is_length(value):
            raise InvalidValue(f"{kind}: {name} is {value!r}; it must be a length of {SMALLEST:g} to {LARGEST:g} m.")
    return tuple(float(value) for value in given.values())
