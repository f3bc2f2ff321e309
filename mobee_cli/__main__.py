"""The command `mobee`: finds the verb, and imports that verb alone."""

from __future__ import annotations

import argparse
import difflib
import importlib
import os
import sys
from collections.abc import Sequence
from importlib import metadata
from typing import NoReturn

from mobee_cli.errors import UserError
from services.common.exit_codes import BAD_INPUT, ENVIRONMENT, INTERRUPTED

VERBS = {
    "launch": "start a scenario and keep it running",
    "status": "how the running system is",
    "stop": "end the running system",
    "estop": "stop the robot at once; --reset releases it",
    "topic": "what is said on the bus: list, echo, hz",
    "router": "only the router, when each service runs by itself",
    "robots": "robots and worlds that come with mobee",
    "convert": "a robot from zero-position XML to URDF, or back",
    "plan": "a way to anywhere, by what an agent has learned",
    "reach": "put a hand on a place, on the robot that runs or offline",
    "roadmap": "maps of whole-body motions: build, show, query, play",
    "export": "the transitions of a run as one table",
    "experiment": "claims of the papers, measured: list, run, figure",
    "bench": "how fast mobee is on this machine, beside its peers",
    "check": "what is wrong with a robot or world of your own",
    "view": "a robot's file as a picture that moves",
}

EXTRAS = {"zenoh": "live", "msgspec": "live", "tyro": "live", "rerun": "viz", "pybullet": "sim", "icub_models": "sim"}
"""Packages that some verbs import, and the extra of this project that installs each."""

ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")  # matrices are small: threads only wait for each other


def main(argv: Sequence[str] | None = None) -> int:
    """Run the verb; returns the exit code: 0 ok, 1 failed, 2 bad input, 3 environment, 130 interrupted."""
    arguments = list(sys.argv[1:] if argv is None else argv)
    try:
        code = _main(arguments)
        sys.stdout.flush()
    except BrokenPipeError:  # the reader has seen enough, as `head` does
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    return code


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
    """Says in one line what is wrong."""

    def error(self, message: str) -> NoReturn:
        self.exit(BAD_INPUT, f"{self.prog}: {message}; `{self.prog} --help` tells more\n")


def parser_of(verb: str) -> argparse.ArgumentParser:
    """The parser of a verb's options; imports the verb's module."""
    parser = _Parser(prog=f"mobee {verb}", description=VERBS[verb], formatter_class=argparse.RawDescriptionHelpFormatter)
    importlib.import_module(f"mobee_cli.{verb}").add_arguments(parser)
    return parser


def _run(verb: str, arguments: list[str]) -> int:
    for name in ONE_THREAD:
        os.environ.setdefault(name, "1")
    try:
        parser = parser_of(verb)
        return int(importlib.import_module(f"mobee_cli.{verb}").run(parser.parse_args(arguments)))
    except UserError as error:
        print(f"mobee {verb}: {' '.join(str(error).split())}", file=sys.stderr)
        return error.code
    except ModuleNotFoundError as error:
        if error.name not in EXTRAS:
            raise
        print(f'mobee {verb}: needs {error.name}, which is not installed: pip install "mobee[{EXTRAS[error.name]}]"', file=sys.stderr)
        return ENVIRONMENT
    except Exception as error:
        if not _is_not_installed(error):
            raise
        print(f"mobee {verb}: {' '.join(str(error).split())}", file=sys.stderr)
        return ENVIRONMENT
    except KeyboardInterrupt:  # a verb that is meant to end so does not let it come here
        print(f"mobee {verb}: interrupted", file=sys.stderr)
        return INTERRUPTED


def _is_not_installed(error: Exception) -> bool:
    """Whether the library misses a package or its core; most verbs start without the library, and no other makes it load."""
    errors = sys.modules.get("mobee.errors")
    return errors is not None and isinstance(error, errors.NotInstalled)


def _usage() -> str:
    verbs = "\n".join(f"  {verb:<11}{text}" for verb, text in VERBS.items())
    notes = "`mobee <verb> --help` tells more.\nExit codes: 0 ok, 1 failed, 2 bad input, 3 environment, 130 interrupted."
    return f"usage: mobee <verb> [options]\n\n{verbs}\n\n{notes}"


if __name__ == "__main__":
    raise SystemExit(main())
