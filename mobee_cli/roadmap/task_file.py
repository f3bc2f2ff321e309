"""The task that a map is built for: one that comes with mobee, or a Python file of one's own."""

from __future__ import annotations

import difflib
import importlib.util
import traceback
from pathlib import Path
from types import ModuleType

from experiments.trm.example import Example
from experiments.trm.examples import EXAMPLES
from mobee_cli.errors import BAD_INPUT, UserError

MAKER = "example"  # the function of a task file that returns what is built


def task_named(name: str) -> Example:
    """The task of that name, or of that file; raises UserError with what is valid."""
    if name in EXAMPLES:
        return EXAMPLES[name]()
    path = Path(name)
    if path.suffix != ".py":
        near = difflib.get_close_matches(name, EXAMPLES, n=1)
        hint = f" Did you mean {near[0]!r}?" if near else ""
        raise UserError(f"unknown task {name!r}.{hint} Valid: {', '.join(EXAMPLES)}, or the path of a .py file of your own.", BAD_INPUT)
    if not path.is_file():
        raise UserError(f"{path}: there is no such file", BAD_INPUT)
    maker = getattr(_loaded(path), MAKER, None)
    if not callable(maker):
        raise UserError(
            f"{path}: it has no function {MAKER}() that returns an experiments.trm.example.Example: see docs/roadmaps.md", BAD_INPUT
        )
    found = maker()
    if not isinstance(found, Example):
        raise UserError(f"{path}: {MAKER}() returned {type(found).__name__}; it must be an experiments.trm.example.Example", BAD_INPUT)
    return found


def _loaded(path: Path) -> ModuleType:
    spec = importlib.util.spec_from_file_location(path.stem, path)
    if spec is None or spec.loader is None:
        raise UserError(f"{path}: it cannot be read as Python", BAD_INPUT)
    module = importlib.util.module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except Exception as error:  # whatever a user's file raises
        line = next((frame.lineno for frame in reversed(traceback.extract_tb(error.__traceback__)) if frame.filename == str(path)), None)
        at = getattr(error, "lineno", None) if isinstance(error, SyntaxError) else line
        where = f"{path}:{at}" if at is not None else str(path)
        raise UserError(f"{where}: {type(error).__name__}: {error}", BAD_INPUT) from None
    return module
