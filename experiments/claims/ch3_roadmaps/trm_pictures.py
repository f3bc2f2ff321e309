# SPDX-License-Identifier: Apache-2.0
"""Pictures of roadmaps, as thesis figs. 3.1-3.11: a cloud and a film for each task.

The cloud shows the positions of the task's markers (named points on the robot, such as the palm) in all poses of the roadmap.  The film
shows a motion through the roadmap.

    python -m experiments.claims.ch3_roadmaps.trm_pictures TASK [TASK ...] [--method least_squares] [--out FOLDER]

Writes TASK.npz (a roadmap that `mobee roadmap` can read), TASK_cloud.png and TASK_film.png.  For several tasks it also writes
sheets on which their pictures are together: films_one_hand.png, films_both_hands.png and clouds.png.  A map that exists already is not
built again.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np

from experiments.claims.ch3_roadmaps.trm_tasks import EXAMPLES
from experiments.kit.roadmap_task import LEFT_ARM, Example, Method, build
from mobee import MobeeError
from mobee.arrays import Array
from mobee.rendering.sheet import Motion, Panel, Strip, cloud_solids, filmstrip, marker_cloud, motion_through, pictures_of, write_sheet
from mobee.roadmap.building.tasks import Coordinate
from mobee.roadmap.roadmap import Roadmap

STEP = 0.05  # rad of the motor that moves most, between two poses of a film
SPEED = 0.35  # rad/s, of that motor: 20 degrees a second
POSES = 6
CLOUD = "oblique"  # the one view of a cloud on a sheet
METHODS: tuple[Method, ...] = ("least_squares", "nes", "hybrid")
SHEET, COLORS = 140, 48  # pixels, the height of a picture on a sheet
COLUMNS = 4


def draw_cloud(example: Example, roadmap: Roadmap, path: Path, height: int = 400) -> Path:
    """Draw the positions of the example's markers in all poses of a roadmap, and the robot in one pose, to `path`; returns `path`.

    A marker is a named point on the robot, such as the right palm.  `height`: height of the picture, pixels.
    """
    shown = roadmap.q[_near(roadmap, example.via[0])]
    return marker_cloud(example.model, roadmap.q, example.markers, path, shown, title=_title(example), height=height)


def cloud_panel(example: Example, roadmap: Roadmap, height: int) -> Panel:
    """Return a picture of the positions of the example's markers in all poses of a roadmap, in one view, with its title below.

    A marker is a named point on the robot, such as the right palm.  `height`: pixels.
    """
    shown = example.model.evaluate(roadmap.q[_near(roadmap, example.via[0])])
    pose = example.model.evaluate(roadmap.q)
    places = np.concatenate([pose.position(marker) for marker in example.markers])
    return Panel(pictures_of([cloud_solids(shown, places, places[:, 2])], CLOUD, height)[0], _title(example))


def draw_film(example: Example, roadmap: Roadmap, path: Path, height: int = 260) -> Path:
    """Draw a filmstrip of the example's motion to `path`; returns `path`.

    The motion follows the shortest path in `roadmap` through the example's task points.  `height`: height of each picture, pixels.
    """
    return filmstrip([strip_of(example, roadmap)], path, height)


def strip_of(example: Example, roadmap: Roadmap, poses: int = POSES) -> Strip:
    """Return the example's motion as a row of a filmstrip with `poses` pictures and the task coordinates below each.

    The motion follows the shortest path in `roadmap` through the example's task points.
    """

    def caption(motion: Motion, moment: int) -> str:
        y = example.task.of(example.model.evaluate(motion.poses[moment].q[None]))[0]
        return caption_of(example.task.coordinates, y)

    motion = planned(example, roadmap)
    return Strip(motion, example.markers[-1], example.views, poses, _title(example), caption, _moving_parts(example))


def planned(example: Example, roadmap: Roadmap) -> Motion:
    """Return the motion along the shortest path in the roadmap through the example's task points `via`, in order."""
    q = roadmap.q[roadmap.exit(example.via[0])][None]
    for y in example.via[1:]:
        q = np.concatenate([q, roadmap.path(q[-1], y)[1:]])
    fine = [q[:1]]
    for here, there in pairwise(q):
        steps = max(1, int(np.ceil(np.abs(there - here).max() / STEP)))
        fine.append(here + np.arange(1, steps + 1)[:, None] / steps * (there - here))
    poses = np.concatenate(fine)
    times = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(poses, axis=0)).max(axis=1) / SPEED)])
    return motion_through(example.model, poses, times.tolist())


