# SPDX-License-Identifier: Apache-2.0
"""The visuals and cameras of a robot's file; a visual names its mesh, which is read when it is drawn."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from mobee.arrays import Array

VisualKind = Literal["sphere", "capsule", "cylinder", "box", "ellipsoid", "mesh"]
Channels = tuple[float, float, float, float]  # red, green, blue, opacity in 0..1


@dataclass(frozen=True, slots=True)
class MeshSource:
    """The file of a mesh, as a robot's file names it.

    `file`: a path relative to the robot's file, file:// or package://. An MJCF file holds several meshes, then `name` is one of them.
    `robot_file`, `line`: where it is named. `scale`: by which the lengths in the file are multiplied.
    """

    file: str
    robot_file: Path
    line: int = 1
    name: str = ""
    scale: tuple[float, float, float] = (1.0, 1.0, 1.0)


@dataclass(frozen=True, slots=True, eq=False)
class Visual:
    """A volume or a mesh that is drawn on a link and touches nothing.

    `size` in m: as of a Shape; ellipsoid (x, y, z), half axes; mesh (). `position`, `rotation`: in the root frame, at zero pose.
    `color`: None where the file gives none; a mesh is then drawn in the colours of its own file, as is one that has several.
    """

    link: int
    kind: VisualKind
    size: tuple[float, ...]
    position: Array  # (3,) m
    rotation: Array  # (3, 3)
    color: Channels | None = None
    mesh: MeshSource | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Camera:
    """A camera on a link (root frame, zero pose).

    The columns of `rotation` are the picture's right, its down, and the direction of view. `view_deg`: vertical field of view, degrees.
    `hidden`: links that are not drawn in its pictures, because they enclose it.
    """

    name: str
    link: int
    position: Array  # (3,) m
    rotation: Array  # (3, 3)
    view_deg: float
    hidden: frozenset[int] = frozenset()
