# SPDX-License-Identifier: Apache-2.0
"""`mobee replay`: shows a run again, or runs its controller or model again on the recorded input, or compares two runs."""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
from dataclasses import asdict
from importlib.util import find_spec
from pathlib import Path

from experiments.kit.command_line import positive_number, positive_whole
from experiments.kit.live.launch import free_endpoint, free_port
from mobee.errors import MobeeError
from mobee_cli.errors import UserError
from services.common.exit_codes import BAD_INPUT, ENVIRONMENT, FAILED, OK
from services.recorder.files import parts_of
from services.recorder.reader import Recording

_NO_PAGE = 'a page needs rerun-sdk: pip install "mobee[viz]"'
STORY = "story.jsonl"  # of a monitor, in the folder of a run

_NOTES = """RUN is the folder of a run of `mobee launch`, or one of its files
messages-*.mcap. Without options: the page shows what it showed during the run,
with a time line where the run had a monitor, else by playing the recorded
messages to a new one. --into: the service runs again in lockstep on the
recorded messages, and all that it says is compared. --diff: the runs are
compared tick by tick. Exit code of these two: 0 equal to the last bit,
1 different, 2 they cannot be compared."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `mobee replay` to the parser: the run, and what to do with it."""
    parser.epilog = _NOTES
    parser.add_argument("run", type=Path, metavar="RUN", help="folder of a run, or a recording")
    what = parser.add_mutually_exclusive_group()
    what.add_argument("--into", choices=("controller", "model"), help="play a run in lockstep into this service, and compare what it says")
    what.add_argument("--diff", type=Path, metavar="RUN", help="print the first difference of this run and another")
    what.add_argument("--messages", action="store_true", help="play the recorded messages, also where the run had a monitor")
    parser.add_argument("--ticks", type=positive_whole, default=sys.maxsize, metavar="N", help="--into: end after tick N")
    parser.add_argument("--speed", type=positive_number, default=1.0, metavar="X", help="of recorded messages (default: real time)")
    parser.add_argument("--port", type=_port, default=9091, help="port of the page, 0: a free one (default: %(default)s)")
    parser.add_argument("--json", action="store_true", help="print the result of a comparison as JSON")


def _port(text: str) -> int:
    if not text.isdecimal() or int(text) > 65535:
        raise argparse.ArgumentTypeError(f"{text!r} is no port: write a whole number from 0 (a free port) to 65535")
    return int(text)


def run(arguments: argparse.Namespace) -> int:
    """Run `mobee replay`: by the options, show the run, play it into a service, or compare it with another run.

    Returns the exit code.
    """
    place: Path = arguments.run
    if not place.exists():
        raise UserError(f"{place}: there is no such folder or recording; runs of `mobee launch` are in runs/", BAD_INPUT)
    try:
        if arguments.diff is not None:
            return _diff(arguments)
        if arguments.into is not None:
            return _into(arguments)
        return _show(arguments)
    except ModuleNotFoundError as error:
        if (error.name or "").partition(".")[0] != "rerun":
            raise
        raise UserError(_NO_PAGE, ENVIRONMENT) from None
    except MobeeError as error:
        raise UserError(str(error), BAD_INPUT) from None


def _diff(arguments: argparse.Namespace) -> int:
    from mobee_cli.replaying.differences import compare_runs

    result = compare_runs(Recording(arguments.run), Recording(arguments.diff))
    if arguments.json:
        print(json.dumps(asdict(result), indent=2))
    elif result.difference is None:
        ends = f"; the {result.ends} run ends there" if result.ends else ""
        print(f"equal to the last bit in {result.ticks} ticks, {result.messages} messages{ends}")
    else:
        print(f"equal in {result.ticks} ticks, then they part:\n{result.difference}")
    return OK if result.difference is None else FAILED


def _into(arguments: argparse.Namespace) -> int:
    from mobee_cli.replaying.into import replay_into
    from mobee_cli.replaying.stage import Stage
    from mobee_cli.replaying.ticks import ticks

    recording = Recording(arguments.run)
    name = f"{arguments.into}.toml"
    settings = recording.settings().get(name)
    if settings is None:
        raise MobeeError(
            f"{arguments.run}: the recording holds no {name}, the settings of the {arguments.into}: was it made by `mobee launch`?"
        )
    with tempfile.TemporaryDirectory(prefix="mobee-replay-") as folder:
        with Stage(arguments.into, settings, Path(folder)).open(free_endpoint()) as stage:
            result = replay_into(stage, ticks(recording), arguments.ticks)
    if arguments.json:
        print(json.dumps(asdict(result), indent=2))
    else:
        said = ", ".join(f"{count} {kind}" for kind, count in result.says.items())
        print(f"{result.who}: {result.ticks} ticks and {result.calls} calls in {result.seconds:.1f} s; it said {said or 'nothing'}")
        print("equal to the last bit" if result.difference is None else f"recorded and replayed differ:\n{result.difference}")
    return OK if result.difference is None else FAILED


def _show(arguments: argparse.Namespace) -> int:
    """Show a run on its page until Ctrl-C: what its monitor recorded, with a time line, or else the recorded messages."""
    place: Path = arguments.run
    try:
        if place.is_dir() and not arguments.messages and ((place / STORY).exists() or not parts_of(place)):
            from services.monitor.replay import replay

            replay(place, arguments.port, lambda address: _say(place, address))
        else:
            _play(arguments)
    except KeyboardInterrupt:
        pass
    return OK


def _play(arguments: argparse.Namespace) -> None:
    from mobee_cli.replaying.page import Player

    if find_spec("rerun") is None:
        raise UserError(_NO_PAGE, ENVIRONMENT)
    with tempfile.TemporaryDirectory(prefix="mobee-replay-") as folder:
        port = arguments.port or free_port()
        player = Player(Recording(arguments.run), port, Path(folder))
        with player.stage.open(free_endpoint()) as stage:
            stage.start()
            _say(arguments.run, f"http://127.0.0.1:{port}/")
            player.play(arguments.speed)
            print("That was the last message; the page stays.", flush=True)
            while True:
                time.sleep(1.0)
                stage.check()


def _say(place: Path, address: str) -> None:
    print(f"{place.name} at {address}\nCtrl-C ends it.", flush=True)
