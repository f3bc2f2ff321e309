"""Prints the path through a roadmap to a place: poses, duration, contacts."""

from __future__ import annotations

import argparse
import json
from dataclasses import replace
from typing import Any

import numpy as np

from mobee.arrays import Array
from mobee.control.gains import Gains
from mobee.errors import InvalidValue, MobeeError
from mobee.roadmap.playback import timed
from mobee.roadmap.roadmap import Roadmap
from mobee_cli.errors import UserError
from mobee_cli.roadmap.map_file import PLACES, add_map, add_places, map_given, start_of
from mobee_cli.roadmap.text import wrapped
from services.common.exit_codes import FAILED

NOTES = PLACES + "\nExit code: 0 a free way, 1 none, or something is in the way, 2 bad input."
_NEAR = 0.25  # rad: the law's own forces keep a motor that far from its place
_MOST = 12  # poses that are told one by one


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The map, and between what."""
    add_map(parser)
    add_places(parser)


def run(arguments: argparse.Namespace) -> int:
    """Find it and tell it."""
    trm = map_given(arguments)
    found = way_of(trm, start_of(trm, arguments.start), arguments.to)
    print(
        json.dumps(found | {"names": list(trm.names), "motors": list(trm.model.robot.motors)}, indent=2)
        if arguments.json
        else "\n".join(told(trm, found))
    )
    return 0 if found["free"] else FAILED


def way_of(trm: Roadmap, start: Array, goal: list[float]) -> dict[str, Any]:
    """The shortest free way as plain JSON values; where there is none, the shortest, with why.  UserError where there is none at all.

    Motors that the map does not move stay where they are, if they are near their place in it.
    """
    shortest = _way(trm, start, goal)
    stay = np.abs(start - trm.q[shortest[0]]) < _NEAR
    stay[[trm.model.robot.motor_index(name) for name in trm.motors]] = False
    trm = replace(trm, q=np.where(stay, start, trm.q))
    why = ""
    try:
        vertices = trm.way(start, goal, free=True)
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


def _way(trm: Roadmap, start: Array, goal: list[float]) -> list[int]:
    try:
        return trm.way(start, goal)
    except InvalidValue:
        raise
    except MobeeError as error:
        raise UserError(str(error), FAILED) from None


def told(trm: Roadmap, found: dict[str, Any]) -> list[str]:
    """For a person, at most 80 columns wide."""
    vertices, place = found["vertices"], np.array(found["place"])
    count = len(vertices)
    lines = wrapped(
        f"To {trm.told(place)}, {max(found['missing']):.2f} spacings from what was asked: over {count} {'pose' if count == 1 else 'poses'} "
        f"of the map, {found['length']:.2f} rad, no step of a motor above {found['largest_step']:.2f} rad, {found['seconds']:.1f} s."
    )
    if found["entry"] > 0.0:
        lines += wrapped(
            f"From the start to the map's nearest pose some motor turns by {found['entry']:.2f} rad, which no edge vouches for."
        )
    shown = vertices if count <= _MOST else [*vertices[: _MOST // 2], None, *vertices[-_MOST // 2 :]]
    lines += [f"  {'...' if one is None else f'{one:>6}  {trm.told(trm.y[one])}'}"[:80] for one in shown]
    if not found["free"]:
        return lines + wrapped(f"Something is in the way: {found['why']}")
    round_it = "" if found["shortest"] else "The shortest way touches something: this one leads round it. "
    return lines + wrapped(f"{round_it}Nothing is in its way, by a check every millimetre.")
