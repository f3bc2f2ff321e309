"""Motions as rows of pictures: the robot in a few of its poses side by side, with the way of a marker so far.

Of a plant:  `with recorded(plant) as recording: plant.act(...)`, then `filmstrip([Strip(recording.motion(), "right_palm")], path)`.
Of poses (T, n) rad, such as a path of a roadmap:  `Strip(motion_through(model, q), "right_palm", views=("oblique", "top"))`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from experiments.drawing.camera import axes_named, framing
from experiments.drawing.motion import Motion
from experiments.drawing.picture import Picture, draw
from experiments.drawing.scene import focus, lowest, object_solids, robot_solids, trail_solids
from experiments.drawing.sheet import Panel, write_sheet
from experiments.drawing.solid import Solid
from mobee.errors import InvalidValue

View = str | tuple[float, float]


@dataclass(frozen=True, slots=True, eq=False)
class Strip:
    """One motion of a filmstrip, a row for each view.

    `views`: names of `camera.VIEWS`, or (azimuth, elevation) in degrees.  `poses`: how many.  `title`: above the row.  `caption`: what
    stands below a pose, of the motion and its number; None: the time.  `bright`: parts that are not pale; None: those that moved.
    """

    motion: Motion
    marker: str
    views: Sequence[View] = ("oblique",)
    poses: int = 6
    title: str = ""
    caption: Callable[[Motion, int], str] | None = None
    bright: Sequence[str] | None = None


def filmstrip(strips: Sequence[Strip], path: Path, height: int = 300, colors: int = 256) -> Path:
    """Write them one below the other as a PNG, each picture that many pixels high, of so many colours at most."""
    rows = [(strip.title if number == 0 else "", row) for strip in strips for number, row in enumerate(panels(strip, height))]
    return write_sheet(rows, path, colors)


def panels(strip: Strip, height: int) -> list[list[Panel]]:
    """The pictures of a strip, a row for each view; raises InvalidValue, UnknownName."""
    if strip.poses < 1 or not strip.views:
        raise InvalidValue(f"{strip.poses} poses in {len(strip.views)} views: must be at least one of each")
    motion = strip.motion
    moments = motion.moments(strip.marker, strip.poses).tolist()
    way, bright = motion.way(strip.marker), motion.moved() if strip.bright is None else strip.bright
    caption = _time if strip.caption is None else strip.caption
    scenes = []
    for moment in moments:
        trail = trail_solids(way[: moment + 1])
        scenes.append([*robot_solids(motion.poses[moment], bright), *object_solids(motion.objects[moment]), *trail])
    pictures = [pictures_of(scenes, view, height) for view in strip.views]
    below = [caption(motion, moment) for moment in moments]
    return [[Panel(picture, text if row is pictures[-1] else "") for picture, text in zip(row, below, strict=True)] for row in pictures]


def pictures_of(scenes: Sequence[Sequence[Solid]], view: View, height: int) -> list[Picture]:
    """Several scenes through one camera, which sees all of what each is about."""
    about = [solid for scene in scenes for solid in focus(scene)]
    camera = framing(axes_named(view), about, np.empty((0, 3)), height)
    floor = min(lowest(scene) for scene in scenes)
    return [draw(scene, camera, floor) for scene in scenes]


def _time(motion: Motion, moment: int) -> str:
    return f"{motion.times[moment]:.1f} s"
