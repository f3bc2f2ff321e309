# SPDX-License-Identifier: Apache-2.0
"""`mobee roadmap play`: moves the robot along a path of a roadmap under the control law, offline or live."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

import numpy as np

from experiments.kit.command_line import positive_number
from mobee import constraint_forces
from mobee.control.gains import Gains
from mobee.roadmap.playback import SPEED, Played, play
from mobee.roadmap.roadmap import Roadmap
from mobee.robot.motor_units import slides
from mobee_cli.connect import add_endpoint
from mobee_cli.errors import UserError
from mobee_cli.roadmap.map_file import PLACES, add_map, add_places, map_given, start_of, wrapped
from mobee_cli.roadmap.query import find_path, require_free
from mobee_cli.roadmap.show import marker_of, require_picture
from services.common.exit_codes import BAD_INPUT, FAILED

DESCRIPTION = "Move the robot along a path of a roadmap under the control law, offline or live."
NOTES = (
    PLACES
    + """
With --live the path begins where the robot is, and no agent may own a part that
moves. Ctrl-C ends the motion: the robot stays where it is.
It has arrived when it is at rest and the marker of the map is within the
tolerance of its place on the path's last pose.
Exit code: 0 arrived, 1 not arrived, or the path has contacts, 2 bad input, 3 no
system is running."""
)
MIN_FORCE = 0.5  # rad/s^2: a weaker force moves a motor by less than a quarter of a degree
MIN_ERROR = 0.02  # rad: smaller errors are not explained
TOLERANCE = 10.0  # mm: a marker that ends farther from its goal has not arrived


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `mobee roadmap play` to the parser: roadmap, goal, start and options of the motion."""
    add_map(parser)
    add_places(parser)
    parser.add_argument(
        "--speed",
        type=float,
        default=SPEED,
        metavar="X",
        help="share of the highest speed (default: %(default)g)",
    )
    text = f"largest remaining error of an arrival (default: {TOLERANCE:g})"
    parser.add_argument("--tolerance", type=positive_number, default=TOLERANCE, metavar="MM", help=text)
    parser.add_argument("--gains", default="default", metavar="NAME", help="gains of the control law, offline: default or published_2014")
    parser.add_argument("--seed", type=int, default=0, metavar="N", help="seed of the encoders' noise, offline (default: 0)")
    parser.add_argument("--picture", type=Path, metavar="FILE.png", help="draw the motion as a filmstrip")
    parser.add_argument("--live", action="store_true", help="move the robot of the running system")
    parser.add_argument("--anyway", action="store_true", help="move even if the path has contacts; the law's forces keep the robot off")
    text = "live: move even if the world differs from that of the map, if the path has no contacts there"
    parser.add_argument("--other-world", action="store_true", help=text)
    add_endpoint(parser)


def run(arguments: argparse.Namespace) -> int:
    """Run `mobee roadmap play`: find a path through a roadmap, move the robot along it, and print the result.

    Returns the exit code (0: arrived, 1: not arrived).
    """
    if not 0.0 < arguments.speed <= 1.0:
        raise UserError(f"--speed {arguments.speed:g}: must be above 0 and at most 1", BAD_INPUT)
    if arguments.live and arguments.world is not None:
        raise UserError(f"--world {arguments.world}: only valid offline; with --live the world is that of the running model", BAD_INPUT)
    if arguments.picture is not None:
        require_picture(arguments.picture)
    trm = map_given(arguments)
    marker_of(trm)  # by which the arrival is judged: without one, refused before the robot moves
    if arguments.live:
        from mobee_cli.roadmap.live import play_live

        return report(*play_live(trm, arguments), arguments)
    path = find_path(trm, start_of(trm, arguments.start), arguments.to)
    require_free(trm, path, arguments.anyway)
    gains = Gains.named(arguments.gains)
    played = play(trm.model, path["poses"], arguments.speed, gains=gains, seed=arguments.seed)
    return report(trm, path, played, gains, arguments)


def report(trm: Roadmap, path: dict[str, Any], played: Played, gains: Gains, arguments: argparse.Namespace) -> int:
    """Print the result of a motion, draw the motion if the arguments request it, and return the exit code.

    `trm`: the roadmap. `path`: the planned path, as returned by `mobee_cli.roadmap.query.find_path`. `played`: the motion along it.
    `gains`: gains of the control law in this motion.
    """
    found = result_of(trm, path, played, arguments.tolerance) | held_off(trm, path, played, gains)
    if arguments.picture is not None:
        found["picture"] = str(arguments.picture)
    print(json.dumps(found, indent=2) if arguments.json else "\n".join(_lines(trm, found)), flush=True)
    if arguments.picture is not None:  # after the result, which must not be lost if the picture cannot be drawn
        _draw(trm, played, arguments.picture)
    return 0 if found["arrived"] else FAILED


