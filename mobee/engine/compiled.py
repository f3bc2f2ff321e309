"""How the engine is compiled: Numba, machine code kept on disk under a key that sees every source file of the engine.

Numba's own cache looks at the file of the function alone and misses edits of what it calls; here the whole engine has one
folder, named after the hash of its sources.  A function with signatures is compiled, or loaded, when its module is imported,
so that nothing compiles while a robot moves.
"""

from __future__ import annotations

import hashlib
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar, cast

import numba

F = TypeVar("F", bound=Callable[..., object])

# Not `nnan`/`ninf`: the engine tells NaN from numbers.
_FAST = {"contract", "reassoc", "nsz", "arcp"}
_SOURCES = Path(__file__).parent


def cache_folder() -> Path:
    """Where this version of the engine keeps its machine code: $MOBEE_CACHE, else $XDG_CACHE_HOME/mobee, else ~/.cache/mobee."""
    home = os.environ.get("MOBEE_CACHE") or os.path.join(os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache"), "mobee")
    digest = hashlib.sha256(f"{numba.__version__} {sys.version_info[:2]}".encode())
    for source in sorted(_SOURCES.rglob("*.py")):
        digest.update(source.relative_to(_SOURCES).as_posix().encode())
        digest.update(source.read_bytes())
    return Path(home) / f"engine-{digest.hexdigest()[:16]}"


_FOLDER = cache_folder()


def is_ready() -> bool:
    """Whether this version of the engine has been compiled on this machine."""
    return (_FOLDER / "ready").exists()


def mark_ready() -> None:
    """Remember that all of it is compiled."""
    _FOLDER.mkdir(parents=True, exist_ok=True)
    (_FOLDER / "ready").touch()


def entry(*signatures: str) -> Callable[[F], F]:
    """Compile a function that Python calls, for these signatures only, when its module is imported; it releases the GIL."""

    def compile_now(function: F) -> F:
        return cast(F, _njit(function, list(signatures)))

    return compile_now


def inner(function: F) -> F:
    """Compile a function that only compiled functions call, with the first that does."""
    return cast(F, _njit(function, None))


def _njit(function: Callable[..., object], signatures: list[str] | None) -> object:
    config: Any = numba.config  # made at run time from the environment
    before = config.CACHE_DIR
    config.CACHE_DIR = str(_FOLDER)
    try:
        return numba.njit(signatures, cache=True, nogil=True, error_model="numpy", fastmath=_FAST)(function)
    finally:
        config.CACHE_DIR = before
