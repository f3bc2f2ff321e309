"""How the engine is compiled: by Numba, with machine code kept on disk.

A function with signatures is compiled, or loaded, when its module is imported, so that nothing compiles while a robot moves.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba

from mobee.engine.cache import cache_folder
from mobee.engine.shelf import Shelf

F = TypeVar("F", bound=Callable[..., object])

FOLDER = cache_folder()

# Not `nnan`/`ninf`: the engine tells NaN from numbers.
_FAST = {"contract", "reassoc", "nsz", "arcp"}
_AS_WRITTEN = {"contract"}
_EXACT: set[str] = set()  # also no multiplication joined to an addition, which depends on what the compiler sees around it


def entry(*signatures: str) -> Callable[[F], F]:
    """Compile a function that Python calls, for these signatures only, when its module is imported; it releases the GIL."""

    def compile_now(function: F) -> F:
        return _njit(function, signatures, _FAST, counting=True)

    return compile_now


def inner(function: F) -> F:
    """Compile a function that only compiled functions call, with the first that does; it makes no arrays.

    It does not count references either: every call would count those of its arrays, which costs more than a pair of volumes.
    """
    return _njit(function, (), _FAST, counting=False)


def inlined(function: F) -> F:
    """Like `inner`, but made part of whatever calls it."""
    compiled: Any = inner(function)
    if compiled is not function:  # NUMBA_DISABLE_JIT leaves it as it is
        compiled.targetoptions["forceinline"] = True
    return cast(F, compiled)


def inner_with_memory(function: F) -> F:
    """Like `inner`, for a function that makes arrays."""
    return _njit(function, (), _FAST, counting=True)


def inner_as_written(function: F) -> F:
    """Like `inner`, for sums whose rounding depends on their order: no term is moved."""
    return _njit(function, (), _AS_WRITTEN, counting=False)


def entry_exact(*signatures: str) -> Callable[[F], F]:
    """Like `entry`, rounded as Python would: the result is the same to the last bit wherever the function is made part of another."""

    def compile_now(function: F) -> F:
        return _njit(function, signatures, _EXACT, counting=True)

    return compile_now


def inner_exact(function: F) -> F:
    """Like `inner`, rounded as Python would, see `entry_exact`."""
    return _njit(function, (), _EXACT, counting=False)


def _njit(function: F, signatures: tuple[str, ...], fast: set[str], counting: bool) -> F:
    compiled: Any = numba.njit(nogil=True, error_model="numpy", fastmath=fast)(function)
    if compiled is not function:  # NUMBA_DISABLE_JIT, for debugging, leaves it as it is
        compiled.targetoptions["_nrt"] = counting
        compiled._cache = Shelf(function, FOLDER)
        for signature in signatures:
            compiled.compile(signature)
        if signatures:
            compiled.disable_compile()
    return cast(F, compiled)
