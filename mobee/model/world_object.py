# SPDX-License-Identifier: Apache-2.0
"""Objects of the world: geometry, position, rotation and role, and the checks of these values."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from numbers import Real
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike

from mobee.arrays import Array, real_array
from mobee.errors import InvalidValue
from mobee.robot.robot import ShapeKind

SMALLEST, LARGEST = 1e-9, 1e5  # m: valid lengths; between them depths and forces are finite and exact relative to the length


@dataclass(frozen=True, slots=True)
class Geometry:
    """A primitive shape, centred at its own origin.

    `kind`: "sphere", "capsule", "cylinder" or "box". `size` in m: sphere (r,); capsule and cylinder (r, height along local z; a capsule's
    caps are beyond it); box (x, y, z), full edges.
    """

    kind: ShapeKind
    size: tuple[float, ...]

    def grown(self, margin: float) -> Geometry:
        """Return a copy of the shape with its surface moved outward by `margin` m; a negative margin moves it inward.

        The new lengths are not checked here; `World.add` raises InvalidValue for a length below 1e-9 m.
        """
        factors = {"sphere": (1.0,), "capsule": (1.0, 0.0), "cylinder": (1.0, 2.0), "box": (2.0, 2.0, 2.0)}[self.kind]
        return Geometry(self.kind, tuple(size + factor * margin for size, factor in zip(self.size, factors, strict=True)))


def sphere(radius: float) -> Geometry:
    """Return a sphere with this radius [m]; raises InvalidValue unless the radius is 1e-9 to 1e5 m."""
    return Geometry("sphere", _lengths("sphere", radius=radius))


def box(x: float, y: float, z: float) -> Geometry:
    """Return a box with full edges x, y and z [m] along its own axes; raises InvalidValue unless each is 1e-9 to 1e5 m."""
    return Geometry("box", _lengths("box", x=x, y=y, z=z))


def cylinder(radius: float, height: float) -> Geometry:
    """Return a cylinder about its own z axis with this radius and height [m]; raises InvalidValue unless each is 1e-9 to 1e5 m."""
    return Geometry("cylinder", _lengths("cylinder", radius=radius, height=height))


def capsule(radius: float, height: float) -> Geometry:
    """Return a capsule: a cylinder about its own z axis with this radius and height [m], with a half sphere beyond each end.

    Raises InvalidValue unless each length is 1e-9 to 1e5 m.
    """
    return Geometry("capsule", _lengths("capsule", radius=radius, height=height))


def is_length(value: object) -> bool:
    """Return whether the value is a number that is valid as a length: 1e-9 to 1e5 m."""
    return isinstance(value, Real) and not isinstance(value, bool) and SMALLEST <= float(value) <= LARGEST


def _lengths(kind: str, **given: float) -> tuple[float, ...]:
    for name, value in given.items():
        if not is_length(value):
            raise InvalidValue(f"{kind}: {name} is {value!r}; it must be a length of {SMALLEST:g} to {LARGEST:g} m.")
    return tuple(float(value) for value in given.values())


Role = Literal["obstacle", "target", "ghost"]
Color = tuple[float, float, float, float]

FRICTION = 0.5  # of objects that do not state theirs
HEAVIEST, ROUGHEST = 1e4, 10.0  # kg, and the largest coefficient of friction, that are taken for numbers that somebody meant
LENGTHS: dict[ShapeKind, int] = {"sphere": 1, "capsule": 2, "cylinder": 2, "box": 3}
_MAX_LENGTH_ERROR, _MAX_SKEW = 1.1e-5, 1e-6  # of a rotation: of the squares of its rows, which are 1, and of products of two rows


@dataclass(frozen=True, slots=True, eq=False)
class WorldObject:
    """A volume in the world.

    `kind`: "sphere", "capsule", "cylinder" or "box". `size` in m, as in `Geometry`: sphere (radius,); capsule and cylinder (radius,
    height); box (x, y, z), full edges. `position` (3,) m, `rotation` (3, 3): in the root frame; for an attached object, in the frame of
    `link`, which is the root frame at zero pose. `role`: "obstacle", "target" or "ghost". `color`: red, green, blue and opacity, each 0 to
    1; None: not stated. `link`: name of the link that carries the object; None: it is attached to none. `mass`: kg, of an object that a
    physics engine moves when it is pushed; None: it does not move. `friction`: coefficient of friction between an object with a mass and
    everything that it touches.
    """

    name: str
    kind: ShapeKind
    size: tuple[float, ...]
    position: Array
    rotation: Array
    role: Role = "obstacle"
    color: Color | None = None
    link: str | None = None
    mass: float | None = None
    friction: float = FRICTION

    def __post_init__(self) -> None:
        """Copy the arrays, and protect the copies from changes, because all states of the world that contain the object share them."""
        for name in ("position", "rotation"):
            values: Array = getattr(self, name)
            if values.flags.writeable:
                values = values.copy()
                values.flags.writeable = False
                object.__setattr__(self, name, values)

    @property
    def movable(self) -> bool:
        """Whether the object has a mass, so that a physics engine moves it: it can be pushed, lifted and knocked over."""
        return self.mass is not None


def placed(thing: WorldObject, link_pose: Array) -> WorldObject:
    """Return a free copy of an attached object, at the place that it has while the transform of its link is `link_pose` (4, 4)."""
    turn, shift = link_pose[:3, :3], link_pose[:3, 3]
    return replace(thing, position=turn @ thing.position + shift, rotation=turn @ thing.rotation, link=None)


def seen_from(link_pose: Array, thing: WorldObject) -> tuple[Array, Array]:
    """Return the position (3,) m and the rotation (3, 3) of a free object in the frame of a link whose transform is `link_pose` (4, 4)."""
    back = link_pose[:3, :3].T
    return back @ (thing.position - link_pose[:3, 3]), back @ thing.rotation


def valid_name(name: str) -> str:
    """Return the name of a world object unchanged; raises InvalidValue unless it is text that is not empty."""
    if not isinstance(name, str) or not name:
        raise InvalidValue(f"world object {name!r}: its name must be text that is not empty.")
    return name


def valid_shape(name: str, shape: Geometry) -> Geometry:
    """Return the shape of a world object unchanged; raises InvalidValue unless it is a sphere, capsule, cylinder or box of valid lengths.

    `name`: name of the object, for the message.
    """
    if not isinstance(shape, Geometry):
        raise InvalidValue(f"world object {name!r}: shape {shape!r}; it must be a Geometry, as sphere(0.1), box, cylinder or capsule.")
    lengths = LENGTHS.get(shape.kind)
    if lengths is None:
        raise InvalidValue(f"world object {name!r}: a {shape.kind!r} cannot be in the world; valid: {', '.join(LENGTHS)}.")
    if len(shape.size) != lengths or not all(is_length(length) for length in shape.size):
        valid = f"{lengths} lengths of {SMALLEST:g} to {LARGEST:g} m"
        raise InvalidValue(f"world object {name!r}: {shape.kind} of size {shape.size}; it must be {valid}.")
    return shape


def valid_position(name: str, given: ArrayLike) -> Array:
    """Return a copy of the position `given` (3,) m; raises InvalidValue unless it is three finite numbers.

    `name`: name of the object, for the message.
    """
    value = _numbers(given)
    if value is None or value.shape != (3,) or not np.isfinite(value).all():
        raise InvalidValue(f"world object {name!r}: position {given!r}; it must be three finite numbers in metres.")
    return value


def valid_rotation(name: str, given: ArrayLike) -> Array:
    """Return a copy of the rotation `given` (3, 3); raises InvalidValue unless it is orthonormal and right-handed.

    `name`: name of the object, for the message.
    """
    value = _numbers(given)
    if value is None or value.shape != (3, 3) or not _is_rotation(value):
        raise InvalidValue(f"world object {name!r}: rotation {given!r}; it must be a (3, 3) rotation matrix.")
    return value


def _numbers(given: ArrayLike) -> Array | None:
    """Return a copy as an array; None if it is no array of real numbers."""
    try:
        return real_array("", given)
    except InvalidValue:
        return None


def _is_rotation(value: Array) -> bool:
    """Return whether a matrix is orthonormal and right-handed.

    Plain floats, not NumPy: a product of matrices releases the interpreter's lock for a moment, and a thread that edits without a
    pause would then get it back before any other thread.
    """
    (a, b, c), (d, e, f), (g, h, i) = value.tolist()
    squares = a * a + b * b + c * c, d * d + e * e + f * f, g * g + h * h + i * i
    products = a * d + b * e + c * f, a * g + b * h + c * i, d * g + e * h + f * i
    orthonormal = all(abs(one - 1.0) <= _MAX_LENGTH_ERROR for one in squares) and all(abs(one) <= _MAX_SKEW for one in products)
    return orthonormal and a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g) > 0.0


def valid_role(name: str, role: Role) -> Role:
    """Return the role unchanged; raises InvalidValue unless it is "obstacle", "target" or "ghost".

    `name`: name of the object, for the message.
    """
    if role not in get_args(Role):
        raise InvalidValue(f"world object {name!r}: role {role!r}; valid: {', '.join(get_args(Role))}.")
    return role


def valid_mass(name: str, mass: float | None) -> float | None:
    """Return the mass [kg] as a float, or None for an object that does not move; raises InvalidValue unless it is above 0, at most 10 t.

    `name`: name of the object, for the message.
    """
    if mass is not None and not (_is_number(mass) and 0.0 < mass <= HEAVIEST):
        raise InvalidValue(f"world object {name!r}: mass {mass!r}; it must be above 0 and at most {HEAVIEST:g} kg.")
    return None if mass is None else float(mass)


def valid_friction(name: str, friction: float) -> float:
    """Return the coefficient of friction as a float; raises InvalidValue unless it is 0 to 10.

    `name`: name of the object, for the message.
    """
    if not (_is_number(friction) and 0.0 <= friction <= ROUGHEST):
        raise InvalidValue(f"world object {name!r}: friction {friction!r}; it must be a coefficient of 0 to {ROUGHEST:g}.")
    return float(friction)


def _is_number(value: object) -> bool:
    return isinstance(value, Real) and not isinstance(value, bool)


def valid_color(name: str, given: Sequence[float] | None) -> Color | None:
    """Return a colour as (red, green, blue, opacity), the opacity 1 if not given; None for None.

    `name`: name of the object, for the message. Raises InvalidValue unless there are 3 or 4 numbers, each 0 to 1.
    """
    if given is None:
        return None
    found = _numbers(given)
    channels = () if found is None or found.ndim != 1 else tuple(found.tolist())
    if len(channels) == 3:
        channels = (*channels, 1.0)
    if len(channels) != 4 or not all(0.0 <= c <= 1.0 for c in channels):
        raise InvalidValue(f"world object {name!r}: color {given!r}; it must be red, green, blue and optionally opacity, each 0 to 1.")
    return channels[0], channels[1], channels[2], channels[3]
