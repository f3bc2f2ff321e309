# SPDX-License-Identifier: Apache-2.0
"""The tag on a palm: an AprilTag that the renderer draws, and whose corners are found in pictures.

OpenCV finds the corners; Lucas and Kanade's method then aligns the pattern with the picture, to a few hundredths of a pixel.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mobee.arrays import Array
from mobee.errors import InvalidValue, NotInstalled
from mobee.rendering.mesh import Piece, mesh_of
from mobee.rendering.scene import Picture
from mobee.rendering.solid import Color, LinkSolid, Solid
from mobee.robot.robot import Robot
from mobee.vision.lens import Lens, mounted
from mobee.vision.regions import checked_picture

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
STEPS, ENOUGH = 20, 5e-3  # of Gauss and Newton; px by which a corner still moves
FARTHEST = 2.5  # px by which a corner may move
LEAST_LIKENESS = 0.85  # correlation of pattern and picture
SMOOTH = 0.3  # px, standard deviation of the filter of the picture
BLUR = 0.65  # px, of the edges in it: those of that filter, of a pixel's area twice, and of linear interpolation
PER_CELL = 6  # samples of a pattern along one side of a cell
_SQUARE = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])


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
    """Return squares in the plane z = 0, visible from -z: one for each cell (row, column).

    `side`: length of a side [m]. `first`: coordinate x and y [m] of the corner of cell (0, 0); x grows with the column, y with the row.
    """
    points: list[tuple[float, float, float]] = []
    triangles: list[tuple[int, int, int]] = []
    for row, column in cells:
        x, y, number = first + column * side, first + row * side, len(points)
        points += [(x, y, 0.0), (x + side, y, 0.0), (x + side, y + side, 0.0), (x, y + side, 0.0)]
        triangles += [(number, number + 2, number + 1), (number, number + 3, number + 2)]
    return Piece(np.array(points), np.array(triangles, dtype=np.intp))


def find_tag(picture: Picture, lens: Lens) -> Array | None:
    """Return the corners (4, 2) px, column and row, of the tag in a picture, in the order of `Tag.corners`; None if it is not found.

    `picture`: (H, W, 3) bytes, red, green and blue. OpenCV finds the corners with errors of a pixel or two. Then the whole pattern of the
    tag is fitted to the picture, which reduces the errors to a few hundredths of a pixel. The result is also None if there are several
    tags, if a side is shorter than 5 px, or if the pattern does not fit. Raises NotInstalled without OpenCV, and InvalidValue for a picture
    of another type, such as a grey one.
    """
    gray = _cv2().cvtColor(checked_picture(picture), _cv2().COLOR_RGB2GRAY)
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


def aligned(gray: NDArray[np.float32], lens: Lens, pattern: Array, margin: int, corners: Array) -> Array | None:
    """Return the exact corners (4, 2) px of a flat pattern in a grey picture, from corners that are wrong by a pixel or two.

    The pattern is a plane seen in perspective; its brightness and contrast are fitted too. None if the pattern does not fit the picture, or
    if a corner would move by more than 2.5 px.

    Args:
        gray: (height, width), the picture.
        lens: lens of the camera.
        pattern: (c, c), the brightness of square cells.
        margin: width of the border of `pattern`, in cells; the result is the corners of the square inside this border.
        corners: (4, 2) px, first values of the corners, column and row, clockwise from the upper left.
    """
    from scipy.ndimage import gaussian_filter, map_coordinates  # 0.3 s, and only the alignment needs it

    height, width = gray.shape
    low = np.maximum(np.floor(corners.min(axis=0)).astype(int) - 12, 0)
    high = np.minimum(np.ceil(corners.max(axis=0)).astype(int) + 12, (width, height))
    patch = gaussian_filter(gray[low[1] : high[1], low[0] : high[0]].astype(np.float64), SMOOTH)
    slopes = np.gradient(patch)
    side = np.linalg.norm(corners - np.roll(corners, 1, axis=0), axis=1).mean()
    points, wanted = _samples(pattern, margin, BLUR * (len(pattern) - 2 * margin) / side)
    plane = _plane_through(lens.undistort((corners - (lens.cx, lens.cy)) / (lens.fx, lens.fy)))
    focal, centre = np.array([lens.fx, lens.fy]), np.array([lens.cx, lens.cy])
    here = _pixels(lens, plane, _SQUARE)
    likeness = 0.0
    for _ in range(STEPS):
        flat, by_plane = _through(plane, points)
        at = (lens.distort(flat) * focal + centre - low)[:, ::-1].T
        if not np.isfinite(at).all() or (at < 0).any() or (at >= np.array(patch.shape)[:, None] - 1).any():
            return None
        seen = map_coordinates(patch, at, order=1)
        gradient = np.stack([map_coordinates(slope, at, order=1) for slope in slopes[::-1]], axis=1)
        by_flat = np.einsum("ki,kij->kj", gradient * focal, lens.distortion_slope(flat))
        scale, offset = np.polyfit(wanted, seen, 1)
        likeness = float(np.corrcoef(wanted, seen)[0, 1])
        by_all = np.column_stack([np.einsum("kj,kjl->kl", by_flat, by_plane), -wanted, -np.ones(len(wanted))])
        step = np.linalg.lstsq(by_all, scale * wanted + offset - seen, rcond=None)[0]
        plane = plane + step[:8]
        before, here = here, _pixels(lens, plane, _SQUARE)
        if not np.isfinite(here).all() or np.abs(here - corners).max() > FARTHEST:
            return None
        if np.abs(here - before).max() < ENOUGH:
            break
    return here if likeness >= LEAST_LIKENESS else None


def _samples(pattern: Array, margin: int, blur: float) -> tuple[Array, Array]:
    """Return points (K, 2) in the plane of a pattern, whose square is [-1, 1] x [-1, 1], and the brightness there (K,).

    `blur`: standard deviation of the filter that makes the edges as soft as the picture's, in cells.
    """
    from scipy.ndimage import gaussian_filter

    count = len(pattern)
    fine = np.kron(pattern, np.ones((PER_CELL, PER_CELL)))
    fine = gaussian_filter(fine, blur * PER_CELL, mode="nearest")
    half = 1.0 + 2.0 * margin / (count - 2 * margin)
    along = half * ((np.arange(count * PER_CELL) + 0.5) * 2.0 / (count * PER_CELL) - 1.0)
    x, y = np.meshgrid(along, along)
    edge = PER_CELL // 2  # beyond the outer half cell is what is behind the tag
    inner = np.s_[edge:-edge, edge:-edge]
    return np.column_stack([x[inner].ravel(), y[inner].ravel()]), fine[inner].ravel()


def _through(plane: Array, points: Array) -> tuple[Array, Array]:
    """Map points (K, 2) of the tag's plane to the plane at distance 1 from the camera (K, 2); also return derivatives (K, 2, 8).

    `plane`: (8,), the homography between these planes; the derivatives are by its numbers. The square [-1, 1] x [-1, 1] is the tag.
    """
    x, y = points.T
    below = plane[6] * x + plane[7] * y + 1.0
    flat = np.stack([(plane[0] * x + plane[1] * y + plane[2]) / below, (plane[3] * x + plane[4] * y + plane[5]) / below], axis=1)
    by = np.zeros((len(points), 2, 8))
    for row in range(2):
        by[:, row, 3 * row : 3 * row + 3] = np.column_stack([x, y, np.ones(len(x))]) / below[:, None]
        by[:, row, 6:] = -flat[:, row, None] * points / below[:, None]
    return flat, by


def _pixels(lens: Lens, plane: Array, points: Array) -> Array:
    return lens.distort(_through(plane, points)[0]) * (lens.fx, lens.fy) + (lens.cx, lens.cy)


def _plane_through(corners: Array) -> Array:
    """Return the homography (8,) that maps the square [-1, 1] x [-1, 1] to corners (4, 2): the rows of its matrix, without the last 1."""
    rows, values = [], []
    for (x, y), (u, v) in zip(_SQUARE, corners, strict=True):
        rows += [[x, y, 1, 0, 0, 0, -u * x, -u * y], [0, 0, 0, x, y, 1, -v * x, -v * y]]
        values += [u, v]
    found: Array = np.linalg.solve(np.array(rows), np.array(values))
    return found
