# SPDX-License-Identifier: Apache-2.0
"""The command `mobee`: finds the verb (first argument), and imports only the module of that verb."""

from __future__ import annotations

import argparse
import difflib
import importlib
import os
import signal
import sys
from collections.abc import Sequence
from importlib import metadata
from typing import NoReturn

from mobee_cli.errors import UserError
from services.common.exit_codes import BAD_INPUT, ENVIRONMENT, INTERRUPTED

VERBS = {
    "play": "make any robot curious: derive its parts, learn offline, continue live",
    "launch": "start a scenario and supervise it",
    "keys": "make the keys of a secured system: new, add, list",
    "status": "print the state of the running system",
    "stop": "end the running system",
    "estop": "stop the robot at once; --reset releases it",
    "topic": "show what is published on the bus: list, echo, hz, schema",
    "router": "run only the router, for services that are started one by one",
    "robots": "list the robots and worlds that come with mobee",
    "convert": "convert a robot from zero-position XML to URDF, or back",
    "learn": "learn offline on any robot, with the transitions in a file",
    "plan": "plan a path by what an agent has learned",
    "reach": "move a hand to a place, on the running robot or offline",
    "calibrate": "find where cameras are, by looking at the robot's own hand",
    "detector": "train a detector of known things on rendered pictures",
    "roadmap": "build, show, query and play roadmaps of whole-body motions",
    "export": "write the transitions of a run as one table",
    "experiment": "measure the claims of the papers: list, run, figure",
    "bench": "measure the speed of mobee on this machine, beside other programs",
    "check": "report what is wrong with a robot or world file",
    "view": "show a robot file in motion",
    "doctor": "check this machine and installation, and name what mends them",
    "completion": "print the script with which a shell completes this command",
    "conform": "test a robot_sim of your own against the contract of the bus",
    "record": "record every message of a running system",
    "replay": "play a run again: on its page, or into a controller or model",
    "film": "make a film of a run: the robot and its story",
}

EXTRAS = {
    "zenoh": "live",
    "cryptography": "live",
    "mcap": "live",
    "msgspec": "live",
    "tyro": "live",
    "shtab": "live",
    "rerun": "viz",
    "pybullet": "sim",
    "mujoco": "sim",
    "icub_models": "sim",
}
"""Python packages that some verbs import, each with the extra of this project that installs it: `pip install "mobee[EXTRA]"`."""

ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")  # matrices are small: more threads would only wait


def main(argv: Sequence[str] | None = None) -> int:
    """Run the verb (subcommand) that the arguments name (default: sys.argv), and return its exit code.

    0: ok; 1: the task failed; 2: bad input; 3: a fault of the environment; 130: interrupted.
    """
    arguments = list(sys.argv[1:] if argv is None else argv)
    try:
        code = _main(arguments)
        sys.stdout.flush()
    except BrokenPipeError:  # the reader has closed the pipe, as `head` does
        _discard_output()
        return 0
    except OSError as error:
        what = error.filename or "a file or the output"
        print(f"{' '.join(['mobee', *arguments[:1]])}: {what} cannot be read or written ({error.strerror or error})", file=sys.stderr)
        try:
            sys.stdout.flush()
        except OSError:  # it is the output, which Python would try to write once more
            _discard_output()
        return ENVIRONMENT
    return code


def _discard_output() -> None:
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _main(arguments: list[str]) -> int:
    if not arguments or arguments[0] in ("-h", "--help"):
        print(_usage())
        return 0
    verb, *rest = arguments
    if verb == "--version":
        print(f"mobee {metadata.version('mobee')}")
        return 0
    if verb not in VERBS:
        near = difflib.get_close_matches(verb, VERBS, n=1)
        hint = f" Did you mean {near[0]!r}?" if near else ""
        print(f"mobee: unknown verb {verb!r}.{hint} Valid: {', '.join(VERBS)}.", file=sys.stderr)
        return BAD_INPUT
    return _run(verb, rest)


class _Parser(argparse.ArgumentParser):
    """An argument parser that prints an error in one line."""

    def error(self, message: str) -> NoReturn:
        self.exit(BAD_INPUT, f"{self.prog}: {message}; see `{self.prog} --help`\n")


def parser_of(verb: str) -> argparse.ArgumentParser:
    """Return the parser for the options of a verb (subcommand of `mobee`). The verb's module is imported."""
    parser = _Parser(prog=f"mobee {verb}", description=VERBS[verb], formatter_class=argparse.RawDescriptionHelpFormatter)
    importlib.import_module(f"mobee_cli.{verb}").add_arguments(parser)
    return parser


def _run(verb: str, arguments: list[str]) -> int:
    for name in ONE_THREAD:
        os.environ.setdefault(name, "1")
    try:
        given = parser_of(verb).parse_args(arguments)
        if folder := getattr(given, "operator_keys", None):
            os.environ["MOBEE_KEYS"] = folder  # as services.common.identity, which is not imported here, names it
        return int(importlib.import_module(f"mobee_cli.{verb}").run(given))
    except UserError as error:
        print(f"mobee {verb}: {' '.join(str(error).split())}", file=sys.stderr)
        return error.code
    except ModuleNotFoundError as error:
        if error.name not in EXTRAS:
            raise
        print(f'mobee {verb}: needs {error.name}, which is not installed: pip install "mobee[{EXTRAS[error.name]}]"', file=sys.stderr)
        return ENVIRONMENT
    except Exception as error:  # NotInstalled is checked by name: importing mobee.errors here would slow down every verb
        if not _is_not_installed(error):
            raise
        print(f"mobee {verb}: {' '.join(str(error).split())}", file=sys.stderr)
        return ENVIRONMENT
    except KeyboardInterrupt:  # a verb that runs until Ctrl-C handles it by itself
        print(f"mobee {verb}: interrupted", file=sys.stderr)
        return INTERRUPTED


def _is_not_installed(error: Exception) -> bool:
    """Return whether the library lacks a package or its core; does not import the library, which some verbs do not need."""
    errors = sys.modules.get("mobee.errors")
    return errors is not None and isinstance(error, errors.NotInstalled)


def _usage() -> str:
    verbs = "\n".join(f"  {verb:<11}{text}" for verb, text in VERBS.items())
    notes = "`mobee <verb> --help` lists the options of a verb.\nExit codes: 0 ok, 1 failed, 2 bad input, 3 environment, 130 interrupted."
    return f"usage: mobee <verb> [options]\n\n{verbs}\n\n{notes}"


if __name__ == "__main__":
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # as at Ctrl-C, what a verb has started ends with it
    raise SystemExit(main())
