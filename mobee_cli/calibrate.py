# SPDX-License-Identifier: Apache-2.0
"""`mobee calibrate`: measures how the cameras and head encoders of a robot differ from its model. The robot looks at its own hand."""

from __future__ import annotations

import argparse
import json
import textwrap
from pathlib import Path
from typing import Any

import numpy as np

from experiments.kit.command_line import Progress, positive_whole
from mobee.arrays import Array
from mobee.errors import MobeeError
from mobee.model.model import Model
from mobee.robot.cameras import cameras_of
from mobee.robot.robot import Robot
from mobee.vision.calibration.calibration import Calibration, Quality, Unobservable
from mobee.vision.calibration.observing import Watcher, choose_postures, watch_hand
from mobee.vision.calibration.solve import calibrate
from mobee.vision.imperfections import CameraSettings, camera_errors
from mobee.vision.rig import AXES, Rig
from mobee.vision.tag import Tag
from mobee_cli.connect import add_endpoint
from mobee_cli.errors import UserError
from mobee_cli.robot_options import add_robot, add_world, require_none, robot_given, world_given
from services.common.cameras import STEREO, require_cameras
from services.common.exit_codes import BAD_INPUT
from services.common.hands import part_of

POSTURES = 40
FILE = Path("calibration.json")
_NOTES = """The robot moves its hand, with a tag on the palm, through postures in which all
cameras see the tag. Least squares then find where the cameras are, the offsets
of the head's encoders, the latency of the pictures, and where the tag is.
Without --live the robot is a simulated one, whose errors are drawn by --seed,
and the result is compared with them. With --live it is that of the running
system: mobee launch eyes
A scenario uses the file as `calibration` of the services vision and model."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `mobee calibrate` to the parser: robot, postures, file and others."""
    parser.epilog = _NOTES
    parser.add_argument("--live", action="store_true", help="calibrate the robot of the running system, not a simulated one")
    parser.add_argument("--save", type=Path, default=FILE, metavar="FILE", help="file of the result (default: %(default)s)")
    parser.add_argument(
        "--postures", type=positive_whole, default=POSTURES, metavar="N", help="postures of the hand (default: %(default)s)"
    )
    parser.add_argument("--marker", default="left_palm", help="marker that carries the tag (default: %(default)s)")
    parser.add_argument("--seed", type=int, default=0, metavar="N", help="of postures, and of the simulated robot's errors (default: 0)")
    add_robot(parser, "without --live; default: icub")
    add_world(parser)
    parser.add_argument("--json", action="store_true", help="print as JSON")
    add_endpoint(parser)


def run(arguments: argparse.Namespace) -> int:
    """Run `mobee calibrate`: calibrate the robot, save and print the result, and return the exit code."""
    try:
        if arguments.live:
            require_none(arguments, "only valid without --live; with it robot and world are those of the running system")
            from mobee_cli.calibrate_live import calibrated_live

            found, drawn = calibrated_live(arguments.endpoint, arguments.marker, rig_of, arguments.postures, arguments.seed), None
        else:
            found, drawn = _offline(arguments)
        try:
            found.save(arguments.save)
        except OSError as error:
            raise UserError(f"{arguments.save}: cannot be written ({error.strerror})", BAD_INPUT) from None
    except MobeeError as error:
        raise UserError(str(error), BAD_INPUT) from None
    print(json.dumps(_as_json(found, drawn), indent=2) if arguments.json else "\n".join(_lines(found, drawn, arguments.save)))
    return 0


def rig_of(robot: Robot, marker: str, settings: CameraSettings) -> Rig:
    """Return the robot with its first two cameras and a visual tag fixed at `marker`, as calibration needs them.

    `marker`: name of a marker (named point of a link). `settings`: settings of the cameras; only their lens is used. Raises MobeeError if
    the robot has fewer than two cameras or no such marker.
    """
    cameras = cameras_of(robot)
    require_cameras(robot, cameras, STEREO)
    robot.marker(marker)
    return Rig(robot, dict(list(cameras.items())[:STEREO]), settings.lens, Tag(marker))


