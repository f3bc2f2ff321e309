# SPDX-License-Identifier: Apache-2.0
"""`mobee roadmap query`: finds a path through a roadmap to a task-space goal."""

from __future__ import annotations

import argparse
import json
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mobee.arrays import Array
from mobee.control.gains import Gains
from mobee.errors import InvalidValue, MobeeError
from mobee.model.kinematics import tables
from mobee.roadmap.playback import timed
from mobee.roadmap.roadmap import Roadmap
from mobee.robot.motor_units import motor_units
from mobee_cli.errors import UserError
from mobee_cli.roadmap.map_file import COLUMNS, PLACES, add_map, add_places, map_given, start_of, wrapped
from services.common.exit_codes import FAILED

DESCRIPTION = "Find a path through a roadmap to a place, and print its poses and its duration."
NOTES = PLACES + "\nExit code: 0 a path without contacts, 1 none, or it has contacts, 2 bad input."
NEAR_TURN = 0.25  # rad: the forces of the control law keep a motor this far from its place
MAX_LISTED = 12  # poses that are printed one by one


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `mobee roadmap query` to the parser: roadmap, goal and start."""
    add_map(parser)
    add_places(parser)


def run(arguments: argparse.Namespace) -> int:
    """Run `mobee roadmap query`: find a path through a roadmap, print it, and return the exit code (0: it has no contacts, 1: it has)."""
    trm = map_given(arguments)
    found = find_path(trm, start_of(trm, arguments.start), arguments.to)
    print(
        json.dumps(found | {"names": list(trm.names), "motors": list(trm.model.robot.motors)}, indent=2)
        if arguments.json
        else "\n".join(path_text(trm, found))
    )
    return 0 if found["free"] else FAILED


def find_path(trm: Roadmap, start: Array, goal: list[float]) -> dict[str, Any]:
    """Return the shortest path without contacts as plain JSON data.

    If there is none, return the shortest path with contacts, and the reason. `start`: posture (n,) rad. `goal`: task coordinates. A motor
    that the roadmap does not move, and that carries no marker of the roadmap's coordinates and costs, stays where it is if it is less than
    0.25 rad from its position in the roadmap (the range of a slide counts as 200 deg); otherwise the path moves it to this position.
    Raises UserError if the roadmap has no path at all.

    Keys of the result: "vertices": indices of the path's vertices. "place": task coordinates of the last one; "missing": its distance from
    the goal in each task coordinate, in multiples of the distance between vertices. "poses": (K, n) rad, from the start. "length": length
    of the path [rad]. "entry": largest angle by which a motor turns from the start to the first vertex [rad]. "largest_step": largest angle
    by which a motor turns from one pose to the next [rad]. "seconds": duration of the motion [s]. "shortest": whether the path is also the
    shortest one if contacts are ignored. "free": False if the path has contacts. "why": the reason if no path without contacts was found,
    otherwise empty.
    """
    shortest = _shortest(trm, start, goal)
    robot = trm.model.robot
    stay = np.abs(start - trm.q[shortest[0]]) < NEAR_TURN * motor_units(robot)
    stay[[robot.motor_index(name) for name in trm.motors]] = False
    stay &= ~_carries(trm)  # else the markers would not be where the map has them
    trm = replace(trm, q=np.where(stay, start, trm.q))
    why = ""
    try:
        vertices = trm.vertex_path(start, goal, free=True)
    except InvalidValue:
        raise
    except MobeeError as error:
        vertices, why = shortest, str(error)
    poses = trm.q[vertices]
    path = poses if np.array_equal(poses[0], start) else np.concatenate([start[None], poses])
    steps = np.abs(np.diff(path, axis=0))
    place = trm.y[vertices[-1]]
    return {
        "vertices": vertices,
        "place": place.tolist(),
        "missing": (np.abs(place - goal) / trm.spacing).tolist(),
        "poses": path.tolist(),
        "length": float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum()),
        "entry": float(np.abs(path[0] - poses[0]).max()),
        "largest_step": float(steps.max(initial=0.0)),
        "seconds": float(timed(trm.model.robot, path, Gains.default()).times[-1]),
        "shortest": vertices == shortest,
        "free": not why,
        "why": why,
    }


def _carries(trm: Roadmap) -> NDArray[np.bool_]:
    """Return whether each motor moves a marker that the names of the roadmap's coordinates or costs have, (n,)."""
    robot, known = trm.model.robot, tables(trm.model.robot)
    text = f" {' '.join([*trm.names, *trm.settings.get('costs', ())])} "
    above = np.zeros(len(robot.joints), dtype=bool)
    for name, marker in robot.markers.items():
        if f" {name} " in text:  # a name may contain blanks
            above[known.ancestry[marker.link]] = True
    moves: NDArray[np.bool_] = np.abs(known.coupling) @ above > 0.0
    return moves


def require_free(trm: Roadmap, path: dict[str, Any], anyway: bool) -> None:
    """Raise UserError if the path (as returned by `find_path`) has contacts, unless `anyway` is True."""
    if not path["free"] and not anyway:
        raise UserError(f"the path has contacts: {path['why']} --anyway moves along the shortest path nevertheless", FAILED)


def _shortest(trm: Roadmap, start: Array, goal: list[float]) -> list[int]:
    try:
        return trm.vertex_path(start, goal)
    except InvalidValue:
        raise
    except MobeeError as error:
        raise UserError(str(error), FAILED) from None


def path_text(trm: Roadmap, found: dict[str, Any]) -> list[str]:
    """Return the path `found`, as returned by `find_path`, as lines of text, at most 80 columns wide."""
    vertices, place = found["vertices"], np.array(found["place"])
    count = len(vertices)
    lines = wrapped(
        f"To {trm.format_coordinates(place)}, {max(found['missing']):.2f} spacings from the goal: over {count} "
        f"{'pose' if count == 1 else 'poses'} "
        f"of the map, {found['length']:.2f} rad, no step of a motor above {found['largest_step']:.2f} rad, {found['seconds']:.1f} s."
    )
    if found["entry"] > 0.0:
        lines += wrapped(
            f"From the start to the nearest pose of the map a motor turns by {found['entry']:.2f} rad; no edge covers this motion."
        )
    shown = vertices if count <= MAX_LISTED else [*vertices[: MAX_LISTED // 2], None, *vertices[-MAX_LISTED // 2 :]]
    lines += [f"  {'...' if one is None else f'{one:>6}  {trm.format_coordinates(trm.y[one])}'}"[:COLUMNS] for one in shown]
    if not found["free"]:
        return lines + wrapped(f"The path has contacts: {found['why']}")
    detour = "" if found["shortest"] else "The shortest path has contacts: this one avoids them. "
    return lines + wrapped(f"{detour}The path has no contacts, checked every millimetre.")