def caption_of(coordinates: Sequence[Coordinate], y: Array) -> str:
    """Return the task coordinates `y` (m,) as text: lengths in cm, angles in degrees.  `coordinates`: their names and units."""
    words = []
    for one, value in zip(coordinates, y, strict=True):
        words.append(f"{round(np.rad2deg(value))}°" if one.unit == "rad" else f"{one.name.split()[-1]} {round(100.0 * value)}")
    return ", ".join(words) + (" cm" if any(one.unit == "m" for one in coordinates) else "")


def _near(roadmap: Roadmap, y: tuple[float, ...]) -> int:
    """Return the index of the vertex nearest to the task coordinates `y` (m,).

    Each coordinate difference is divided by the spacing of the roadmap in this coordinate; there is no maximum distance.
    """
    return int(np.linalg.norm((roadmap.y - y) / roadmap.spacing, axis=1).argmin())


def _title(example: Example) -> str:
    return f"{example.title} (fig. {example.figure})"


def _moving_parts(example: Example) -> tuple[str, ...]:
    """Return the parts that have moving motors."""
    robot = example.model.robot
    return tuple(name for name, part in robot.parts.items() if {name, *part.motors} & set(example.motors))


def main(argv: Sequence[str] | None = None) -> None:
    """Draw the roadmap of each task that the command line names; build it first, unless its file is in the folder of --out.

    `argv`: command-line arguments; None: those of the process.  Raises SystemExit with the text of an error of the library.
    """
    parser = argparse.ArgumentParser(description="Build the maps of tasks and draw them.")
    parser.add_argument("tasks", nargs="+", choices=[*EXAMPLES, "all"], metavar="TASK", help=f"all, or of {', '.join(EXAMPLES)}")
    parser.add_argument("--method", choices=METHODS, default=METHODS[0], help="how poses are found (default: %(default)s)")
    parser.add_argument("--seed", type=int, default=0, metavar="N", help="of all that is drawn (default: 0)")
    parser.add_argument("--out", type=Path, default=Path(), metavar="FOLDER", help="where to (default: here)")
    options = parser.parse_args(argv)
    options.out.mkdir(parents=True, exist_ok=True)
    try:
        draw_all(list(EXAMPLES) if "all" in options.tasks else options.tasks, options.method, options.seed, options.out)
    except MobeeError as error:
        raise SystemExit(str(error)) from None


def draw_all(tasks: Sequence[str], method: Method, seed: int, out: Path) -> None:
    """Build and draw the roadmap of every task, and print a line for each; with several tasks also draw sheets with all of them.

    `tasks`: keys of EXAMPLES.  `method`: how poses are searched, "least_squares", "nes" or "hybrid".  `seed`: of the maps.  `out`: folder
    of all files.
    """
    strips: dict[str, list[Strip]] = {}
    clouds = []
    for task in tasks:
        example = EXAMPLES[task]()
        roadmap = build(example, method, seed, out / f"{task}.npz")
        line = f"{len(roadmap.q)} poses, {len(roadmap.edges)} edges, {roadmap.settings['seconds']:.1f} s"
        pictures = draw_cloud(example, roadmap, out / f"{task}_cloud.png"), draw_film(example, roadmap, out / f"{task}_film.png")
        print(f"{task}: {line}; {', '.join(map(str, pictures))}")
        hands = "both_hands" if set(LEFT_ARM) <= set(example.motors) else "one_hand"
        strips.setdefault(hands, []).append(strip_of(example, roadmap))
        clouds.append(cloud_panel(example, roadmap, SHEET))
    if len(tasks) > 1:
        for name, chosen in strips.items():
            filmstrip(chosen, out / f"films_{name}.png", SHEET, COLORS)
        write_sheet([("", clouds[first : first + COLUMNS]) for first in range(0, len(clouds), COLUMNS)], out / "clouds.png")


if __name__ == "__main__":
    main()
