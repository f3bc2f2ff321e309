"""Prints what a roadmap contains, and draws its marker in all poses."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import numpy as np

from mobee.roadmap.edges import check_edges
from mobee.roadmap.roadmap import Roadmap
from mobee_cli.errors import UserError
from mobee_cli.roadmap.map_file import add_map, map_given
from mobee_cli.roadmap.text import as_json, edges_told, summary, wrapped
from mobee_cli.view import require_recording, show
from services.common.exit_codes import BAD_INPUT

NOTES = """The picture shows the robot in the middle pose of the map, and a point for each
pose: blue where the first coordinate is least, orange where it is largest."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The map, and the picture."""
    add_map(parser)
    parser.add_argument("--picture", type=Path, metavar="FILE.png", help="where to (default: beside the map)")
    parser.add_argument("--marker", metavar="NAME", help="whose places are drawn (default: the one that moves farthest)")
    parser.add_argument("--view", action="store_true", help="show a tour of the map on a page instead, until Ctrl-C")
    parser.add_argument("--save", type=Path, metavar="FILE.rrd", help="write that tour to a file, for `rerun FILE`")
    parser.add_argument("--check", action="store_true", help="also check every edge for contacts, every millimetre")


def run(arguments: argparse.Namespace) -> int:
    """Tell, and draw."""
    trm = map_given(arguments)
    if arguments.view or arguments.save is not None:
        return _toured(trm, arguments.save)
    marker = arguments.marker or marker_of(trm)
    trm.model.robot.marker(marker)
    told, lines = as_json(trm, arguments.map), [*summary(trm, arguments.map), *edges_told(trm)]
    if arguments.check:
        touching = int((~check_edges(trm.model, trm.q, trm.edges, marker=marker)).sum())
        told["touching"] = touching
        lines += wrapped(
            f"{touching or 'None'} of the {len(trm.edges)} edges {'touches' if touching < 2 else 'touch'} something on the way."
        )
    if len(trm.q):
        told["picture"] = str(_draw(trm, marker, arguments.picture or arguments.map.with_suffix(".png")))
        lines += wrapped(f"Where {marker} is: {told['picture']}")
    print(json.dumps(told, indent=2) if arguments.json else "\n".join(lines))
    return 0


def _toured(trm: Roadmap, save: Path | None) -> int:
    require_recording(save)
    if not len(trm.q):
        raise UserError("the map is empty: there is nothing to show", BAD_INPUT)
    from mobee_cli.roadmap.tour import tour

    return show(trm.model.robot, trm.model.world, save, tour(trm))


def _draw(trm: Roadmap, marker: str, path: Path) -> Path:
    from mobee.rendering.sheet import marker_cloud

    if path.suffix.lower() != ".png":
        raise UserError(f"--picture {path}: it is a PNG: give a name that ends in .png", BAD_INPUT)
    if not path.resolve().parent.is_dir():
        raise UserError(f"--picture {path}: there is no folder {path.resolve().parent}: make it", BAD_INPUT)
    shares = (trm.y - trm.y.mean(axis=0)) / trm.spacing
    middle = trm.q[int(np.linalg.norm(shares, axis=1).argmin())]
    return marker_cloud(trm.model, trm.q, marker, path, shown=middle, values=trm.y[:, 0])


def marker_of(trm: Roadmap) -> str:
    """The one that the task names, or that moves farthest between the poses."""
    robot = trm.model.robot
    if not robot.markers:
        raise UserError(f"robot {robot.name!r} has no markers to show", BAD_INPUT)
    named = [marker for marker in robot.markers if any(name.startswith(marker) for name in trm.names)]
    if named or not len(trm.q):
        return (named or list(robot.markers))[0]
    pose = trm.model.evaluate(trm.q)
    return max(robot.markers, key=lambda marker: float(np.ptp(pose.position(marker), axis=0).max()))
