# SPDX-License-Identifier: Apache-2.0
"""`mobee roadmap tasks`: lists the shipped tasks of roadmaps.

A task consists of the model, the costs and the task space from which a roadmap (graph of poses) is built. This module also loads a task,
shipped or from a Python file.
"""

from __future__ import annotations

import argparse
import difflib
import importlib.util
import inspect
import json
import traceback
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType

from experiments.claims.ch3_roadmaps.trm_tasks import EXAMPLES
from experiments.kit.roadmap_task import Example
from mobee import Model
from mobee.errors import MobeeError
from mobee_cli.errors import UserError
from mobee_cli.roadmap.map_file import wrapped
from services.common.exit_codes import BAD_INPUT

DESCRIPTION = "List the shipped tasks of roadmaps."
NOTES = "`mobee roadmap build TASK` builds the roadmap of a task. All need the icub."


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add no options: `mobee roadmap tasks` has none of its own."""


def run(arguments: argparse.Namespace) -> int:
    """Run `mobee roadmap tasks`: list the shipped tasks, and return the exit code."""
    found = [(name, make()) for name, make in EXAMPLES.items()]
    if arguments.json:
        rows = [
            {
                "task": name,
                "robot": one.model.robot.name,
                "figure": one.figure,
                "title": one.title,
                "coordinates": list(one.task.names),
            }
            for name, one in found
        ]
        print(json.dumps(rows, indent=2))
        return 0
    for name, one in found:
        print(f"{name:<17} {one.figure:<16} {one.title:<16} {_short(one.task.names, 28)}")
    robots = ", ".join(sorted({one.model.robot.name for _, one in found}))
    text = f"All of them need the robot {robots}. `mobee roadmap build FILE.py --robot ROBOT` builds your own task: docs/roadmaps.md."
    print("\n".join(["", *wrapped(text)]))
    return 0


def _short(names: tuple[str, ...], room: int) -> str:
    """Return the names as a text of at most `room` characters. If not all fit, "..." replaces the last ones."""
    whole, kept = ", ".join(names), list(names)
    while len(whole) > room and len(kept) > 1:
        kept.pop()
        whole = f"{', '.join(kept)}, ..."
    return whole[:room]


MAKER = "example"  # name of the function that a task file defines


def task_named(name: str, options: Sequence[str], model: Callable[[], Model]) -> Example:
    """Return a shipped task, or the task that a Python file defines.

    Args:
        name: name of a shipped task, or path of a .py file.
        options: options for robot and world as given on the command line; a shipped task allows none.
        model: function that returns the model of the robot and the world in the options. It is called only if the function `example` of a
            task file has a parameter.

    Raises:
        UserError: the name or the file is not valid.
        MobeeError: the robot or the world cannot be read, or the task does not fit it.
    """
    if name in EXAMPLES:
        if options:
            raise UserError(
                f"{options[0]}: the task {name!r} uses the markers and motors of the icub, and a world of its own: for another robot "
                "or world write a task file, see docs/roadmaps.md",
                BAD_INPUT,
            )
        return EXAMPLES[name]()
    path = Path(name)
    if path.suffix != ".py":
        near = difflib.get_close_matches(name, EXAMPLES, n=1)
        hint = f" Did you mean {near[0]!r}?" if near else ""
        raise UserError(f"unknown task {name!r}.{hint} Valid: {', '.join(EXAMPLES)}, or the path of your own .py file.", BAD_INPUT)
    if not path.is_file():
        raise UserError(f"{path}: there is no such file", BAD_INPUT)
    found = _made(path, options, model)
    if not isinstance(found, Example):
        raise UserError(f"{path}: {MAKER}() returned {type(found).__name__}; it must be an experiments.kit.roadmap_task.Example", BAD_INPUT)
    return found


def _made(path: Path, options: Sequence[str], model: Callable[[], Model]) -> object:
    """Call the function of a task file, with the model of the options if it has a parameter; return its result."""
    maker = getattr(_loaded(path), MAKER, None)
    if not callable(maker):
        raise UserError(
            f"{path}: it has no function {MAKER}() that returns an experiments.kit.roadmap_task.Example: see docs/roadmaps.md", BAD_INPUT
        )
    parameters = len(inspect.signature(maker).parameters)
    if parameters > 1:
        raise UserError(f"{path}: {MAKER} has {parameters} parameters; valid is none, or one: the model", BAD_INPUT)
    if options and not parameters:
        raise UserError(f"{options[0]}: {path} makes its own model; to use the option, write `def {MAKER}(model)`", BAD_INPUT)
    given = [model()] if parameters else []
    with _explained(path):
        return maker(*given)


def _loaded(path: Path) -> ModuleType:
    spec = importlib.util.spec_from_file_location(path.stem, path)
    if spec is None or spec.loader is None:
        raise UserError(f"{path}: it cannot be read as Python", BAD_INPUT)
    module = importlib.util.module_from_spec(spec)
    with _explained(path):
        spec.loader.exec_module(module)
    return module


@contextmanager
def _explained(path: Path) -> Iterator[None]:
    """Turn any exception in a user's file into a UserError with the line."""
    try:
        yield
    except Exception as error:  # code of the user, which may raise anything
        line = next((frame.lineno for frame in reversed(traceback.extract_tb(error.__traceback__)) if frame.filename == str(path)), None)
        at = getattr(error, "lineno", None) if isinstance(error, SyntaxError) else line
        where = f"{path}:{at}" if at is not None else str(path)
        text = str(error) if isinstance(error, MobeeError) else f"{type(error).__name__}: {error}"
        raise UserError(f"{where}: {text}", BAD_INPUT) from None
