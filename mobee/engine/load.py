"""Loads machine code; where it has to be compiled first, says so and lets one process compile all of it for all."""

from __future__ import annotations

import contextlib
import importlib
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

from mobee.engine.cache import cache_folder, is_ready, mark_ready, mark_used

MODULES = (
    "mobee.engine.scene",
    "mobee.engine.neighbours",
    "mobee.engine.descent",
    "mobee.engine.evaluate",
)
ENGINE = ("mobee.engine.scene", "mobee.engine.neighbours", "mobee.engine.evaluate")  # what a model needs
PATIENCE = 300.0  # s that a process waits for another that compiles


def load() -> None:
    """Import the model's engine; after an install or an edit all is compiled first: a minute, with progress on standard error."""
    if ENGINE[-1] in sys.modules:
        return
    from mobee.engine.compiled import FOLDER

    if is_ready(FOLDER):
        _import(FOLDER, ENGINE)
        mark_used(FOLDER)
        return
    with _turn(FOLDER) as writable:
        if is_ready(FOLDER):
            _import(FOLDER, ENGINE)
        else:
            _compile(FOLDER, writable)


def load_only(module: str) -> ModuleType:
    """Import one compiled module and what it needs, which takes less time and memory; whoever finds it not compiled compiles all."""
    if module not in sys.modules:
        from mobee.engine.compiled import FOLDER

        if is_ready(FOLDER):
            mark_used(FOLDER)
        else:
            load()
    return importlib.import_module(module)


def _import(folder: Path, modules: tuple[str, ...]) -> None:
    from mobee.engine.progress import Progress

    with Progress(folder):
        for module in modules:
            importlib.import_module(module)


def _compile(folder: Path, writable: bool) -> None:
    from mobee.engine.progress import say
    from mobee.engine.shelf import Shelf

    _import(folder, MODULES)
    if writable and Shelf.unwritten is not None:
        say(f"could not keep the engine's machine code: {Shelf.unwritten}. The next start compiles again.")
    elif writable and cache_folder() == folder:  # else a source was edited meanwhile, and nobody knows which version was read
        mark_ready(folder)


@contextlib.contextmanager
def _turn(folder: Path) -> Iterator[bool]:
    """Wait until no other process compiles into a folder; gives whether it can be written."""
    from mobee.engine.progress import say

    try:
        folder.mkdir(parents=True, exist_ok=True)
        lock = (folder / "lock").open("ab")
    except OSError as error:
        say(
            f"cannot write {folder}: {error.strerror}. The engine is compiled in memory, which every start has to wait for; "
            "let the environment variable MOBEE_CACHE name a folder that can be written."
        )
        yield False
        return
    with lock:
        _wait(lock.fileno())
        yield True


def _wait(lock: int) -> None:
    try:
        import fcntl
    except ImportError:  # not on Windows: each process compiles, and the files are whole all the same
        return
    from mobee.engine.progress import say

    end = time.monotonic() + PATIENCE
    told = False
    while time.monotonic() < end:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)  # let go when the file is closed, at the latest when the process ends
            return
        except BlockingIOError:
            if not told:
                say("another process compiles the engine; waiting for it ...")
                told = True
            time.sleep(0.1)
