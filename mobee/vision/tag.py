# SPDX-License-Identifier: Apache-2.0
"""The tag on a palm: an AprilTag that the renderer draws, and whose corners are found in pictures by OpenCV."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from mobee.arrays import Array
from mobee.errors import InvalidValue, NotInstalled
from mobee.rendering.link_solids import LinkSolid
from mobee.rendering.mesh import Piece, mesh_of
from mobee.rendering.scene import Picture
from mobee.rendering.solid import Color, Solid
from mobee.robot.robot import Robot
from mobee.vision.alignment import aligned
from mobee.vision.lens import Lens
from mobee.vision.mount import mounted

FAMILY, NUMBER = "DICT_APRILTAG_25h9", 0
CELLS = (  # of number 0 of the family 25h9, with its border; # is black
    "#######",
    "#.###.#",
    "#.....#",
    "##.##.#",
    "#..#.##",
    "#.#.#.#",
    "#######",
)
BLACK: Color = (0.06, 0.06, 0.06)
WHITE: Color = (0.95, 0.95, 0.95)
MARGIN = 1  # cells of white around it
REFINED = 2  # px: half of the window in which OpenCV refines a corner
SMALLEST = 5.0  # px: the side of a tag below which its corners are not used


@dataclass(frozen=True, slots=True)
class Tag:
    """A square AprilTag on a palm.

    `marker`: name of the marker at the palm; a marker is a point on a link with a normal, and this normal points out of the palm. `size`:
    side of the tag's black border, m. `above`: distance of the tag from the marker along the normal, m.
    """

    marker: str
    size: float = 0.042
    above: float = 0.03

    def __post_init__(self) -> None:
        if not (0.0 < self.size < 1.0 and 0.0 <= self.above < 1.0):
            raise InvalidValue(f"a tag of {self.size} m, {self.above} m above the palm: the size must be above 0, and both below 1 m")

    @property
    def corners(self) -> Array:
        """The corners (4, 3) m of the black border in the tag's frame, as seen from outside: clockwise from the upper left."""
        return 0.5 * self.size * np.array([[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]])

    def frame(self, robot: Robot) -> tuple[int, Array, Array]:
        """Return the index of the tag's link, and the tag's position (3,) m and rotation (3, 3) in the root frame at the zero pose.

        The columns of the rotation are the tag's axes: x to the right and y down (for a viewer in front of the palm), z into the palm.
        Raises UnknownName if the robot has no marker of the name `marker`.
        """
        marker = robot.marker(self.marker)
        inwards = -marker.normal
        axes = marker.rotation.T
        right = axes[int(np.abs(axes @ inwards).argmin())]
        right = right - (right @ inwards) * inwards
        right /= np.linalg.norm(right)
        return marker.link, marker.position + self.above * marker.normal, np.stack([right, np.cross(inwards, right), inwards], axis=1)


def tag_solids(tag: Tag, robot: Robot, mount: Array) -> list[LinkSolid]:
    """Return the tag with a white margin as solids for the renderer.

    `mount`: (6,), displacement [m] and rotation vector [rad] by which the true tag differs from the tag of the model, in the axes of the
    latter.
    """
    link, position, rotation = tag.frame(robot)
    position, rotation = mounted(position, rotation, mount)
    count = len(CELLS)
    dark = {(row, column) for row in range(count) for column in range(count) if CELLS[row][column] == "#"}
    every = {(row, column) for row in range(-MARGIN, count + MARGIN) for column in range(-MARGIN, count + MARGIN)}
    cell, part = tag.size / count, _part_of(robot, link)
    solids = []
    for cells, color in ((dark, BLACK), (every - dark, WHITE)):
        mesh = mesh_of(_squares(sorted(cells), cell, -0.5 * tag.size))
        solid = Solid("mesh", (), position, rotation, color, group=link, mesh=mesh)
        solids.append(LinkSolid(link, part, solid, False))
    return solids


def _part_of(robot: Robot, link: int) -> str:
    """Return the part of the nearest motor that moves a link, or the first part."""
    while link > 0:
        driven = np.flatnonzero(robot.coupling[0][link - 1])
        if driven.size:
            return robot.motor_table[int(driven[0])].part
        link = robot.joints[link - 1].parent
    return next(iter(robot.parts))


def _squares(cells: list[tuple[int, int]], side: float, first: float) -> Piece:
    """Return squares in the plane z = 0, visible from -z."""
    points: list[tuple[float, float, float]] = []
    triangles: list[tuple[int, int, int]] = []
    for row, column in cells:
        x, y, number = first + column * side, first + row * side, len(points)
        points += [(x, y, 0.0), (x + side, y, 0.0), (x + side, y + side, 0.0), (x, y + side, 0.0)]
        triangles += [(number, number + 2, number + 1), (number, number + 3, number + 2)]
    return Piece(np.array(points), np.array(triangles, dtype=np.intp))


def find_tag(picture: Picture, lens: Lens) -> Array | None:
    """Return the corners (4, 2) px, column and row, of the tag in a picture, in the order of `Tag.corners`; None if it is not found.

    `picture`: (H, W, 3), red, green and blue. OpenCV finds the corners with errors of a pixel or two. Then the whole pattern of the tag is
    fitted to the picture, which reduces the errors to a few hundredths of a pixel. The result is also None if there are several tags, if a
    side is shorter than 5 px, or if the pattern does not fit. Raises NotInstalled without OpenCV.
    """
    gray = _cv2().cvtColor(picture, _cv2().COLOR_RGB2GRAY)
    corners, numbers, _ = _detector().detectMarkers(gray)
    if numbers is None:
        return None
    found = [
        np.asarray(one, dtype=np.float64).reshape(4, 2) for one, number in zip(corners, numbers.ravel(), strict=True) if number == NUMBER
    ]
    if len(found) != 1:  # two can only be a mistake
        return None
    sides = np.linalg.norm(found[0] - np.roll(found[0], 1, axis=0), axis=1)
    return aligned(gray.astype(np.float32), lens, _pattern(), MARGIN, found[0]) if sides.min() >= SMALLEST else None


@cache
def _pattern() -> Array:
    """Return the brightness (c, c) of the tag's cells and its white margin."""
    cells = np.array([[0.0 if cell == "#" else 1.0 for cell in row] for row in CELLS])
    return np.pad(cells, MARGIN, constant_values=1.0)


@cache
def _detector() -> Any:
    aruco = _cv2().aruco
    parameters = aruco.DetectorParameters()
    parameters.cornerRefinementMethod = aruco.CORNER_REFINE_SUBPIX
    parameters.cornerRefinementWinSize = REFINED
    parameters.relativeCornerRefinmentWinSize = 1.0  # misspelled in OpenCV
    parameters.minMarkerPerimeterRate = 0.04
    parameters.adaptiveThreshWinSizeStep = 4
    parameters.errorCorrectionRate = 0.3
    return aruco.ArucoDetector(aruco.getPredefinedDictionary(getattr(aruco, FAMILY)), parameters)


def _cv2() -> Any:
    try:
        import cv2
    except ImportError:
        raise NotInstalled('tags need OpenCV: pip install "mobee[vision]"') from None
    return cv2