def _offline(arguments: argparse.Namespace) -> tuple[Calibration, Array]:
    """Return the calibration of a simulated robot, and the true values (P,) of its P parameters, in the order of its names."""
    settings, robot, seed = CameraSettings(), robot_given(arguments), arguments.seed
    if seed < 0:
        raise UserError(f"--seed {seed}: must be 0 or more", BAD_INPUT)
    rig, model = rig_of(robot, arguments.marker, settings), Model(robot, world_given(arguments))
    errors, part = camera_errors(settings, robot, list(rig.cameras), seed), part_of(robot, arguments.marker)
    with Progress() as progress:
        progress.show(0.0, "choosing postures")
        postures = choose_postures(rig, model, settings, part, arguments.postures, seed)
        watcher = Watcher(rig, model, settings, errors, seed)
        seen = watch_hand(watcher, postures, part, lambda share: progress.show(share, "watching the hand"))
    return calibrate(rig, seen, settings), rig.parameters(errors)


def _as_json(found: Calibration, drawn: Array | None) -> dict[str, Any]:
    parameters = {
        name: {"value": float(value), "deviation": float(deviation)} | ({} if drawn is None else {"true": float(drawn[k])})
        for k, (name, value, deviation) in enumerate(zip(found.names, found.x, found.deviations, strict=True))
    }
    quality = {name: {field: getattr(one, field) for field in one.__slots__} for name, one in _qualities(found).items()}
    hidden = [{"information": one.information, "weights": dict(one.weights)} for one in found.unobservable]
    return {
        "robot": found.robot,
        "pictures": found.pictures,
        "misfit": found.misfit,
        **quality,
        "parameters": parameters,
        "unobservable": hidden,
    }


def _qualities(found: Calibration) -> dict[str, Quality]:
    return {"uncalibrated": found.uncalibrated, "calibrated": found.calibrated}


def _lines(found: Calibration, drawn: Array | None, file: Path) -> list[str]:
    """Return the report on a calibration as lines of text: errors before and after it, and each parameter with its deviation.

    `drawn`: (P,), true values of the parameters; None if they are unknown.
    """
    lines = [
        f"{found.robot}, cameras {' and '.join(found.cameras)}, a tag on {found.tag.marker}: {found.pictures} moments seen",
        f"{'median / 95 %':<30}{'before':>18}{'after':>18}",
        _row("corner in the pictures, px", "pixels", 1.0, found),
        _row("tag in space, mm", "metres", 1e3, found),
        "",
        f"{'':<30}{'found':>12}{'+-':>10}{'' if drawn is None else '       drawn'}",
    ]
    for k, name in enumerate(found.names):
        factor, unit = _unit(name)
        true = "" if drawn is None else f"{factor * drawn[k]:>12.2f}"
        lines.append(f"{f'{name}, {unit}':<30}{factor * found.x[k]:>12.2f}{factor * found.deviations[k]:>10.2f}{true}")
    if found.unobservable:
        lines += ["", "Not observable, and not needed, since other parameters do the same:", *map(_direction, found.unobservable)]
    return [*lines, "", f"misfit {found.misfit:.2f} (1: as noisy as assumed); saved in {file}"]


def _row(text: str, field: str, factor: float, found: Calibration) -> str:
    names = f"{field}_median", f"{field}_95"
    cells = [" / ".join(f"{factor * getattr(one, name):.2f}" for name in names) for one in _qualities(found).values()]
    return f"{text:<30}{cells[0]:>18}{cells[1]:>18}"


def _unit(name: str) -> tuple[float, str]:
    if name == "latency":
        return 1e3, "ms"
    return (1e3, "mm") if name.rpartition(".")[2] in AXES[:3] else (float(np.rad2deg(1.0)), "deg")


def _direction(one: Unobservable) -> str:
    text = ", ".join(f"{weight:+.2f} {name}" for name, weight in one.weights.items())
    return textwrap.fill(text, 80, initial_indent="  ", subsequent_indent="    ")
