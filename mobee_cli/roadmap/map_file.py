"""Roadmap files and places in them, on the command line."""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np

from mobee import Model
from mobee.arrays import Array
from mobee.roadmap.roadmap import Roadmap, load_roadmap
from mobee_cli.errors import UserError
from mobee_cli.robot_options import add_robot, require_none, robot_given, world_given
from services.common.exit_codes import BAD_INPUT
from services.common.worlds import NO_WORLD

PLACES = """A place is the task's coordinates, in the order of `mobee roadmap show`.
The way begins at home, or at --from: a place of the map, or all motors in rad."""


def add_map(parser: argparse.ArgumentParser) -> None:
    """The map, and its robot."""
    parser.add_argument("map", type=Path, metavar="MAP", help="a map's file, as `mobee roadmap build` writes it")
    add_robot(parser, "default: the one it was made for, if that comes with mobee")
    text = f"look at it in this world: a shipped one, a .xml file, or {NO_WORLD} (default: the world it was made in)"
    parser.add_argument("--world", metavar="FILE", help=text)


def add_places(parser: argparse.ArgumentParser) -> None:
    """Where to, where from."""
    parser.add_argument("--to", nargs="+", type=float, required=True, metavar="Y", help="the place: task coordinates")
    parser.add_argument("--from", nargs="+", type=float, dest="start", metavar="Y", help="where from (default: home)")


def map_given(arguments: argparse.Namespace) -> Roadmap:
    """The map that is named, in the world it was made in or in the one that is given.

    Raises MobeeError; UserError for options of a robot where none is named.
    """
    if arguments.robot is None:
        require_none(arguments, "it is for the robot of --robot FILE", names=())
    trm = load_roadmap(arguments.map, robot=robot_given(arguments) if arguments.robot else None)
    if arguments.world is None:
        return trm
    return replace(trm, model=Model(trm.model.robot, world_given(arguments)))


def start_of(trm: Roadmap, given: list[float] | None) -> Array:
    """The posture (n,) rad where the way begins."""
    robot = trm.model.robot
    if given is None:
        return robot.home.copy()
    if len(given) == len(trm.spacing):
        found: Array = trm.q[trm.exit(given)]
        return found
    if len(given) != len(robot.motors):
        names = ", ".join(trm.names)
        raise UserError(
            f"--from has {len(given)} numbers; give {len(trm.spacing)} task coordinates ({names}), or {len(robot.motors)} angles in rad",
            BAD_INPUT,
        )
    q = np.array(given)
    low, high = robot.limits.T
    for motor in np.flatnonzero((q < low - 0.01) | (q > high + 0.01))[:1]:
        raise UserError(
            f"--from: {robot.motors[motor]} cannot be at {q[motor]:g} rad: valid is {low[motor]:.3g} to {high[motor]:.3g}", BAD_INPUT
        )
    within: Array = np.clip(q, low, high)
    return within
