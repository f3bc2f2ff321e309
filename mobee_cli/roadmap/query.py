"""The way through a map to a place of its task: the poses, how long it takes, and whether anything is in the way."""

from __future__ import annotations

import argparse
import json
from typing import Any

import numpy as np

from mobee.control.gains import Gains
from mobee.errors import InvalidValue, MobeeError
from mobee.roadmap.edges import check_edges
from mobee.roadmap.playback import timed
from mobee.roadmap.roadmap import Roadmap
from mobee.robot.robot import Array
from mobee_cli.errors import FAILED, UserError
from mobee_cli.roadmap.map_file import PLACES, add_map, add_places, map_given, start_of
from mobee_cli.roadmap.text import wrapped

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
    """The way as plain JSON values; raises UserError where there is none.

    Motors that the map does not move stay where they are, if they are near their place in it.
    """
    exit_ = trm.exit(goal)
    try:
        path, vertices = trm.path(start, goal), trm.way(start, goal)
    except InvalidValue:
        raise
    except MobeeError as error:
        raise UserError(str(error), FAILED) from None
    stay = np.abs(path[0] - path[-1]) < _NEAR
    stay[[trm.model.robot.motor_index(name) for name in trm.motors]] = False
    path[:, stay] = start[stay]
    steps = np.abs(np.diff(path, axis=0))
    free = check_edges(trm.model, path, np.stack([np.arange(len(path) - 1), np.arange(1, len(path))], axis=1))
    return {
        "vertices": vertices,
        "place": trm.y[exit_].tolist(),
        "missing": (np.abs(trm.y[exit_] - goal) / trm.spacing).tolist(),
        "poses": path.tolist(),
        "length": float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum()),
        "entry": float(np.abs(path[0] - trm.q[vertices[0]]).max()),
        "largest_step": float(steps.max(initial=0.0)),
        "seconds": float(timed(trm.model.robot, path, Gains.default()).times[-1]),
        "blocked": np.flatnonzero(~free).tolist(),
        "free": bool(free.all()),
    }


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
    if found["free"]:
        return [*lines, "Nothing is in the way, by a check every millimetre."]
    first = found["blocked"][0]
    return lines + wrapped(
        f"Something is in the way: on {len(found['blocked'])} of its {len(found['poses']) - 1} steps, first on step {first + 1}."
    )
