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

    `file`: the name of the mesh's file, a path relative to the robot's file or an address file:// or package://. `name`: name of one mesh
    in a file with several meshes (MJCF). `robot_file`, `line`: where the robot's file names the mesh. `scale`: factors (x, y, z) by which
    the lengths in the mesh's file are multiplied.
    """

    file: str
    robot_file: Path
    line: int = 1
    name: str = ""
    scale: tuple[float, float, float] = (1.0, 1.0, 1.0)


@dataclass(frozen=True, slots=True, eq=False)
class Visual:
    """A volume or a mesh that is drawn on a link and has no contacts.

    `link`: index of the link. `size` in m, as in `mobee.robot.robot.Shape`: sphere (radius,); capsule and cylinder (radius, height); box
    (x, y, z), full edges; ellipsoid (x, y, z), half axes; mesh (). `position` (3,) m, `rotation` (3, 3): in the root frame, at zero pose.
    `color`: red, green, blue and opacity, each 0 to 1; None: the robot's file gives no colour, and a mesh is drawn in the colours of its
    own file. `mesh`: the file of a visual of kind "mesh", else None.
    """

    link: int
    kind: VisualKind
    size: tuple[float, ...]
    position: Array
    rotation: Array
    color: Channels | None = None
    mesh: MeshSource | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Camera:
    """A camera on a link.

    `link`: index of the link. `position` (3,) m, `rotation` (3, 3): in the root frame, at zero pose. The columns of `rotation` are the
    directions right and down of the picture and the direction of view. `view_deg`: vertical field of view, degrees. `hidden`: indices of
    links that are not drawn in the camera's pictures, because they enclose the camera.
    """

    name: str
    link: int
    position: Array
    rotation: Array
    view_deg: float
    hidden: frozenset[int] = frozenset()
