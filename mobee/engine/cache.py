"""Where the engine's machine code is kept, under a key that sees all that it depends on.

Numba's own cache looks at the file of one function and misses edits of what it calls, so all that is compiled has one folder,
named after the hash of the sources, of what compiles them and of the processor.  In it a function's file is named after the
sources that the function can depend on: after an edit the others are taken over from the folder of the version before.  This file
imports nothing of the project and not Numba: run as a script it prints the folder, in the time that Python takes to start.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import platform
import re
import shutil
import sys
from functools import cache
from importlib.metadata import version
from pathlib import Path

KEPT = 8  # folders of other versions: checkouts and branches, which are used in turn
READY = "ready"  # in a folder that holds everything

_SOURCES = Path(__file__).parents[1]
_FOLDERS = ("engine", "control", "learning", "simulation")  # of the library, where compiled functions are
_IMPORT = re.compile(r"^from mobee\.([\w.]+) import (\([^)]*\)|[^\n]*)", re.MULTILINE)
_NAME = re.compile(r"engine-[0-9a-f]{16}")
_HARMLESS = ("NUMBA_CACHE_", "NUMBA_NUM_THREADS", "NUMBA_THREADING_LAYER")  # settings that change no machine code


def cache_folder() -> Path:
    """The folder of this version of the engine, in $MOBEE_CACHE, else $XDG_CACHE_HOME/mobee, else ~/.cache/mobee."""
    home = os.environ.get("MOBEE_CACHE") or os.path.join(os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache"), "mobee")
    return Path(home) / f"engine-{key()}"


def key() -> str:
    """The hash of the sources, Python, Numba, NumPy, the processor and Numba's settings."""
    digest = hashlib.sha256(_compiler())
    for source in sorted(compiled_sources()):
        digest.update(source.relative_to(_SOURCES).as_posix().encode() + b"\0")
        digest.update(source.read_bytes() + b"\0")
    return digest.hexdigest()[:16]


def compiled_sources() -> list[Path]:
    """The files among which the compiled functions are."""
    return [source for folder in _FOLDERS for source in (_SOURCES / folder).rglob("*.py")]


@cache
def stamp(file: str) -> str:
    """The hash of a source file, of all that it imports from where compiled functions are, and of what compiles them."""
    sources, waiting = {Path(file).resolve()}, [Path(file).resolve()]
    while waiting:
        for source in _imported(waiting.pop()):
            if source not in sources:
                sources.add(source)
                waiting.append(source)
    contents = sorted(hashlib.sha256(source.read_bytes()).digest() for source in sources)
    return hashlib.sha256(_compiler_at_start() + b"".join(contents)).hexdigest()


@cache
def _imported(file: Path) -> tuple[Path, ...]:
    """The sources that a file imports at its top: all that its compiled functions can see."""
    found: list[Path] = []
    for module, names in _IMPORT.findall(file.read_text()):
        path = _SOURCES.joinpath(*module.split("."))
        if path.relative_to(_SOURCES).parts[0] in _FOLDERS:
            found += [path.with_suffix(".py"), path / "__init__.py", *(path / f"{name}.py" for name in re.findall(r"\w+", names))]
    return tuple(source for source in found if source.exists())


def _compiler() -> bytes:
    versions = (version(name) for name in ("numba", "llvmlite", "numpy"))
    return b"\0".join(what.encode() for what in (platform.python_version(), *versions, _processor(), *_settings()))


def others(folder: Path) -> list[Path]:
    """The folders of other versions beside this one, the one used last first."""
    found = [path for path in folder.parent.iterdir() if _NAME.fullmatch(path.name) and path != folder and not path.is_symlink()]
    return sorted(found, key=_last_use, reverse=True)


def is_ready(folder: Path) -> bool:
    """Whether a folder holds the whole engine."""
    return (folder / READY).exists()


def mark_used(folder: Path) -> None:
    """Note that a folder is in use, so that others are removed before it."""
    with contextlib.suppress(OSError):  # read-only: nobody removes it either
        os.utime(folder / READY)


def mark_ready(folder: Path) -> None:
    """Note that a folder holds the whole engine; those not used for longest make room."""
    (folder / READY).touch()
    for old in others(folder)[KEPT:]:
        shutil.rmtree(old, ignore_errors=True)


def _last_use(folder: Path) -> float:
    for path in (folder / READY, folder):
        with contextlib.suppress(OSError):  # not ready, or removed by another process
            return path.stat().st_mtime
    return 0.0


@cache
def _compiler_at_start() -> bytes:
    return _compiler()


def _processor() -> str:
    """What tells processors apart that do not run each other's instructions."""
    try:
        first = Path("/proc/cpuinfo").read_text().split("\n\n")[0]
    except OSError:
        return f"{platform.machine()} {platform.processor()}"
    lines = [line for line in first.splitlines() if re.match(r"(vendor_id|cpu family|model|model name|flags|CPU .*|Features)\s*:", line)]
    return "\n".join([platform.machine(), *lines])


def _settings() -> list[str]:
    return sorted(f"{name}={value}" for name, value in os.environ.items() if name.startswith("NUMBA_") and not name.startswith(_HARMLESS))


if __name__ == "__main__":
    sys.stdout.write(f"{cache_folder()}\n")
