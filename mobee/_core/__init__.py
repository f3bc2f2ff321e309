# SPDX-License-Identifier: Apache-2.0
"""The native core: loads its shared library, built from the sources in core/, and passes arrays to its functions through ctypes.

Each module here declares the functions of the C++ files that its first line names. The core receives addresses of arrays, addresses with
lengths (`View`) and tables of C structures, and does not check them: the callers do.
"""

from __future__ import annotations

import ctypes
import os
import sys
from collections.abc import Callable, Iterable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mobee._core.levels import (
    FOLDER,
    SANITIZED,
    SOURCES,
    fingerprint,
    library_file,
    machine_levels,
    missing,
    possible_levels,
    processor_flags,
)
from mobee.arrays import Array, Ints
from mobee.errors import NotInstalled, UnknownName

INTEGER, REAL, ADDRESS = ctypes.c_int64, ctypes.c_double, ctypes.c_void_p
BYTES = ctypes.c_char_p
"""The ctypes type of an argument that is given as `array.tobytes()` and only read by the core; for a few numbers it is faster than an
address."""

Table = np.ndarray[tuple[int, ...], np.dtype[np.void]]
"""An array of structures of the core: `table["low"]` is a view of the member `low` of all structures."""

WHOLE = "i8"
INTERVAL = np.dtype([("first", WHOLE), ("end", WHOLE)])

NUMBERS, REALS = 6, 7  # of a contact: pose, kind, first, second, their links; depth, normal, point
ROW_BYTES = 8 * (NUMBERS + REALS)

_NOTHING: Any = ctypes.c_char * 0

ABI = 4
"""The version of the interface between Python and the core (core/interface.hpp); the function `mobee_abi` of a library must return it."""

FORCED = "MOBEE_CORE"
"""The environment variable with the name of the build to use, such as x86-64-v3."""


class CoreUnavailable(NotInstalled):
    """Raised if the native library is missing, was built from other sources, or does not run on this processor."""


@cache
def library() -> ctypes.CDLL:
    """Return the core's shared library for this processor; it is loaded at the first call. Raises CoreUnavailable."""
    return load(choose(os.environ.get(FORCED, ""), processor_flags()))


def choose(forced: str, flags: Iterable[str], folder: Path = FOLDER) -> str:
    """Return the name of the build of the core to load; a build is the library compiled for one level of processors, such as "x86-64-v3".

    `forced`: name of the requested build; "": the build of the highest level in `folder` that runs on a processor with these `flags`, the
    names of features in /proc/cpuinfo; if `folder` has none, the name of the highest level that runs here. Raises CoreUnavailable if the
    requested build is unknown or does not run here, or if no level runs here.
    """
    flags = frozenset(flags)
    known, possible = machine_levels(), possible_levels(flags)
    if forced:
        if forced == SANITIZED and "asan" not in os.environ.get("LD_PRELOAD", ""):
            raise CoreUnavailable(f"{FORCED}={forced} needs the sanitizers in the process before it: run python core/sanitize.py COMMAND.")
        if forced not in (*known, SANITIZED):
            raise CoreUnavailable(str(UnknownName(f"level in {FORCED}:", forced, known)))
        if lacks := missing(forced, flags):
            rest = f"Valid here: {', '.join(possible)}; or leave {FORCED} out." if possible else "None of the builds runs here."
            raise CoreUnavailable(f"{FORCED}={forced}: this processor lacks {', '.join(lacks)}. {rest}")
        return forced
    if not possible:
        lacks = missing(known[0], flags)
        raise CoreUnavailable(f"MoBeE needs a processor of level {known[0]}, of about 2009 or later: this one lacks {', '.join(lacks)}.")
    return next((level for level in reversed(possible) if library_file(level, folder).exists()), possible[-1])


