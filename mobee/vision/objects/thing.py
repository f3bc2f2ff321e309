# SPDX-License-Identifier: Apache-2.0
"""The things that a robot can recognise: name, kind of shape, usual size and colour."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

from mobee.model.world import World
from mobee.rendering.solid import Color

Kind = Literal["sphere", "cylinder", "box"]
KINDS: tuple[Kind, ...] = get_args(Kind)
TOLERANCE = 0.1  # relative standard deviation of a size from the usual one


@dataclass(frozen=True, slots=True)
class Thing:
    """A kind of object that vision can recognise by shape, size and colour; a world may have several objects of the kind.

    `kind`: "sphere", "cylinder" or "box". `size` in m: sphere (radius,); cylinder (radius, height); box (x, y, z), full edges. Cylinders
    and boxes stand upright. `color`: red, green, blue, 0 to 1. `tolerance`: relative standard deviation of each length from `size`; 0: the
    size is known exactly.
    """

    name: str
    kind: Kind
    size: tuple[float, ...]
    color: Color
    tolerance: float = TOLERANCE


def things_in(world: World) -> list[Thing]:
    """Return a `Thing` (name, shape, size, colour) for each target of a world that is a sphere, cylinder or box and has a colour.

    A target is an object with the role "target". The positions of the objects are not used.
    """
    kinds: dict[str, Kind] = {kind: kind for kind in KINDS}
    return [
        Thing(item.name, kinds[item.kind], item.size, item.color[:3])
        for item in world.objects.values()
        if item.role == "target" and item.kind in kinds and item.color is not None
    ]
