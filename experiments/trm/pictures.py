"""What a map looks like: where its markers are, and a motion through it (as thesis figs. 3.1-3.11)."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np

from experiments.drawing.cloud import cloud_solids, marker_cloud
from experiments.drawing.filmstrip import Strip, filmstrip, pictures_of
from experiments.drawing.motion import Motion, motion_through
from experiments.drawing.sheet import Panel
from experiments.trm.example import Example
from mobee.roadmap.building.task import Coordinate
from mobee.roadmap.roadmap import Roadmap
from mobee.robot.robot import Array

STEP = 0.05  # rad of the motor that moves most, between two poses of a film
SPEED = 0.35  # rad/s, of that motor: 20 degrees a second
POSES = 6
CLOUD = "oblique"  # the one view of a cloud on a sheet


def draw_cloud(example: Example, roadmap: Roadmap, path: Path, height: int = 400) -> Path:
    """The places of the markers in all poses, beside the robot where its film begins."""
    shown = roadmap.q[_near(roadmap, example.way[0])]
    return marker_cloud(example.model, roadmap.q, example.markers, path, shown, title=_title(example), height=height)


def cloud_panel(example: Example, roadmap: Roadmap, height: int) -> Panel:
    """The same in one view, with its title below."""
    shown = example.model.evaluate(roadmap.q[_near(roadmap, example.way[0])])
    pose = example.model.evaluate(roadmap.q)
    places = np.concatenate([pose.position(marker) for marker in example.markers])
    return Panel(pictures_of([cloud_solids(shown, places, places[:, 2])], CLOUD, height)[0], _title(example))


def draw_film(example: Example, roadmap: Roadmap, path: Path, height: int = 260) -> Path:
    """The motion through the points of the example's way."""
    return filmstrip([strip_of(example, roadmap)], path, height)


def strip_of(example: Example, roadmap: Roadmap, poses: int = POSES) -> Strip:
    """The motion as a row of a filmstrip, the task coordinates below each pose."""

    def caption(motion: Motion, moment: int) -> str:
        y = example.task.of(example.model.evaluate(motion.poses[moment].q[None]))[0]
        return told(example.task.coordinates, y)

    motion = planned(example, roadmap)
    return Strip(motion, example.markers[-1], example.views, poses, _title(example), caption, _lively(example))


def planned(example: Example, roadmap: Roadmap) -> Motion:
    """The shortest ways in the map from each point of the example's way to the next."""
    q = roadmap.q[roadmap.exit(example.way[0])][None]
    for y in example.way[1:]:
        q = np.concatenate([q, roadmap.path(q[-1], y)[1:]])
    fine = [q[:1]]
    for here, there in pairwise(q):
        steps = max(1, int(np.ceil(np.abs(there - here).max() / STEP)))
        fine.append(here + np.arange(1, steps + 1)[:, None] / steps * (there - here))
    poses = np.concatenate(fine)
    times = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(poses, axis=0)).max(axis=1) / SPEED)])
    return motion_through(example.model, poses, times)


def told(coordinates: Sequence[Coordinate], y: Array) -> str:
    """Task coordinates in words: places in cm, angles in degrees."""
    words = []
    for one, value in zip(coordinates, y, strict=True):
        words.append(f"{round(np.rad2deg(value))}°" if one.unit == "rad" else f"{one.name.split()[-1]} {round(100.0 * value)}")
    return ", ".join(words) + (" cm" if any(one.unit == "m" for one in coordinates) else "")


def _near(roadmap: Roadmap, y: tuple[float, ...]) -> int:
    """The vertex nearest to task coordinates, however far."""
    return int(np.linalg.norm((roadmap.y - y) / roadmap.spacing, axis=1).argmin())


def _title(example: Example) -> str:
    return f"{example.title} (fig. {example.figure})"


def _lively(example: Example) -> tuple[str, ...]:
    """The parts of which some motor may move."""
    robot = example.model.robot
    return tuple(name for name, part in robot.parts.items() if {name, *part.motors} & set(example.motors))
