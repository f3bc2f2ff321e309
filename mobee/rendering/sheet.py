# SPDX-License-Identifier: Apache-2.0
"""Motions of a robot, and sheets of pictures of them as PNG files: filmstrips, and positions of markers (as thesis figs. 3.1, 3.2).

A motion is a sequence of poses, with the world's objects at each pose. Pictures of a plant's motion:
`with recorded(plant) as recording: plant.act(...)`, then `filmstrip([Strip(recording.motion(), "right_palm")], path)`.
Pictures of poses (T, n) rad, such as a path of a roadmap: `Strip(motion_through(model, q), "right_palm", views=("oblique", "top"))`.
"""

from __future__ import annotations

import io
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import zip_longest
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from mobee.arrays import Array, Ints
from mobee.errors import InvalidValue, NotInstalled
from mobee.model.model import Model
from mobee.model.pose import Pose
from mobee.model.world_object import WorldObject
from mobee.rendering.camera import camera_axes, framing
from mobee.rendering.picture import Picture, draw
from mobee.rendering.solid import Color, Solid, ball, focus, lowest, object_solids, robot_solids, trail_solids
from mobee.robot.writing import write_whole
from mobee.simulation.plant import OfflinePlant

View = str | tuple[float, float]

MOVED = 0.02  # rad, or m: a motor that moves less counts as still
REST_SPEED = 0.002  # m/s: a pause counts as motion at this speed, so that it gets few of the moments shown

DPI = 100
GAP, MARGIN = 8, 10  # pixels
TITLE_HEIGHT, CAPTION_HEIGHT = 30, 22  # pixels
POINT_RADIUS = 0.0045  # m
LOWEST, MIDDLE, HIGHEST = np.array([0.16, 0.42, 0.92]), np.array([0.20, 0.78, 0.58]), np.array([1.00, 0.70, 0.12])  # colours of values
POINT_VEIL = 0.2
POINT_GROUP = -3


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """A sequence of T poses.

    `poses`: the T poses, at `times` (T,) s. `objects`: for each pose, the objects of the world by name.
    """

    poses: tuple[Pose, ...]
    times: Array
    objects: tuple[Mapping[str, WorldObject], ...]

    def __post_init__(self) -> None:
        """Check that there are as many times and objects as poses, and at least one; raise InvalidValue otherwise."""
        if not len(self.poses) == len(self.times) == len(self.objects) > 0:
            counts = f"{len(self.poses)} poses, {len(self.times)} times, {len(self.objects)} worlds"
            raise InvalidValue(f"a motion of {counts}: must be as many of each, at least one")

    def __len__(self) -> int:
        return len(self.poses)

    def part(self, first: int, last: int) -> Motion:
        """Return the motion from the pose with index `first` to the pose with index `last`, both included."""
        return Motion(self.poses[first : last + 1], self.times[first : last + 1], self.objects[first : last + 1])

    def path(self, marker: str) -> Array:
        """Return the positions of a marker in all poses, (T, 3) m, root frame; raise UnknownName if the robot has no such marker."""
        return np.array([pose.position(marker) for pose in self.poses])

    def moved(self) -> tuple[str, ...]:
        """Return the names of the parts of which at least one motor moves by more than 0.02 (rad or m)."""
        q = np.array([pose.q for pose in self.poses])
        moves = np.ptp(q, axis=0) > MOVED
        return tuple(name for name, part in self.poses[0].robot.parts.items() if moves[part.slice].any())

    def moments(self, marker: str, count: int) -> Ints:
        """Return the indices of up to `count` poses, from the first to the last, between which the marker moves about equal distances.

        They are the poses to draw in a filmstrip.
        """
        steps = np.linalg.norm(np.diff(self.path(marker), axis=0), axis=1) + REST_SPEED * np.diff(self.times)
        covered = np.concatenate([[0.0], np.cumsum(steps)])
        shares = np.linspace(0.0, covered[-1], count) if count > 1 else covered[-1:]
        return np.unique(np.abs(covered - shares[:, None]).argmin(axis=1))


