# SPDX-License-Identifier: Apache-2.0
"""Options for roadmap files and for places (goal, start) in roadmaps, and descriptions of roadmaps, 80 columns wide."""

from __future__ import annotations

import argparse
import math
import textwrap
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from mobee import Model
from mobee.arrays import Array
from mobee.roadmap.roadmap import Roadmap, load_roadmap
from mobee.robot.motor_units import unit_name
from mobee.robot.robot import Robot
from mobee_cli.errors import UserError
from mobee_cli.robot_options import add_robot, require_none, robot_given, world_given
from services.common.exit_codes import BAD_INPUT
from services.common.worlds import NO_WORLD

COLUMNS = 80
PLACES = """A place is given by its task coordinates, in the order of `mobee roadmap show`.
The path begins at home, or at --from: task coordinates, or all motors in rad."""


def add_map(parser: argparse.ArgumentParser) -> None:
    """Add the options for a roadmap file, its robot and its world to a parser."""
    parser.add_argument("map", type=Path, metavar="MAP", help="roadmap file, written by `mobee roadmap build`")
    add_robot(parser, "default: the robot of the map, if it is a shipped one")
    text = f"use this world: a shipped one, a .xml file, or {NO_WORLD} (default: the world of the map)"
    parser.add_argument("--world", metavar="FILE", help=text)


def add_places(parser: argparse.ArgumentParser) -> None:
    """Add the options --to (goal) and --from (start) to a parser."""
    parser.add_argument("--to", nargs="+", type=_finite, required=True, metavar="Y", help="goal: task coordinates")
    parser.add_argument("--from", nargs="+", type=_finite, dest="start", metavar="Y", help="start (default: home)")


def _finite(text: str) -> float:
    """Return the finite number that a text states; raises argparse.ArgumentTypeError for any other text."""
    try:
        number = float(text)
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise argparse.ArgumentTypeError(f"{text!r} is not a finite number")
    return number


def map_given(arguments: argparse.Namespace) -> Roadmap:
    """Load the roadmap that the arguments name, with its own world or the one of the option --world.

    Raises MobeeError if it cannot be loaded, UserError if options of a URDF robot are given without --robot.
    """
    if arguments.robot is None:
        require_none(arguments, "only valid with --robot FILE", names=())
    trm = load_roadmap(arguments.map, robot=robot_given(arguments) if arguments.robot else None)
    if arguments.world is None:
        return trm
    return replace(trm, model=Model(trm.model.robot, world_given(arguments)))


def start_of(trm: Roadmap, given: list[float] | None) -> Array:
    """Return the posture (n,) rad in which a path begins.

    `given`: None: the path begins at the robot's home. As many numbers as the task has coordinates: these are task coordinates, and the
    path begins at the nearest vertex of the roadmap. n numbers: angles of all motors [rad]. Raises UserError for another count of numbers
    or an angle beyond the limits, InvalidValue if no vertex is within 1.5 spacings (distances between neighbouring vertices) of the task
    coordinates.
    """
    robot = trm.model.robot
    if given is None:
        return robot.home.copy()
    if len(given) == len(trm.spacing):
        found: Array = trm.q[trm.exit(given)]
        return found
    if len(given) != len(robot.motors):
        names = ", ".join(trm.names)
        raise UserError(
            f"--from has {len(given)} numbers; give {len(trm.spacing)} task coordinates ({names}), or {len(robot.motors)} motor positions "
            "in rad (slides: m)",
            BAD_INPUT,
        )
    q = np.array(given)
    low, high = robot.limits.T
    for motor in np.flatnonzero((q < low - 0.01) | (q > high + 0.01))[:1]:
        unit = unit_name(robot, robot.motor_table[motor])
        raise UserError(
            f"--from: {robot.motors[motor]} cannot be at {q[motor]:g} {unit}: valid is {low[motor]:.3g} to {high[motor]:.3g}", BAD_INPUT
        )
    within: Array = np.clip(q, low, high)
    return within


def wrapped(text: str, indent: str = "") -> list[str]:
    """Break a text into lines of at most 80 characters, with `indent` before the first line and two more spaces before the others."""
    return textwrap.wrap(text, COLUMNS, initial_indent=indent, subsequent_indent=f"{indent}  ", break_on_hyphens=False)


