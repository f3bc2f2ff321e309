# SPDX-License-Identifier: Apache-2.0
"""`mobee roadmap show`: describes a roadmap, and draws its poses as points.

A point is the position of a marker (a named point on a link) in one pose of the roadmap.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from mobee.control.gains import Gains
from mobee.roadmap.edges import check_edges
from mobee.roadmap.playback import timed
from mobee.roadmap.roadmap import Roadmap
from mobee_cli.errors import UserError
from mobee_cli.roadmap.map_file import add_map, as_json, edge_summary, map_given, summary, wrapped
from mobee_cli.view import require_recording, require_writable, show
from services.common.exit_codes import BAD_INPUT

if TYPE_CHECKING:
    from services.monitor.viewer.view import Stretch

DESCRIPTION = "Describe a roadmap, and draw the positions of a marker in all its poses."
NOTES = """The picture shows the robot in the middle pose of the map, and a point for each
pose: blue where the first coordinate is smallest, orange where it is largest."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `mobee roadmap show` to the parser: the roadmap and options of the picture."""
    add_map(parser)
    parser.add_argument("--picture", type=Path, metavar="FILE.png", help="file of the picture (default: MAP.png)")
    parser.add_argument("--marker", metavar="NAME", help="marker to draw (default: that of the task, else the one that moves farthest)")
    parser.add_argument("--view", action="store_true", help="show the robot moving through the map on a page instead, until Ctrl-C")
    parser.add_argument("--save", type=Path, metavar="FILE.rrd", help="write this motion to a file, for `rerun FILE`")
    parser.add_argument("--check", action="store_true", help="also check all edges for contacts, every millimetre")


def run(arguments: argparse.Namespace) -> int:
    """Run `mobee roadmap show`: print the description, draw the picture or show the motion, and return the exit code."""
    trm = map_given(arguments)
    if arguments.view or arguments.save is not None:
        return _show_tour(trm, arguments.save)
    picture: Path = arguments.picture or arguments.map.with_suffix(".png")
    robot = trm.model.robot
    marker = arguments.marker or (marker_of(trm) if robot.markers or arguments.picture else None)
    if marker is not None:
        robot.marker(marker)
    drawn = len(trm.q) > 0 and marker is not None
    if drawn:
        require_picture(picture)
    result, lines = as_json(trm, arguments.map), [*summary(trm, arguments.map), *edge_summary(trm)]
    if arguments.check:
        touching = int((~check_edges(trm.model, trm.q, trm.edges)).sum())
        result["touching"] = touching
        lines += wrapped(f"{touching or 'None'} of the {len(trm.edges)} edges {'has' if touching < 2 else 'have'} contacts.")
    if drawn and marker is not None:
        result["picture"] = str(_draw(trm, marker, picture))
        lines += wrapped(f"Picture of {marker} in all poses: {result['picture']}")
    elif marker is None:
        lines += wrapped(f"No picture: robot {robot.name!r} has no markers to draw.")
    print(json.dumps(result, indent=2) if arguments.json else "\n".join(lines))
    return 0


def require_picture(path: Path) -> None:
    """Raise UserError if a picture cannot be written to the path: its name must end in .png, and its folder must exist."""
    if path.suffix.lower() != ".png":
        raise UserError(f"--picture {path}: the picture is a PNG: give a name that ends in .png", BAD_INPUT)
    require_writable("--picture", path)


def _show_tour(trm: Roadmap, save: Path | None) -> int:
    require_recording(save)
    if not len(trm.q):
        raise UserError("the map is empty: there is nothing to show", BAD_INPUT)
    return show(trm.model.robot, trm.model.world, save, tour(trm))


def _draw(trm: Roadmap, marker: str, path: Path) -> Path:
    from mobee.rendering.sheet import marker_cloud

    shares = (trm.y - trm.y.mean(axis=0)) / trm.spacing
    middle = trm.q[int(np.linalg.norm(shares, axis=1).argmin())]
    return marker_cloud(trm.model, trm.q, marker, path, shown=middle, values=trm.y[:, 0])


def marker_of(trm: Roadmap) -> str:
    """Return the marker of a roadmap's task: the first word or words in the name of one of the task coordinates.

    If there is no such marker, return the one whose position varies most between the poses, or the robot's first marker if the roadmap has
    no poses. Raises UserError if the robot has no markers.
    """
    robot = trm.model.robot
    if not robot.markers:
        raise UserError(f"robot {robot.name!r} has no markers: add a <marker> to a link of its file", BAD_INPUT)
    named = [marker for marker in robot.markers if any(f"{name} ".startswith(f"{marker} ") for name in trm.names)]
    if named or not len(trm.q):
        return max(named, key=len) if named else next(iter(robot.markers))  # a name may begin with that of another marker
    pose = trm.model.evaluate(trm.q)
    return max(robot.markers, key=lambda marker: float(np.ptp(pose.position(marker), axis=0).max()))


TOUR_PLACES = 8


def tour(trm: Roadmap, places: int = TOUR_PLACES) -> list[Stretch]:
    """Return a tour through the roadmap as sections of a motion; each section is a path from one pose of the tour to the next.

    The tour stays in the largest connected component of the roadmap. It begins at the pose nearest to the mean of the task coordinates.
    Each next pose is the one that is farthest, in task space, from all poses chosen before. `places`: number of chosen poses.
    """
    from services.monitor.viewer.view import RATE, Stretch  # imports rerun

    inside = np.flatnonzero(trm.graph.components == 0)
    y = trm.y[inside] / trm.spacing
    apart = np.linalg.norm(y - y.mean(axis=0), axis=1)
    chosen = [int(apart.argmin())]
    nearest = np.linalg.norm(y - y[chosen[0]], axis=1)
    while len(chosen) < min(places, len(inside)):
        chosen.append(int(nearest.argmax()))
        nearest = np.minimum(nearest, np.linalg.norm(y - y[chosen[-1]], axis=1))
    stretches = []
    for start, goal in zip(inside[chosen], inside[chosen[1:]], strict=False):
        vertices = trm.graph.shortest(int(start), int(goal))
        motion = timed(trm.model.robot, trm.q[vertices], Gains.default(), dt=1.0 / RATE)
        stretches.append(Stretch(f"to {trm.format_coordinates(trm.y[goal])}", motion.q))
    return stretches or [Stretch("the only pose", trm.q[inside[:1]])]
