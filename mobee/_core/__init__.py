"""The native core: a shared library, built from the sources in core/, called through ctypes.

Each module here declares the functions of the source file with its name.  Whoever calls them has checked the arrays: the core
itself is given addresses.
"""

from __future__ import annotations

import ctypes
import os
import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

INTEGER, REAL, ADDRESS = ctypes.c_int64, ctypes.c_double, ctypes.c_void_p
BYTES = ctypes.c_char_p
"""An array that is only read, as its `tobytes()`: for a few numbers this costs less than an address."""

LEVELS = ("x86-64-v4", "x86-64-v3", "x86-64-v2")
FORCED = "MOBEE_CORE"
"""The environment variable that names the level to use."""


@cache
def library() -> ctypes.CDLL:
    """The shared library for this processor, loaded when it is first asked for."""
    folder = Path(__file__).parent
    level = os.environ.get(FORCED) or "x86-64-v3"
    return ctypes.CDLL(str(folder / f"core-{level}.so"))


def function(name: str, *arguments: Any, result: Any = None) -> Callable[..., Any]:
    """A function of the core, by its name without the prefix; ctypes releases the GIL while it runs."""
    found = library()[f"mobee_{name}"]
    found.argtypes, found.restype = arguments, result
    return found


def address(array: NDArray[Any]) -> int:
    """Where the numbers of a C-contiguous array stand; the caller keeps the array alive."""
    try:
        return ctypes.addressof(_from_buffer(array))  # a quarter of the time of the other way
    except (ValueError, TypeError):  # no numbers, or they are not to be written
        return array.ctypes.data


_from_buffer = ctypes.c_char.from_buffer


__all__ = ["ADDRESS", "BYTES", "INTEGER", "LEVELS", "REAL", "address", "function", "library", "np", "sys"]
