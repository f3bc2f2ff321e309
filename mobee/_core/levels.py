# SPDX-License-Identifier: Apache-2.0
"""The builds of the core (the compiled C++ code of the library), and which of them this processor runs.

There is one build for each level of x86-64 (a set of processor features, such as "x86-64-v3"), and a generic one on other machines. This
module imports only Python's own modules, because core/build.py loads it before the library's dependencies are installed.
"""

from __future__ import annotations

import hashlib
import platform
import sys
from collections.abc import Iterable
from pathlib import Path

FOLDER = Path(__file__).resolve().parent
SOURCES = FOLDER.parents[1] / "core"  # in a checkout, and where a wheel is built; an installed library has none
GENERIC = "generic"
SANITIZED = "sanitized"
"""The name of the build that stops at the first wrong address or undefined operation, for tests; made by core/build.py --sanitize."""

# What each level needs beyond the one before, as the kernel names it in /proc/cpuinfo.
NEEDS = {
    "x86-64-v2": ("cx16", "lahf_lm", "popcnt", "pni", "ssse3", "sse4_1", "sse4_2"),
    "x86-64-v3": ("avx", "avx2", "bmi1", "bmi2", "f16c", "fma", "abm", "movbe", "xsave"),
    "x86-64-v4": ("avx512f", "avx512bw", "avx512cd", "avx512dq", "avx512vl"),
}


def machine_levels() -> tuple[str, ...]:
    """Return the names of the builds of the core that exist for this kind of machine, the lowest level first.

    They are the levels of x86-64, such as "x86-64-v2", on Linux on such a processor, and ("generic",) on any other machine.
    """
    if sys.platform == "linux" and platform.machine() == "x86_64":
        return tuple(NEEDS)
    return (GENERIC,)


def missing(level: str, flags: Iterable[str]) -> list[str]:
    """Return the processor features that a level such as "x86-64-v3" needs and that are not in `flags`, sorted.

    `flags`: names of the processor's features, as in /proc/cpuinfo. The result is empty for an unknown level.
    """
    if level not in NEEDS:
        return []
    needed = [flag for name in NEEDS if name <= level for flag in NEEDS[name]]
    return sorted(set(needed) - set(flags))


def possible_levels(flags: Iterable[str]) -> list[str]:
    """Return the names of the builds of the core that a processor with these features runs, the lowest level first.

    `flags`: names of the features, as in /proc/cpuinfo.
    """
    flags = frozenset(flags)
    return [level for level in machine_levels() if not missing(level, flags)]


def processor_flags(cpuinfo: Path = Path("/proc/cpuinfo")) -> frozenset[str]:
    """Return the names of this processor's features, as the kernel gives them in the file `cpuinfo`.

    Without that file, or without flags in it, the features of x86-64-v2 are returned.
    """
    try:
        lines = cpuinfo.read_text().splitlines()
    except OSError:
        lines = []
    for line in lines:
        name, _, value = line.partition(":")
        if name.strip() == "flags":
            return frozenset(value.split())
    return frozenset(NEEDS["x86-64-v2"])


def library_file(level: str, folder: Path = FOLDER) -> Path:
    """Return the path of the library file of a build in `folder`; `level`: name of the build."""
    return folder / f"core-{level}.{'dylib' if sys.platform == 'darwin' else 'so'}"


def source_files() -> list[Path]:
    """Return the paths of all files from which a build of the core (the compiled C++ code) is made, sorted by name."""
    return sorted([*SOURCES.rglob("*.hpp"), *SOURCES.rglob("*.cpp"), SOURCES / "build.py"])


def fingerprint() -> str:
    """Return a hash (16 hexadecimal digits) of the C++ sources and build script of the core.

    Each compiled library contains the hash of the sources from which it was built.
    """
    digest = hashlib.sha256()
    for source in source_files():
        digest.update(source.relative_to(SOURCES).as_posix().encode() + b"\0" + source.read_bytes() + b"\0")
    return digest.hexdigest()[:16]
