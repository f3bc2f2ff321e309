# SPDX-License-Identifier: Apache-2.0
"""A short film of a run: the robot with the places that it wonders about, and the story of its agents."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from textwrap import wrap
from typing import Any

import numpy as np

from mobee.arrays import Array
from mobee.errors import InvalidValue, NotInstalled
from mobee.model.model import Model
from mobee.model.world import World
from mobee.model.world_object import Geometry
from mobee.rendering.camera import Camera, camera_axes, framing
from mobee.rendering.link_solids import robot_solids
from mobee.rendering.palette import Color
from mobee.rendering.picture import draw
from mobee.rendering.solid import focus, lowest, object_solids
from mobee.robot.robot import Robot
from services.common.worlds import AT_TABLE
from services.monitor.past import Story

WIDTH, HEIGHT, ROBOT_WIDTH = 720, 400, 380  # pixels
LENGTH, RATE = 20.0, 8  # s, frames per second
SCENES = 4  # stretches of the run, from its begin to its end
SPEED = 2.0  # times the robot's own
MARGIN = 0.09  # m around the first frame: the body leans to all sides
RAYS = 2  # a pixel, in each direction
COLORS = 64  # of a GIF
LEARNED, INK, QUIET = (196, 200, 206), (34, 38, 44), (110, 118, 128)  # colours of learned places, text and remarks
MISSED, REACHED = (190, 110, 0), (24, 130, 60)
FIRST_VIEW, OTHER_VIEW = (-32.0, 22.0), (148.0, 22.0)  # azimuth, elevation [degrees]: of robots that look along -x, and of the others


def film(run: Path, file: Path, tell: Callable[[float], None] = lambda share: None) -> Path:
    """Write the film of a run's folder as .gif or .mp4; `tell` is called with the share that is done.

    Raises MobeeError if the run has no record, InvalidValue for another ending of the file's name, NotInstalled without the packages.
    """
    if file.suffix not in (".gif", ".mp4"):
        raise InvalidValue(f"{file}: a film is a .gif or a .mp4: give a name with one of these endings.")
    story, artist = Story(run), None
    pictures = []
    moments = scene_times(story.length)
    for number, moment in enumerate(moments):
        values = story.at(moment) | {"q": story.pose(moment)}
        artist = artist or _Artist(story.robot, values)
        pictures.append(artist.picture(values, moment / story.length))
        tell((number + 1) / len(moments))
    return _write(pictures, file)


def scene_times(length: float) -> list[float]:
    """Return the moments of the frames, s since the begin of a run of that length [s]: SCENES stretches, evenly apart."""
    frames = round(LENGTH * RATE / SCENES)
    stretch = min(frames * SPEED / RATE, length / SCENES)
    begins = np.linspace(0.0, max(0.0, length - stretch), SCENES)
    return [float(begin + stretch * frame / frames) for begin in begins for frame in range(frames)]


@dataclass(frozen=True)
class _Writing:
    """The fonts."""

    title: Any
    text: Any
    small: Any


class _Artist:
    """Draws the frames; the camera is that of the first."""

    def __init__(self, robot: Robot, values: dict[str, Any]) -> None:
        self._robot = robot
        self._model = Model(robot, World())
        self._colors: dict[str, Color] = {one["name"]: tuple(one["color"]) for one in values.get("robot", {}).get("parts", [])}
        self._writing = _fonts()
        self._camera, self._floor = self._framed(values)

    def picture(self, values: dict[str, Any], share: float) -> Any:
        """Return a frame as an image; `share`: how much of the run is over."""
        from PIL import Image, ImageDraw

        self._show_objects(values)
        pose = self._model.evaluate(values["q"])
        scene = [*robot_solids(pose), *object_solids(pose.objects)]
        robot = draw(scene, self._camera, self._floor, RAYS)
        frame = Image.new("RGB", (WIDTH, HEIGHT), "white")
        frame.paste(Image.fromarray(robot[:HEIGHT, :ROBOT_WIDTH]), (0, 0))
        ink = ImageDraw.Draw(frame)
        self._draw_places(ink, values, pose.transforms)
        self._write_story(ink, values)
        ink.rectangle((0, HEIGHT - 4, round(WIDTH * share), HEIGHT), fill=(120, 130, 142))
        return frame

    def _framed(self, values: dict[str, Any]) -> tuple[Camera, float]:
        self._show_objects(values)
        pose = self._model.evaluate(values["q"])
        scene = [*robot_solids(pose), *object_solids(pose.objects)]
        points = [np.empty((0, 3)), *(_moved(pose.transforms, where) for where in values.get("places", {}).values())]
        axes = camera_axes(FIRST_VIEW if self._robot.name in AT_TABLE else OTHER_VIEW)
        whole = framing(axes, focus(scene), np.vstack(points), HEIGHT, MARGIN)
        scale = whole.scale * min(1.0, ROBOT_WIDTH / whole.width)
        middle = whole.corner + 0.5 * np.array([whole.width, -whole.height]) / whole.scale
        corner = middle + 0.5 * np.array([-ROBOT_WIDTH, HEIGHT]) / scale
        return Camera(axes, corner, scale, ROBOT_WIDTH, HEIGHT), lowest(focus(scene))

    def _show_objects(self, values: dict[str, Any]) -> None:
        world = self._model.world
        for name in list(world.objects):
            world.remove(name)
        for one in values.get("objects", []):
            world.add(
                one["name"], Geometry(one["kind"], tuple(one["size"])), position=one["position"], rotation=one["rotation"], role=one["role"]
            )

    def _draw_places(self, ink: Any, values: dict[str, Any], transforms: Array) -> None:
        for part, where in values.get("places", {}).items():
            told = values.get("left", {}).get(part)
            if told is None:
                continue
            pixels = self._camera.pixels(_moved(transforms, where))
            for state in np.argsort(told["left"]).tolist():
                _dot(ink, pixels[state], 1.5 + 2.0 * told["left"][state], _mixed(LEARNED, self._colors[part], told["left"][state]))
            way = [told["here"], *told["path"]][:2]
            if len(way) == 2:
                ink.line([tuple(pixels[state]) for state in way], fill=INK, width=2)
                _dot(ink, pixels[way[1]], 4.0, self._colors[part], INK)
            _dot(ink, pixels[told["here"]], 4.0, (255, 255, 255), INK)

    def _write_story(self, ink: Any, values: dict[str, Any]) -> None:
        left, top = ROBOT_WIDTH + 14, 10
        for card in values.get("cards", [])[:3]:
            top = self._write_card(ink, card, left, top) + 8
        tried = [f"{card['title']} {100 * card['tried']:.0f} %" for card in values.get("cards", []) if "tried" in card]
        if tried:
            ink.text((left, HEIGHT - 40), "actions tried: " + ", ".join(tried), font=self._writing.small, fill=QUIET)
        ink.text((left, HEIGHT - 24), "dots: where its hands could learn; grey: learned", font=self._writing.small, fill=QUIET)

    def _write_card(self, ink: Any, card: dict[str, Any], left: int, top: int) -> int:
        """Write a card; returns the row below it."""
        color, begin = _mixed((0, 0, 0), self._colors[card["part"]], 0.75), top
        ink.text((left, top), card["title"], font=self._writing.title, fill=color)
        count = f"{card['n']} transitions" if "n" in card else ""
        ink.text((WIDTH - 12, top + 2), count, font=self._writing.small, fill=QUIET, anchor="ra")
        top += 20
        last = card.get("last", {})
        lines = [(text, INK) for text in (card.get("reach") or card.get("now", ""), card.get("expects", "")) if text]
        if last:
            color_of_last = REACHED if last["reached"] else MISSED
            lines += [(f"Last: {last['outcome']}", color_of_last), (last["surprise"], color_of_last)]
        for text, shade in lines:
            for line in wrap(text, 54)[:2]:
                ink.text((left, top), line, font=self._writing.text, fill=shade)
                top += 15
        ink.line((left - 7, begin, left - 7, top), fill=color, width=3)
        return top


def _fonts() -> _Writing:
    try:
        from matplotlib import get_data_path
        from PIL import ImageFont
    except ImportError:
        raise NotInstalled('a film needs Matplotlib and Pillow, which are not installed: pip install "mobee[film]"') from None
    folder = Path(get_data_path()) / "fonts" / "ttf"
    plain, bold = str(folder / "DejaVuSans.ttf"), str(folder / "DejaVuSans-Bold.ttf")
    return _Writing(ImageFont.truetype(bold, 14), ImageFont.truetype(plain, 11), ImageFont.truetype(plain, 10))


def _moved(transforms: Array, where: dict[str, Any]) -> Array:
    link, points = transforms[where["link"]], np.array(where["points"])
    moved: Array = points @ link[:3, :3].T + link[:3, 3]
    return moved


def _mixed(first: Color, second: Color, share: float) -> Color:
    red, green, blue = (round((1.0 - share) * a + share * b) for a, b in zip(first, second, strict=True))
    return red, green, blue


def _dot(ink: Any, where: Array, radius: float, color: Color, rim: Color | None = None) -> None:
    x, y = where.tolist()
    ink.ellipse((x - radius, y - radius, x + radius, y + radius), fill=color, outline=rim, width=2 if rim else 0)


def _write(pictures: Sequence[Any], file: Path) -> Path:
    if file.suffix == ".gif":
        _write_gif(pictures, file)
    else:
        _write_mp4(pictures, file)
    return file


def _write_gif(pictures: Sequence[Any], file: Path) -> None:
    """One palette for all frames, without dither: what does not change between two frames takes no room."""
    from PIL import Image

    some = list(pictures)[:: max(1, len(pictures) // 12)]
    sheet = Image.new("RGB", (WIDTH, HEIGHT * len(some)))
    for row, picture in enumerate(some):
        sheet.paste(picture, (0, HEIGHT * row))
    palette = sheet.quantize(COLORS, method=Image.Quantize.MEDIANCUT, kmeans=1)
    frames = [picture.quantize(palette=palette, dither=Image.Dither.NONE) for picture in pictures]
    frames[0].save(file, save_all=True, append_images=frames[1:], duration=round(1000 / RATE), loop=0, optimize=True)


def _write_mp4(pictures: Sequence[Any], file: Path) -> None:
    try:
        from imageio_ffmpeg import write_frames
    except ImportError:
        raise NotInstalled('an .mp4 needs imageio-ffmpeg, which is not installed: pip install "mobee[film]"; or write a .gif') from None
    writer = write_frames(str(file), (WIDTH, HEIGHT), fps=RATE, macro_block_size=8)
    writer.send(None)
    for data in _bytes_of(pictures):
        writer.send(data)
    writer.close()


def _bytes_of(pictures: Sequence[Any]) -> Iterator[bytes]:
    for picture in pictures:
        yield picture.tobytes()