def motion_through(model: Model, q: ArrayLike, times: Sequence[float] | None = None) -> Motion:
    """Return the motion through poses q (T, n) rad in the model's present world; attached objects move with their links.

    `times`: (T,) s; None: 0, 1, 2, ...
    """
    poses = tuple(model.evaluate(row) for row in np.atleast_2d(np.asarray(q, dtype=np.float64)))
    found = np.arange(len(poses), dtype=np.float64) if times is None else np.asarray(times, dtype=np.float64)
    return Motion(poses, found, tuple(pose.objects for pose in poses))


class Recording:
    """Keeps poses of an offline plant (a simulated robot): the pose when the recording is made, and the pose at each call of `add`."""

    def __init__(self, plant: OfflinePlant) -> None:
        self._plant = plant
        self._poses: list[Pose] = []
        self._times: list[float] = []
        self._objects: list[dict[str, WorldObject]] = []
        self.add(plant.time)

    def __len__(self) -> int:
        return len(self._poses)

    def add(self, time: float) -> None:
        """Add the plant's present pose at `time` [s]; nothing is added before the plant's first tick."""
        if (pose := self._plant.pose) is not None:
            self._poses.append(pose)
            self._times.append(time)
            self._objects.append(pose.objects)

    def motion(self) -> Motion:
        """Return the motion recorded so far, with times from 0; raise InvalidValue if no pose was recorded."""
        return Motion(tuple(self._poses), np.array(self._times) - self._times[:1], tuple(self._objects))


@contextmanager
def recorded(plant: OfflinePlant, step: float = 0.05) -> Iterator[Recording]:
    """Record an offline plant inside the `with` block, one pose every `step` seconds of simulated time.

    The recording replaces the callback that was set with `plant.every`; afterwards no callback is set.
    """
    recording = Recording(plant)
    plant.every(max(1, round(step / plant.dt)), recording.add)
    try:
        yield recording
    finally:
        plant.every(1, None)


@dataclass(frozen=True, slots=True, eq=False)
class Panel:
    """One picture (H, W, 3) on a sheet (a file of several pictures), with the text `caption` below it."""

    picture: Picture
    caption: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class Strip:
    """One motion of a filmstrip, with a row of pictures for each view.

    Attributes:
        motion: the motion.
        marker: name of the marker whose path is drawn.
        views: names of `camera.VIEWS`, or (azimuth, elevation) in degrees.
        poses: largest number of pictures in a row.
        title: text above the first row.
        caption: function of the motion and the index of a pose in `motion.poses`; it returns the text below the picture of this pose.
            None: the text is the time of the pose.
        bright: parts in full colour, all others are pale; None: the parts that moved.
    """

    motion: Motion
    marker: str
    views: Sequence[View] = ("oblique",)
    poses: int = 6
    title: str = ""
    caption: Callable[[Motion, int], str] | None = None
    bright: Sequence[str] | None = None


def filmstrip(strips: Sequence[Strip], path: Path, height: int = 300, colors: int = 256) -> Path:
    """Write strips one below the other to a PNG file, and return its path.

    `height`: height of each picture in pixels. `colors`: largest number of colours in the file. Raises InvalidValue or UnknownName for a
    strip that is not valid, and NotInstalled without Matplotlib.
    """
    rows = [(strip.title if number == 0 else "", row) for strip in strips for number, row in enumerate(panels(strip, height))]
    return write_sheet(rows, path, colors)


def panels(strip: Strip, height: int) -> list[list[Panel]]:
    """Return the pictures of a strip, a list for each view; raise InvalidValue or UnknownName if the strip is not valid.

    `height`: height of each picture in pixels.
    """
    if strip.poses < 1 or not strip.views:
        raise InvalidValue(f"{strip.poses} poses in {len(strip.views)} views: must be at least one of each")
    motion = strip.motion
    moments = motion.moments(strip.marker, strip.poses).tolist()
    path, bright = motion.path(strip.marker), motion.moved() if strip.bright is None else strip.bright
    caption = _time_caption if strip.caption is None else strip.caption
    scenes = []
    for moment in moments:
        trail = trail_solids(path[: moment + 1])
        scenes.append([*robot_solids(motion.poses[moment], bright), *object_solids(motion.objects[moment]), *trail])
    pictures = [pictures_of(scenes, view, height) for view in strip.views]
    below = [caption(motion, moment) for moment in moments]
    return [[Panel(picture, text if row is pictures[-1] else "") for picture, text in zip(row, below, strict=True)] for row in pictures]


