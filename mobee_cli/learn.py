# SPDX-License-Identifier: Apache-2.0
"""`mobee learn`: lets agents learn offline on any robot, and writes their transitions to a file."""

from __future__ import annotations

import argparse
import json
import sys
from contextlib import nullcontext
from pathlib import Path

from experiments.kit.command_line import positive_whole
from experiments.kit.track import add_track, require_tracker, tracked
from mobee.errors import MobeeError, NotInstalled
from mobee_cli.errors import UserError
from mobee_cli.playing.files import Files, is_edited, robot_as_written, write_files
from mobee_cli.playing.offline import learn, opened
from mobee_cli.playing.setup import add_setup_options, setup_of
from mobee_cli.robot_options import DEFAULT, add_robot, add_world
from services.common.exit_codes import BAD_INPUT, ENVIRONMENT

_NOTES = """Parts, joints, limits, home, tested pairs and fields are derived from the
robot (docs/play.md). Every transition is on disk before the next action: the
same command continues the file, also after Ctrl-C. Beside FILE.sqlite are
written the robot, FILE.xml, and a scenario to continue live, FILE.toml, which
you may edit: it is not written again. With --track the curves of all agents
are written into the folder FILE-tensorboard."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `mobee learn` to the parser: robot, number of transitions, file and others."""
    parser.epilog = _NOTES
    add_robot(parser, f"default: {DEFAULT}")
    add_world(parser)
    parser.add_argument("--transitions", type=positive_whole, required=True, metavar="N", help="number of transitions in all, of all parts")
    parser.add_argument("--store", type=Path, required=True, metavar="FILE", help="file of the transitions, FILE.sqlite")
    add_setup_options(parser)
    add_track(parser)
    parser.add_argument("--json", action="store_true", help="print the result as JSON")


def run(arguments: argparse.Namespace) -> int:
    """Run `mobee learn`: make agents for the parts of the robot, let them learn, print the results, and return the exit code."""
    curves = arguments.store.with_name(f"{arguments.store.stem}-tensorboard")
    if arguments.store.suffix != ".sqlite":
        raise UserError(f"--store {arguments.store}: its name must end in .sqlite", BAD_INPUT)
    files = Files(arguments.store)
    lines: list[str] = []
    say = lines.append if arguments.json else print
    try:
        require_tracker(arguments.track)
        setup = setup_of(arguments, arguments.robot or DEFAULT)
        _require_own([files.scenario] if setup.shipped else [files.robot, files.scenario], files.store)
        for line in setup.lines:
            say(line)
        with tracked(curves) if arguments.track else nullcontext(), opened(setup, robot_as_written(setup), files.store) as learning:
            if is_edited(setup, files):
                print(f"{files.scenario} was edited, and is kept as it is.", file=sys.stderr)
            write_files(setup, files)  # not before the store is accepted: a refused command changes no file
            learn(learning, None, arguments.transitions, say)
            numbers, summary = learning.numbers(), learning.summary()
            say(learning.report())
    except NotInstalled as error:
        raise UserError(str(error), ENVIRONMENT) from None
    except MobeeError as error:
        raise UserError(str(error), BAD_INPUT) from None
    if arguments.json:
        print(json.dumps(numbers | {"store": str(files.store), "scenario": str(files.scenario)}, indent=2))
        return 0
    print(summary)
    print(f"Kept in {files.store}. Plan with it: mobee plan --run {files.store}; continue live: mobee launch {files.scenario}")
    if arguments.track:
        print(f"Curves: tensorboard --logdir {curves}")
    return 0


def _require_own(written: list[Path], store: Path) -> None:
    """Raise UserError if one of the paths to write is a file that `mobee learn` has not written: it would be beside its store."""
    for path in written:
        if path.exists() and not store.exists():
            raise UserError(f"{path} exists, although there is no {store}: give --store another name", BAD_INPUT)