def result_of(trm: Roadmap, path: dict[str, Any], played: Played, tolerance: float) -> dict[str, Any]:
    """Return the result of a motion as plain JSON data; lengths in m, angles in rad, times in s.

    In distances between positions the whole range of a motor that slides counts as 200 deg (`mobee.robot.motor_units`).

    `path`: the planned path, as returned by `mobee_cli.roadmap.query.find_path`. `played`: the motion along it. `tolerance`: largest
    remaining error of the marker [mm] at which the robot has arrived.

    Keys of the result: "place": task coordinates of the last vertex of the path. "remaining_error": distance of the roadmap's marker from
    its goal; "markers": the same distance for every marker, by name. "rested": whether the robot came to rest. The next three are largest
    distances over all motors that the plan moves. "lag": between the real and the planned position at the same time. "off": between the
    real pose and the nearest planned pose, of any time. "missing": between the last position and the goal. "solid": depth of the deepest
    contact of solids. "field": the same of fields (volumes that cause repulsive forces). "touched": all pairs of solids in contact in the
    pose with the deepest solid contact.
    """
    pose = trm.model.evaluate(np.array([played.q[-1], path["poses"][-1]]))
    markers = {name: float(np.linalg.norm(np.diff(pose.position(name), axis=0))) for name in trm.model.robot.markers}
    error = markers[marker_of(trm)]
    return {
        "place": path["place"],
        "arrived": played.rested and 1e3 * error <= tolerance,
        "remaining_error": error,
        "tolerance": tolerance / 1e3,
        "seconds": float(played.times[-1]),
        "rested": played.rested,
        "lag": played.lag,
        "off": played.off,
        "missing": played.missing,
        "markers": markers,
        "solid": float(played.solid.max()),
        "field": float(played.field.max()),
        "touched": [f"{one.first} and {one.second}" for one in played.deepest],
        "q": played.q[-1].tolist(),
    }


def held_off(trm: Roadmap, path: dict[str, Any], played: Played, gains: Gains) -> dict[str, Any]:
    """Return the motor that ended farthest from its goal, and the strongest constraint force on it in the last pose.

    Keys of the result: "farthest": name of the motor, one that the path moves. "farthest_error": its distance from the goal, in its own
    unit (rad or m). "held_by": "its limit", "a constraint of the robot" or "a
    field in contact" (a field is a volume around a link that causes repulsive forces); None if no such force exceeds 0.5 rad/s^2. `path`:
    the planned path, as returned by `mobee_cli.roadmap.query.find_path`. `played`: the motion along it, with the `gains`.
    """
    off = np.abs(played.q[-1] - path["poses"][-1]) * (np.ptp(path["poses"], axis=0) > 0.0)
    motor = int((off / played.units).argmax())
    forces = constraint_forces(trm.model.evaluate(played.q[-1]), gains)
    strengths = {"its limit": forces.limits, "a constraint of the robot": forces.constraints, "a field in contact": forces.collision}
    why, force = max(((name, abs(float(one[motor]))) for name, one in strengths.items()), key=lambda pair: pair[1])
    held_by = why if force > MIN_FORCE * played.units[motor] else None
    return {"farthest": trm.model.robot.motors[motor], "farthest_error": float(off[motor]), "held_by": held_by}


def _lines(trm: Roadmap, found: dict[str, Any]) -> list[str]:
    marker = marker_of(trm)
    verdict = "Arrived" if found["arrived"] else "Did not arrive"
    moving = "" if found["rested"] else ", still moving"
    held = f", held off by {found['held_by']}" if found["held_by"] and found["missing"] > MIN_ERROR else ""
    error, tolerance = 1e3 * found["remaining_error"], 1e3 * found["tolerance"]
    away = f"the remaining error of {marker} is {error:.1f} mm (tolerance {tolerance:g} mm)"
    lines = wrapped(f"{verdict} at {trm.format_coordinates(np.array(found['place']))} after {found['seconds']:.1f} s{moving}: {away}.")
    robot = trm.model.robot
    motor = robot.motor_table[robot.motors.index(found["farthest"])]
    left = f"{1e3 * found['farthest_error']:.1f} mm" if slides(robot, motor) else f"{found['farthest_error']:.3f} rad"
    lines += wrapped(f"The motor farthest from its goal is {found['farthest']}, by {left}{held}.")
    off, lag = found["off"], found["lag"]
    counted = " (the range of a slide counts as 200 deg)" if any(slides(robot, one) for one in robot.motor_table) else ""
    text = f"Largest distance of a motor from the path: {off:.3f} rad; from its planned position at the time: {lag:.3f} rad{counted}."
    lines += wrapped(text)
    if found["solid"] > 0.0:
        lines += wrapped(f"Solids touched, by {1e3 * found['solid']:.1f} mm at most: {', '.join(found['touched'])}.")
    else:
        lines += wrapped(f"No solids touched; fields overlapped by {1e3 * found['field']:.0f} mm at most.")
    if "picture" in found:
        lines += wrapped(f"Filmstrip: {found['picture']}")
    return lines


def _draw(trm: Roadmap, played: Played, path: Path) -> None:
    from mobee.rendering.sheet import Strip, filmstrip, motion_through

    rows = slice(None, None, 10)
    motion = motion_through(trm.model, played.q[rows], played.times[rows].tolist())
    filmstrip([Strip(motion, marker_of(trm))], path)
