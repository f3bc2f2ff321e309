# SPDX-License-Identifier: Apache-2.0
"""`mobee completion`: prints a script with which a shell completes the verbs, options and files of this command."""

from __future__ import annotations

import argparse
import importlib
from typing import Any

SHELLS = ("bash", "zsh", "tcsh")
_NOTES = """bash: mobee completion bash > ~/.local/share/bash-completion/completions/mobee
zsh:  mobee completion zsh > DIR/_mobee, with a DIR that is in $fpath
A new shell then completes `mobee re<TAB>`."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the argument of `mobee completion` to the parser: the name of the shell."""
    parser.epilog = _NOTES
    parser.add_argument("shell", choices=SHELLS, help="the shell that reads the script")


def run(arguments: argparse.Namespace) -> int:
    """Run `mobee completion`: print the script for the shell, and return the exit code."""
    import shtab

    print(shtab.complete(whole_parser(), arguments.shell))
    return 0


def whole_parser() -> argparse.ArgumentParser:
    """Return one parser for the whole command `mobee` with all verbs and their options. The module of every verb is imported."""
    import shtab

    from mobee_cli.__main__ import VERBS
    from services.launcher.scenario import shipped

    parser = argparse.ArgumentParser(prog="mobee")
    parser.add_argument("--version", action="store_true", help="print the version")
    verbs = parser.add_subparsers(metavar="verb")
    for verb, text in VERBS.items():
        one = verbs.add_parser(verb, help=text, description=text)
        importlib.import_module(f"mobee_cli.{verb}").add_arguments(one)
        _complete_files(one, shtab.FILE, shtab.DIRECTORY)
    scenario = next(action for action in verbs.choices["launch"]._actions if action.dest == "scenario")
    scenario.choices = list(shipped())  # a file is a scenario too, but a list of choices has no files
    return parser


def _complete_files(parser: argparse.ArgumentParser, file: Any, folder: Any) -> None:
    """Let the shell complete names of files or folders for the arguments of a parser, and of its subparsers, that expect them.

    An argument expects these if its name says so, such as FILE or DIR. `file`, `folder`: the completions of shtab for the two kinds.
    """
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for one in action.choices.values():
                _complete_files(one, file, folder)
            continue
        name = str(action.metavar or action.dest).upper()
        if action.choices is None and any(word in name.split("|")[-1].split(".") for word in ("FILE", "MAP", "IN", "OUT")):
            action.complete = file  # type: ignore[attr-defined]  # an attribute that shtab reads
        elif action.choices is None and name in ("RUN", "DIR", "FOLDER"):
            action.complete = folder  # type: ignore[attr-defined]  # as above
