# SPDX-License-Identifier: Apache-2.0
"""Makes a short film of a run: the robot, the hand position in each state of its agents, and text about what the agents do and learn."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from mobee.errors import InvalidValue, NotInstalled
from mobee.rendering.palette import Color
from services.monitor.film.ink import GROUND, fonts
from services.monitor.film.robot import RobotView
from services.monitor.film.story import StoryView, heading, remarks
from services.monitor.past import Story

WIDTH, HEIGHT, ROBOT_WIDTH = 800, 448, 384  # pixels
EDGE, BAR = 8, 4  # pixels: around the story, and the height of the bar that shows how much of the run is over
BAR_COLOR = (98, 112, 128)
LENGTH, RATE = 20.0, 8  # s, frames per second
SCENES = 4  # stretches of the run, from its begin to its end
SPEED = 2.0  # times the robot's own
FRAMED = 16  # frames between two that the camera must see
COLORS = 64  # of a GIF


def film(run: Path, file: Path, progress: Callable[[float], None] = lambda share: None) -> Path:
    """Write a film of a run as .gif or .mp4 and return `file`.

    `run`: folder of the run. `progress` is called with the share of the frames that are finished, 0 to 1. Raises MobeeError if the
    monitor has not recorded the run, InvalidValue for another file suffix, NotInstalled if a package for films is missing.
    """
    if file.suffix not in (".gif", ".mp4"):
        raise InvalidValue(f"{file}: a film is a .gif or a .mp4: give a name with one of these endings.")
    story = Story(run)
    begin, pictures = first_complete_moment(story), []
    moments = [begin + moment for moment in scene_times(story.length - begin)]
    artist = Artist(story, moments[::FRAMED])
    for number, moment in enumerate(moments):
        pictures.append(artist.frame(moment))
        progress((number + 1) / len(moments))
    return _write(pictures, file)


def scene_times(length: float) -> list[float]:
    """Return the times of the film's frames, s since the begin of a run that lasts `length` s.

    The film shows SCENES (4) stretches of the run, evenly spaced from its begin to its end.
    """
    frames = round(LENGTH * RATE / SCENES)
    stretch = min(frames * SPEED / RATE, length / SCENES)
    begins = np.linspace(0.0, max(0.0, length - stretch), SCENES)
    return [float(begin + stretch * frame / frames) for begin in begins for frame in range(frames)]


def first_complete_moment(story: Story) -> float:
    """Return the first time [s since the begin of the record] at which all agents perform actions and the objects of the world are known.

    A condition that is never met in the record is ignored. Returns 0 if the time is later than a tenth of the record's duration, or if no
    agents were recorded. `story`: the record of the run.
    """
    cards, objects = story.tracks.get("cards"), story.tracks.get("objects")
    if cards is None:
        return 0.0
    most = max(len(value) for value in cards.values)
    acting = [len(value) == most and all("now" in one for one in value) for value in cards.values]
    begun = cards.times[acting.index(True)] if any(acting) else story.begin
    moment = max(begun, objects.times[0] if objects is not None else begun) - story.begin
    return moment if 0.0 < moment < 0.1 * story.length else 0.0


class Artist:
    """Draws the frames of a film from the record of a run."""

    def __init__(self, story: Story, seen: Sequence[float]) -> None:
        """Prepare the drawing; `seen`: times [s since the begin] at which the camera must see the whole robot."""
        first = story.at(0.0) | story.at(story.length)
        self._story, self._name = story, story.robot.name
        self._colors: dict[str, Color] = {one["name"]: tuple(one["color"]) for one in first.get("robot", {}).get("parts", [])}
        self._fonts = fonts()
        self._robot = RobotView(story.robot, self._colors, (ROBOT_WIDTH, HEIGHT - BAR), [self._values(moment) for moment in seen])
        self._told = StoryView(self._colors, self._fonts)

    def frame(self, moment: float) -> Any:
        """Return the frame at the time `moment` [s since the begin of the run] as a Pillow image."""
        from PIL import Image, ImageDraw

        values = self._values(moment)
        frame = Image.new("RGB", (WIDTH, HEIGHT), GROUND)
        frame.paste(self._robot.picture(values), (0, 0))
        ink = ImageDraw.Draw(frame)
        heading(ink, self._name, moment, self._fonts)
        remarks(ink, HEIGHT - BAR, self._fonts)
        self._told.draw(ink, values, (ROBOT_WIDTH, EDGE, WIDTH - EDGE, HEIGHT - BAR - EDGE))
        ink.rectangle((0, HEIGHT - BAR, round(WIDTH * moment / self._story.length), HEIGHT), fill=BAR_COLOR)
        return frame

    def _values(self, moment: float) -> dict[str, Any]:
        return self._story.at(moment) | {"q": self._story.pose(moment)}


def _write(pictures: Sequence[Any], file: Path) -> Path:
    if file.suffix == ".gif":
        _write_gif(pictures, file)
    else:
        _write_mp4(pictures, file)
    return file


def _write_gif(pictures: Sequence[Any], file: Path) -> None:
    """Write pictures of Pillow, all of one size, as an animated GIF.

    All frames share one palette and have no dithering, so regions that do not change between two frames add almost nothing to the file.
    """
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
