# SPDX-License-Identifier: Apache-2.0
"""`mobee play`: makes any robot curious. It derives agents from the robot, lets them learn offline for some seconds, and continues live."""

from __future__ import annotations

import argparse
import json
import sys
import time
from pathlib import Path
from typing import Any

from experiments.kit.command_line import positive_number, positive_whole
from mobee.errors import MobeeError
from mobee.robot.load import load_robot
from mobee_cli.errors import UserError
from mobee_cli.launch import add_settings
from mobee_cli.playing.files import Files, free_folder, remove_files, write_files, write_readme
from mobee_cli.playing.offline import learn, opened
from mobee_cli.playing.setup import ICUB, Setup, add_setup_options, setup_of
from mobee_cli.robot_options import add_cameras, add_urdf_options, add_world, given_options
from services.common.exit_codes import BAD_INPUT, INTERRUPTED
from services.launcher.run import Options, launch, refused_now

SECONDS = 5.0  # s of real time in which it learns offline
_NOTES = """ROBOT: a shipped robot, a URDF, MJCF or zero-position XML file, or with the
package mujoco-menagerie a robot of MuJoCo Menagerie; without it, the iCub at
its table. --learned continues a file of `mobee learn` live. The address of
the page is in the table of services; Ctrl-C ends everything. docs/play.md."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `mobee play`, the robot and the options, to the parser."""
    parser.epilog = _NOTES
    parser.add_argument("robot", nargs="?", metavar="ROBOT", help="name or file of a robot (default: the iCub at its table)")
    add_urdf_options(parser)
    add_world(parser)
    add_cameras(parser)
    add_setup_options(parser)
    parser.add_argument("--seconds", type=positive_number, metavar="S", help=f"learn offline for S seconds (default: {SECONDS:g})")
    parser.add_argument("--transitions", type=positive_whole, metavar="N", help="learn offline until there are N transitions")
    parser.add_argument("--save", type=Path, metavar="DIR", help="write the robot, the scenario and a README to edit into DIR")
    parser.add_argument("--learned", type=Path, metavar="FILE.sqlite", help="go live with what `mobee learn` has learned")
    parser.add_argument("--offline-only", action="store_true", help="end after learning offline")
    add_settings(parser)
    parser.add_argument("--headless", action="store_true", help="without the live page")
    parser.add_argument("--duration", type=positive_number, metavar="S", help="end S seconds after all services are ready")
    parser.add_argument("--endpoint", metavar="ADDRESS", help="address of the router (default: tcp/127.0.0.1:7447)")
    parser.add_argument("--runs", type=Path, default=Path("runs"), metavar="DIR", help="parent of the folders of runs (default: runs)")
    parser.add_argument("--json", action="store_true", help="print JSON: what was learned offline, or the summary of the live run")


def run(arguments: argparse.Namespace) -> int:
    """Run `mobee play`: derive agents from the robot, let them learn offline, then live.

    Returns the exit code, which is that of the live system if one is started.
    """
    if arguments.learned is not None:
        _require_no_setup(arguments)
        files = Files(arguments.learned)
        if not files.store.is_file() or not files.scenario.is_file():
            raise UserError(f"{files.scenario}: no such scenario beside {files.store}: make both with `mobee learn`", BAD_INPUT)
        return _live(arguments, files)
    say = _to_stderr if arguments.json else _to_stdout
    try:
        setup = setup_of(arguments, arguments.robot or ICUB)
        files = _files(arguments, setup)
        for line in setup.lines:
            say(line)
        write_files(setup, files)
        write_readme(setup, files)
        if not arguments.offline_only and (code := refused_now(_options(arguments, files))):  # before it learns for seconds
            remove_files(files)
            return code
        try:
            numbers = _offline(arguments, setup, files, say)
        except MobeeError:
            if not files.store.exists():  # it has learned nothing
                remove_files(files)
            raise
    except MobeeError as error:
        raise UserError(str(error), BAD_INPUT) from None
    if arguments.offline_only:
        if arguments.json:
            print(json.dumps(numbers | {"store": str(files.store), "scenario": str(files.scenario)}, indent=2))
        say(f"mobee launch {files.scenario} continues live.")
        return 0
    say(f"Continues live: mobee launch {files.scenario}")
    return _live(arguments, files)


def _require_no_setup(arguments: argparse.Namespace) -> None:
    """Raise UserError if the user has given --learned, and with it an option or a robot that only a new setup can use."""
    given = given_options(arguments, ("world", "explorer", "seed", "seconds", "transitions", "save"))
    given += [arguments.robot] * (arguments.robot is not None) + ["--part"] * bool(arguments.parts)
    given += ["--offline-only"] * arguments.offline_only
    if given:
        raise UserError(f"{given[0]}: not valid with --learned, which continues what `mobee learn` has set up: leave it out", BAD_INPUT)


def _files(arguments: argparse.Namespace, setup: Setup) -> Files:
    """Return the paths of the files of this run, in the folder of --save, or in a new folder without --save.

    Raises UserError if one of the files exists already.
    """
    if arguments.save is None:
        name = f"{time.strftime('%Y%m%d-%H%M%S')}-play-{setup.name}"
        return Files(free_folder(arguments.runs, name) / f"{setup.name}.sqlite")
    files = Files(arguments.save / f"{setup.name}.sqlite")
    if files.scenario.exists():
        raise UserError(f"{files.scenario} exists: run it with `mobee launch {files.scenario}`, or save into another folder", BAD_INPUT)
    files.require_absent()
    return files


def _offline(arguments: argparse.Namespace, setup: Setup, files: Files, say: Any) -> dict[str, Any]:
    """Learn offline; returns the numbers of the run, see `Learning.numbers`."""
    seconds = arguments.seconds or (None if arguments.transitions else SECONDS)
    with opened(setup, load_robot(setup.shipped or files.robot), files.store) as learning:
        try:
            learn(learning, seconds, arguments.transitions, say)
        except KeyboardInterrupt:
            kept = learning.kept
            text = f"interrupted; {kept} transitions are kept, and `mobee launch {files.scenario}` continues live with them"
            raise UserError(text if kept else "interrupted", INTERRUPTED) from None
        say(learning.report())
        say(learning.summary())
        return learning.numbers()


def _live(arguments: argparse.Namespace, files: Files) -> int:
    return launch(_options(arguments, files))


def _options(arguments: argparse.Namespace, files: Files) -> Options:
    return Options(
        scenario=str(files.scenario),
        settings=tuple(arguments.settings),
        headless=arguments.headless,
        cameras=tuple(arguments.cameras) if arguments.learned else (),  # else the scenario has them
        duration=arguments.duration,
        json=arguments.json,
        endpoint=arguments.endpoint,
        runs=arguments.runs,
    )


def _to_stdout(line: str) -> None:
    print(line, flush=True)


def _to_stderr(line: str) -> None:
    print(line, file=sys.stderr, flush=True)
