"""Routines that are always made part of what calls them."""

from __future__ import annotations

from typing import Any, cast

from mobee.engine.compiled import F, inner


def inlined(function: F) -> F:
    """Like `inner`, and never called: a call keeps the arrays' reference counts, and counting costs more than the arithmetic."""
    compiled: Any = inner(function)
    if compiled is not function:  # NUMBA_DISABLE_JIT leaves it as it is
        compiled.targetoptions["forceinline"] = True
    return cast(F, compiled)