def pictures_of(scenes: Sequence[Sequence[Solid]], view: View, height: int) -> list[Picture]:
    """Return a picture of each scene, all drawn by the same camera.

    The camera's frame contains the solids of all scenes except those that may lie outside (`Solid.aside`). `view`: name of `camera.VIEWS`,
    or (azimuth, elevation) in degrees. `height`: height of each picture in pixels.
    """
    if height < 1:
        raise InvalidValue(f"height {height!r}: must be at least 1 pixel.")
    about = [solid for scene in scenes for solid in focus(scene)]
    camera = framing(camera_axes(view), about, np.empty((0, 3)), height)
    floor = min(lowest(scene) for scene in scenes)
    return [draw(scene, camera, floor) for scene in scenes]


def marker_cloud(
    model: Model,
    q: ArrayLike,
    markers: str | Sequence[str],
    path: Path,
    shown: ArrayLike | None = None,
    views: Sequence[View] = ("front", "side", "oblique"),
    values: ArrayLike | None = None,
    title: str = "",
    height: int = 400,
) -> Path:
    """Write a PNG file with the positions of markers in the poses q (P, n) rad, and with the robot; return its path.

    Args:
        model: the robot in its world.
        q: (P, n) rad.
        markers: names.
        path: path of the file.
        shown: (n,) rad, pose of the robot in the picture; None: home.
        views: names of `camera.VIEWS`, or (azimuth, elevation) in degrees; a picture for each.
        values: (P,), which give the points' colours, blue for the smallest, orange for the largest; None: the height of each point.
        title: text above the pictures.
        height: height of each picture in pixels.

    Raises:
        InvalidValue, UnknownName: an argument is not valid.
        NotInstalled: Matplotlib is not installed.
    """
    pose, names = model.evaluate(np.atleast_2d(np.asarray(q, dtype=np.float64))), [markers] if isinstance(markers, str) else list(markers)
    if not names or not len(pose.q) or not len(views):
        raise InvalidValue(f"{len(pose.q)} poses, {len(names)} markers and {len(views)} views: must be at least one of each")
    places = np.concatenate([pose.position(name) for name in names])
    given = pose.position(names[0])[:, 2] if values is None else np.asarray(values, dtype=np.float64)
    if given.shape != pose.q.shape[:1]:
        raise InvalidValue(f"{len(pose.q)} poses and values of shape {given.shape}: must be one value per pose")
    if not np.isfinite(given).all():
        raise InvalidValue(f"values: {int((~np.isfinite(given)).sum())} of {len(given)} are not finite; a colour needs a finite number")
    colored = places[:, 2] if values is None else np.tile(given, len(names))
    scene = cloud_solids(model.evaluate(model.robot.home if shown is None else shown), places, colored)
    row = [Panel(pictures_of([scene], view, height)[0], view if isinstance(view, str) else "") for view in views]
    return write_sheet([(title, row)], path)


def cloud_solids(pose: Pose, places: Array, values: Array) -> list[Solid]:
    """Return the solids (volumes to draw) for the robot in a pose, the world around it, and points `places` (P, 3) m, root frame, as balls.

    `values`: (P,), a number for each point, which determines its colour: blue for the smallest, orange for the largest number.
    """
    low, high = float(values.min()), float(values.max())
    shares = (values - low) / (high - low) if high > low else np.full(len(values), 0.5)
    colors = [_value_color(float(share)) for share in shares]
    points = [ball(place, POINT_RADIUS, color, POINT_VEIL, POINT_GROUP) for place, color in zip(places, colors, strict=True)]
    return [*robot_solids(pose, bright=()), *object_solids(pose.objects), *points]


