"""Loads the task of a roadmap: a shipped one, or a Python file."""

from __future__ import annotations

import difflib
import importlib.util
import inspect
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
from services.common.exit_codes import BAD_INPUT

MAKER = "example"  # the function of a task file that returns what is built


def task_named(name: str, options: Sequence[str], model: Callable[[], Model]) -> Example:
    """The task of that name, or of that file.

    Args:
        name: of a task that comes with mobee, or the path of a .py file.
        options: of robot and world that were given on the command line.
        model: makes the model that they stand for.

    Raises:
        UserError: with what is valid.
        MobeeError: the robot or the world cannot be read, or the task does not fit it.
    """
    if name in EXAMPLES:
        if options:
            raise UserError(
                f"{options[0]}: the task {name!r} is made of the markers and motors of the icub, and has a world of its own: for another "
                "robot or world write a task file, see docs/roadmaps.md",
                BAD_INPUT,
            )
        return EXAMPLES[name]()
    path = Path(name)
    if path.suffix != ".py":
        near = difflib.get_close_matches(name, EXAMPLES, n=1)
        hint = f" Did you mean {near[0]!r}?" if near else ""
        raise UserError(f"unknown task {name!r}.{hint} Valid: {', '.join(EXAMPLES)}, or the path of a .py file of your own.", BAD_INPUT)
    if not path.is_file():
        raise UserError(f"{path}: there is no such file", BAD_INPUT)
    found = _made(path, options, model)
    if not isinstance(found, Example):
        raise UserError(f"{path}: {MAKER}() returned {type(found).__name__}; it must be an experiments.kit.roadmap_task.Example", BAD_INPUT)
    return found


def _made(path: Path, options: Sequence[str], model: Callable[[], Model]) -> object:
    """What the function of a task file returns: without parameters it makes its own model, with one it is given that of the options."""
    maker = getattr(_loaded(path), MAKER, None)
    if not callable(maker):
        raise UserError(
            f"{path}: it has no function {MAKER}() that returns an experiments.kit.roadmap_task.Example: see docs/roadmaps.md", BAD_INPUT
        )
    parameters = len(inspect.signature(maker).parameters)
    if parameters > 1:
        raise UserError(f"{path}: {MAKER} has {parameters} parameters; it must have none, or one, the model", BAD_INPUT)
    if options and not parameters:
        raise UserError(f"{options[0]}: {path} makes its model itself; write `def {MAKER}(model)` and use that model", BAD_INPUT)
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
    """Raise UserError with the line of a user's file for whatever is raised in it."""
    try:
        yield
    except Exception as error:
        line = next((frame.lineno for frame in reversed(traceback.extract_tb(error.__traceback__)) if frame.filename == str(path)), None)
        at = getattr(error, "lineno", None) if isinstance(error, SyntaxError) else line
        where = f"{path}:{at}" if at is not None else str(path)
        text = str(error) if isinstance(error, MobeeError) else f"{type(error).__name__}: {error}"
        raise UserError(f"{where}: {text}", BAD_INPUT) from None
