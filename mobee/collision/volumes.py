"""Many volumes as flat arrays: what they are, and where they are in one pose."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from mobee.robot.robot import Array, Ints, ShapeKind

SPHERE, CAPSULE, CYLINDER, BOX = range(4)
_CODES: dict[ShapeKind, int] = {"sphere": SPHERE, "capsule": CAPSULE, "cylinder": CYLINDER, "box": BOX}


class Volume(Protocol):
    """What a robot's Shape and a WorldObject have in common."""

    @property
    def kind(self) -> ShapeKind: ...  # noqa: D102
    @property
    def size(self) -> tuple[float, ...]: ...  # noqa: D102
    @property
    def position(self) -> Array: ...  # noqa: D102
    @property
    def rotation(self) -> Array: ...  # noqa: D102


@dataclass(frozen=True, slots=True, eq=False)
class Volumes:
    """k volumes on links; each lies inside the capsule given by its core segment and radius (a box also by `half`)."""

    kind: Ints  # (k,) codes
    link: Ints  # (k,)
    frame: Array  # (k, 4, 4) at zero pose, root frame
    size: tuple[tuple[float, ...], ...]
    core: Array  # (k, 3) half of the core segment, local frame, m
    radius: Array  # (k,) about the core, m
    half: Array  # (k, 3) half edges of a box, m
    bound: Array  # (k,) radius of the enclosing sphere, m

    def joined(self, other: Volumes) -> Volumes:
        """These volumes, then the others."""
        arrays = ("kind", "link", "frame", "core", "radius", "half", "bound")
        joint = {name: np.concatenate([getattr(self, name), getattr(other, name)]) for name in arrays}
        return Volumes(size=self.size + other.size, **joint)


@dataclass(frozen=True, slots=True, eq=False)
class Placed:
    """Volumes in one pose, root frame."""

    volumes: Volumes
    center: Array  # (k, 3) m
    rotation: Array  # (k, 3, 3)
    core: Array  # (k, 3) half of the core segment, m


def volumes(items: Sequence[Volume], links: Sequence[int]) -> Volumes:
    """The arrays of these shapes or objects, item i riding on links[i]."""
    k = len(items)
    core, half = np.zeros((k, 3)), np.zeros((k, 3))  # whole lengths until the end
    radius, bound = np.zeros(k), np.zeros(k)
    frame = np.tile(np.eye(4), (k, 1, 1))
    for i, item in enumerate(items):
        frame[i, :3, :3], frame[i, :3, 3] = item.rotation, item.position
        if item.kind == "box":
            longest = max(range(3), key=item.size.__getitem__)
            half[i] = item.size
            core[i, longest] = item.size[longest]
            radius[i] = math.hypot(item.size[longest - 1], item.size[longest - 2])
            bound[i] = math.hypot(*item.size)
        else:
            breadth, height = 2.0 * item.size[0], item.size[1] if len(item.size) > 1 else 0.0
            radius[i], core[i, 2] = breadth, height
            bound[i] = math.hypot(breadth, height) if item.kind == "cylinder" else breadth + height
    return Volumes(
        kind=np.array([_CODES[item.kind] for item in items], dtype=np.intp),
        link=np.array(links, dtype=np.intp),
        frame=frame,
        size=tuple(tuple(item.size) for item in items),
        core=core / 2.0,
        radius=radius / 2.0,
        half=half / 2.0,
        bound=bound / 2.0,
    )


def place(all_volumes: Volumes, transforms: Array) -> Placed:
    """Where the volumes are when the links are at `transforms` (L, 4, 4)."""
    frame = transforms[all_volumes.link] @ all_volumes.frame
    rotation = frame[:, :3, :3]
    return Placed(all_volumes, frame[:, :3, 3], rotation, (rotation @ all_volumes.core[:, :, None])[:, :, 0])