def summary(trm: Roadmap, path: Path) -> list[str]:
    """Return lines of text that describe a roadmap: its size, robot and world, settings and task coordinates.

    `path`: path of the roadmap's file.
    """
    settings = trm.settings
    parts = np.bincount(trm.graph.components) if len(trm.q) else np.empty(0, dtype=int)
    unfinished = "" if settings.get("finished", True) else ", unfinished: the same build command resumes it"
    lines = wrapped(f"{path}: {len(trm.q)} poses, {len(trm.edges)} edges{unfinished}.")
    if len(parts) > 1:
        sizes = ", ".join(map(str, parts[:5])) + (", ..." if len(parts) > 5 else "")
        lines += wrapped(f"It has {len(parts)} unconnected parts, of {sizes} poses.")
    objects = ", ".join(trm.model.world.objects) or "nothing"
    robot, world = settings.get("robot_digest", "?"), settings.get("world_digest", "?")
    lines += wrapped(f"Robot {trm.model.robot.name} {robot}, world {world} ({objects}).")
    lines += wrapped(f"Moves {', '.join(_as_parts(trm.model.robot, trm.motors))}.")
    if settings.get("costs"):
        lines += wrapped(f"Costs: {', '.join(settings['costs'])}.")
    made = [f"{key} {settings[key]}" for key in ("method", "seed", "neighbours", "longest") if settings.get(key) is not None]
    if settings.get("evaluations") is not None:
        made.append(f"{settings['evaluations']} evaluations")
    if settings.get("seconds") is not None:
        made.append(f"{settings['seconds']:.1f} s")
    if made:
        lines += wrapped(f"Made by {', '.join(made)}.")
    lines.append(f"{'coordinate':<32}{'spacing':>9}{'poses from':>12}{'to':>9}{'box from':>10}{'to':>8}")
    units, box = settings.get("units") or [""] * len(trm.names), settings.get("box") or [(np.nan, np.nan)] * len(trm.names)
    for k, name in enumerate(trm.names):
        low, high = (f"{value:.3f}" for value in (trm.y[:, k].min(), trm.y[:, k].max())) if len(trm.y) else ("-", "-")
        label = f"{name} [{units[k]}]" if units[k] else name
        lines.append(f"{label[:32]:<32}{trm.spacing[k]:>9.4g}{low:>12}{high:>9}{_number(box[k][0]):>10}{_number(box[k][1]):>8}")
    return lines


def edge_summary(trm: Roadmap) -> list[str]:
    """Return lines of text that describe how far motors turn along the edges; empty if there are no edges."""
    if not len(trm.edges):
        return []
    turns = np.abs(trm.q[trm.edges[:, 0]] - trm.q[trm.edges[:, 1]]).max(axis=1)
    usual, rare = np.quantile(turns, (0.5, 0.95))
    return wrapped(f"Largest turn of a motor along an edge: {usual:.2f} rad (median), {rare:.2f} (95 %), {turns.max():.2f} (maximum).")


def as_json(trm: Roadmap, path: Path) -> dict[str, Any]:
    """Return a description of a roadmap as plain JSON data. `path`: path of the roadmap's file.

    "poses", "edges": how many poses and edges it has. "parts": number of poses of each connected component, the largest first. "names",
    "spacing", "low" and "high" are lists with one value for each task coordinate: its name, the distance between vertices, its smallest and
    its largest value over all poses ("low" and "high" are None without poses). "settings": settings with which the roadmap was built.
    """
    return {
        "map": str(path),
        "poses": len(trm.q),
        "edges": len(trm.edges),
        "parts": np.bincount(trm.graph.components).tolist() if len(trm.q) else [],
        "names": list(trm.names),
        "spacing": trm.spacing.tolist(),
        "low": trm.y.min(axis=0).tolist() if len(trm.y) else None,
        "high": trm.y.max(axis=0).tolist() if len(trm.y) else None,
        "settings": trm.settings,
    }


def _as_parts(robot: Robot, motors: tuple[str, ...]) -> list[str]:
    """Return the names of the parts whose motors are all in `motors`, then the names of the motors that are left."""
    found, left = [], list(motors)
    for name, part in robot.parts.items():
        if set(part.motors) <= set(left):
            found.append(name)
            left = [motor for motor in left if motor not in part.motors]
    return [*found, *left]


def _number(value: float) -> str:
    return "-" if np.isnan(value) else f"{value:.3g}"