def load(level: str, folder: Path = FOLDER) -> ctypes.CDLL:
    """Load the build of the core for a level of processors, such as "x86-64-v3", and return the library.

    Raises CoreUnavailable if the file is missing, cannot be loaded, was built from other sources than those of this checkout, or its
    interface has another version than ABI.
    """
    file = library_file(level, folder)
    if not file.exists():
        raise CoreUnavailable(f"there is no {file}: {_remedy(level)}")
    try:
        found = ctypes.CDLL(str(file))
    except OSError as error:
        raise CoreUnavailable(f"{file} cannot be loaded ({error}): {_remedy(level)}") from None
    found.mobee_sources.restype = ctypes.c_char_p
    if _is_checkout() and fingerprint() not in found.mobee_sources().decode():
        raise CoreUnavailable(f"{file} was built from other sources than those in {SOURCES}: {_remedy(level)}")
    if (abi := found.mobee_abi()) != ABI:
        raise CoreUnavailable(f"{file} has the interface {abi}, this version of mobee calls {ABI}: {_remedy(level)}")
    return found


def function(name: str, *arguments: Any, result: Any = None) -> Callable[..., Any]:
    """Return a compiled function of the core as a Python function; `name`: its name without the prefix `mobee_`.

    `arguments`, `result`: the ctypes types of its arguments and its result. Python's global lock (GIL) is released while it runs.
    """
    found = library()[f"mobee_{name}"]
    found.argtypes, found.restype = arguments, result
    return found


def address(array: NDArray[Any]) -> int:
    """Return the memory address of the first number of an array; the caller must keep the array alive while the core uses it.

    Raises ValueError if the array is not C-contiguous and aligned.
    """
    flags = array.flags
    if flags.carray:  # writable: this gives the same address as `array.ctypes.data`, in a quarter of the time
        return ctypes.addressof(_NOTHING.from_buffer(array))
    whole = array.base
    if isinstance(whole, np.ndarray) and whole.nbytes == array.nbytes and whole.flags.carray and flags.c_contiguous:
        return ctypes.addressof(_NOTHING.from_buffer(whole))  # the array is a read-only view of the whole of it
    if not (flags.c_contiguous and flags.aligned):
        raise ValueError("the core needs arrays that are contiguous, row by row, and aligned")
    return array.ctypes.data


class View(ctypes.Structure):
    """The address and the length of an array, as an argument of the core; the caller keeps the array alive."""

    _fields_ = (("data", ADDRESS), ("size", INTEGER))


def view(array: Array | Ints | Table) -> View:
    """Return the memory address of a C-contiguous array and its number of rows, len(array).

    The caller must keep the array alive while the core uses it. Raises ValueError as `address` does.
    """
    return View(address(array), len(array))


def columns(*names: str, whole: tuple[str, ...] = ()) -> np.dtype[np.void]:
    """Return the NumPy type of a structure of the core: a double for each of `names`, then a 64-bit integer for each of `whole`."""
    return np.dtype([*((name, "f8") for name in names), *((name, WHOLE) for name in whole)])


def numbers(values: Array, count: int) -> bytes:
    """Return the numbers `values` (count,) as bytes, for a function of the core that only reads them; ValueError for another shape."""
    given = np.asarray(values, dtype=np.float64)
    if given.shape != (count,):
        raise ValueError(f"an array of shape {given.shape}: must be ({count},)")
    return given.tobytes()


def _is_checkout() -> bool:
    return (SOURCES / "interface.hpp").exists()


def _remedy(level: str) -> str:
    if not _is_checkout():
        return "install mobee again, for this machine: pip install --force-reinstall --no-deps mobee"
    return f"run {Path(sys.executable).name} {SOURCES / 'build.py'}" + (" --sanitize" if level == SANITIZED else "")


__all__ = [
    "ADDRESS",
    "BYTES",
    "INTEGER",
    "INTERVAL",
    "NUMBERS",
    "REAL",
    "REALS",
    "ROW_BYTES",
    "WHOLE",
    "CoreUnavailable",
    "Table",
    "View",
    "address",
    "columns",
    "function",
    "library",
    "numbers",
    "view",
]