def write_sheet(rows: Sequence[tuple[str, Sequence[Panel]]], path: Path, colors: int = 256) -> Path:
    """Write rows of pictures to a PNG file, and return its path; a row is a title and its panels from left to right.

    `colors`: largest number of colours in the file, 1 to 256. A file of this name is replaced when the whole picture is drawn. Raises
    InvalidValue for another number of colours, OSError if the file cannot be written, and NotInstalled without Matplotlib.
    """
    if not 1 <= colors <= 256:
        raise InvalidValue(f"colors {colors!r}: must be 1 to 256.")
    columns = [max(one.picture.shape[1] for one in column if one) for column in zip_longest(*(panels for _, panels in rows))]
    heights = [_row_height(title, panels) for title, panels in rows]
    width, height = sum(columns) + GAP * (len(columns) - 1) + 2 * MARGIN, sum(heights) + GAP * (len(rows) - 1) + 2 * MARGIN
    figure = _figure(width / DPI, height / DPI)
    sheet = np.full((height, width, 3), 255, np.uint8)
    top = MARGIN
    for (title, panels), row_height in zip(rows, heights, strict=True):
        left, below = MARGIN, top + (TITLE_HEIGHT if title else 0)
        if title:
            place = left / width, 1.0 - (top + 0.5 * TITLE_HEIGHT) / height
            figure.text(*place, title, fontsize=11, fontweight="bold", va="center", parse_math=False)
        for panel, column_width in zip(panels, columns, strict=False):
            (high, narrow), start = panel.picture.shape[:2], left + (column_width - panel.picture.shape[1]) // 2
            sheet[below : below + high, start : start + narrow] = panel.picture
            middle = (left + 0.5 * column_width) / width, 1.0 - (below + high + 0.5 * CAPTION_HEIGHT) / height
            figure.text(*middle, panel.caption, fontsize=10, color="0.25", ha="center", va="center", parse_math=False)
            left += column_width + GAP
        top += row_height + GAP
    figure.figimage(sheet, zorder=-1)
    _write_png(figure, path, colors)
    return path


def _figure(width: float, height: float) -> Any:
    """Return an empty figure of Matplotlib of this size [inches]; raises NotInstalled without Matplotlib."""
    try:
        from matplotlib.figure import Figure
    except ImportError:
        raise NotInstalled('sheets of pictures need Matplotlib, which is not installed: pip install "mobee[figures]"') from None
    return Figure(figsize=(width, height))


def _row_height(title: str, panels: Sequence[Panel]) -> int:
    captions = CAPTION_HEIGHT if any(panel.caption for panel in panels) else 0
    highest: int = max(panel.picture.shape[0] for panel in panels)
    return highest + captions + (TITLE_HEIGHT if title else 0)


def _write_png(figure: Any, path: Path, colors: int) -> None:
    """Write a figure as a PNG file with a palette of at most `colors` colours; the file is a third as large as without a palette.

    Rare colours have a larger weight in the choice of the palette than in the picture. White stays white.
    """
    from PIL import Image  # a dependency of Matplotlib

    written = io.BytesIO()
    figure.savefig(written, dpi=DPI, format="png")
    image = Image.open(written).convert("RGB")
    pixels = np.asarray(image)
    shades, counts = np.unique(pixels.reshape(-1, 3), axis=0, return_counts=True)
    palette = Image.fromarray(np.repeat(shades, np.ceil(np.sqrt(counts)).astype(int), axis=0)[None]).quantize(colors, kmeans=2)
    entries = np.array(palette.getpalette()).reshape(-1, 3)
    white = int(entries.sum(axis=1).argmax())
    entries[white] = 255
    palette.putpalette(entries.ravel().tolist())
    chosen = np.array(image.quantize(palette=palette, dither=Image.Dither.NONE))
    chosen[(pixels == 255).all(axis=2)] = white
    found = Image.fromarray(chosen)
    found.putpalette(entries.ravel().tolist())
    whole = io.BytesIO()
    found.save(whole, "PNG", optimize=True)
    write_whole(Path(path), whole.getvalue())


def _time_caption(motion: Motion, moment: int) -> str:
    return f"{motion.times[moment]:.1f} s"


def _value_color(share: float) -> Color:
    """Return the colour of a share, interpolated between LOWEST at 0, MIDDLE at one half and HIGHEST at 1."""
    first, second, part = (LOWEST, MIDDLE, 2.0 * share) if share < 0.5 else (MIDDLE, HIGHEST, 2.0 * share - 1.0)
    red, green, blue = ((1.0 - part) * first + part * second).tolist()
    return red, green, blue
