"""Moves the robot to a place of a roadmap under the control law, offline or live."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

import numpy as np

from mobee import constraint_forces
from mobee.control.gains import Gains
from mobee.roadmap.playback import SPEED, Played, play
from mobee.roadmap.roadmap import Roadmap
from mobee_cli.connect import add_endpoint
from mobee_cli.errors import UserError
from mobee_cli.roadmap.map_file import PLACES, add_map, add_places, map_given, start_of
from mobee_cli.roadmap.query import way_of
from mobee_cli.roadmap.show import marker_of
from mobee_cli.roadmap.text import wrapped
from services.common.exit_codes import BAD_INPUT, FAILED

NOTES = (
    PLACES
    + """
Live, it begins where the robot is, and the goals of all parts that move must be
free. Ctrl-C ends it: what moved stays where it is then.
Exit code: 0 arrived, 1 not, or something is in the way, 2 bad input, 3 no system
is running."""
)
_FORCE = 0.5  # rad/s^2: a weaker one moves a motor by a quarter of a degree
_TOLD = 0.02  # rad
_NEAR = 0.1  # rad: a motor that ends farther from its place has not arrived


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The map, between what, and how."""
    add_map(parser)
    add_places(parser)
    parser.add_argument("--speed", type=float, default=SPEED, metavar="X", help="share of what the springs can do (default: %(default)g)")
    parser.add_argument("--gains", default="default", metavar="NAME", help="of the control law, offline: default or published_2014")
    parser.add_argument("--seed", type=int, default=0, metavar="N", help="of the encoders' noise, offline (default: 0)")
    parser.add_argument("--picture", type=Path, metavar="FILE.png", help="draw the motion as a filmstrip")
    parser.add_argument("--live", action="store_true", help="on the robot of the running system")
    parser.add_argument("--anyway", action="store_true", help="play although something is in the way: fields and limits will keep it off")
    text = "live: play although its world is not the map's, if nothing is in the way there"
    parser.add_argument("--other-world", action="store_true", help=text)
    add_endpoint(parser)


def run(arguments: argparse.Namespace) -> int:
    """Find the way, play it, tell how it went."""
    if not 0.0 < arguments.speed <= 1.0:
        raise UserError(f"--speed {arguments.speed:g}: must be above 0 and at most 1", BAD_INPUT)
    if arguments.live and arguments.world is not None:
        raise UserError(f"--world {arguments.world}: it is for offline; live, the world is that of the running model", BAD_INPUT)
    trm = map_given(arguments)
    if arguments.live:
        from mobee_cli.roadmap.live import play_live

        return play_live(trm, arguments)
    way = way_of(trm, start_of(trm, arguments.start), arguments.to)
    require_free(trm, way, arguments.anyway)
    gains = Gains.named(arguments.gains)
    played = play(trm.model, way["poses"], arguments.speed, gains=gains, seed=arguments.seed)
    return tell(trm, way, played, gains, arguments)


def tell(trm: Roadmap, way: dict[str, Any], played: Played, gains: Gains, arguments: argparse.Namespace) -> int:
    """Print how it went, draw it if that is asked for; returns the exit code."""
    found = result_of(trm, way, played) | held_off(trm, way, played, gains)
    if arguments.picture is not None:
        found["picture"] = str(_filmstrip(trm, played, arguments.picture))
    print(json.dumps(found, indent=2) if arguments.json else "\n".join(_lines(trm, found)))
    return 0 if found["arrived"] else FAILED


def require_free(trm: Roadmap, way: dict[str, Any], anyway: bool) -> None:
    """Raise UserError where something is in the way."""
    if not way["free"] and not anyway:
        raise UserError(f"something is in the way: {way['why']} --anyway plays the shortest all the same", FAILED)


def result_of(trm: Roadmap, way: dict[str, Any], played: Played) -> dict[str, Any]:
    """As plain JSON values."""
    pose = trm.model.evaluate(np.array([played.q[-1], way["poses"][-1]]))
    markers = {name: float(np.linalg.norm(np.diff(pose.position(name), axis=0))) for name in trm.model.robot.markers}
    return {
        "place": way["place"],
        "arrived": played.rested and played.missing <= _NEAR,
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


def held_off(trm: Roadmap, way: dict[str, Any], played: Played, gains: Gains) -> dict[str, Any]:
    """The motor that ended farthest from its place, and which of the law's forces kept it there, None for none."""
    off = np.abs(played.q[-1] - way["poses"][-1]) * (np.ptp(way["poses"], axis=0) > 0.0)
    motor = int(off.argmax())
    forces = constraint_forces(trm.model.evaluate(played.q[-1]), gains)
    strengths = {"its limit": forces.limits, "a constraint of the robot": forces.constraints, "a field that touches": forces.collision}
    why, force = max(((name, abs(float(one[motor]))) for name, one in strengths.items()), key=lambda pair: pair[1])
    return {"farthest": trm.model.robot.motors[motor], "held_by": why if force > _FORCE else None}


def _lines(trm: Roadmap, found: dict[str, Any]) -> list[str]:
    marker = marker_of(trm)
    verdict = "Arrived" if found["arrived"] else "Did not arrive"
    rest = "" if found["rested"] else ", still moving"
    held = f", kept off by {found['held_by']}" if found["held_by"] and found["missing"] > _TOLD else ""
    away = (
        f"{marker} {1e3 * found['markers'][marker]:.0f} mm from there, {found['farthest']} {found['missing']:.3f} rad from its place{held}"
    )
    lines = wrapped(f"{verdict} at {trm.told(np.array(found['place']))} after {found['seconds']:.1f} s{rest}: {away}.")
    far = f"farther than {found['off']:.3f} rad from the path, nor than {found['lag']:.3f} rad from where it was to be just then"
    lines += wrapped(f"On the way no motor came {far}.")
    if found["solid"] > 0.0:
        lines += wrapped(f"Solids touched, by {1e3 * found['solid']:.1f} mm at most: {', '.join(found['touched'])}.")
    else:
        lines += wrapped(f"No solids touched; fields overlapped by {1e3 * found['field']:.0f} mm at most.")
    if "picture" in found:
        lines += wrapped(f"Filmstrip: {found['picture']}")
    return lines


def _filmstrip(trm: Roadmap, played: Played, path: Path) -> Path:
    from mobee.rendering.motion import motion_through
    from mobee.rendering.sheet import Strip, filmstrip

    if path.suffix.lower() != ".png" or not path.resolve().parent.is_dir():
        raise UserError(f"--picture {path}: give a name that ends in .png, in a folder that is there", BAD_INPUT)
    rows = slice(None, None, 10)
    motion = motion_through(trm.model, played.q[rows], played.times[rows].tolist())
    return filmstrip([Strip(motion, marker_of(trm))], path)
