"""Where the engine's machine code is kept, under a key that sees all that it depends on.

Numba's own cache looks at the file of one function and misses edits of what it calls, so the whole engine has one folder, named
after the hash of its sources, of what compiles them and of the processor.  This file imports nothing of the project and not
Numba: run as a script it prints the folder, in the time that Python takes to start.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import platform
import re
import shutil
import sys
from importlib.metadata import version
from pathlib import Path

KEPT = 8  # folders of other versions: checkouts and branches, which are used in turn
READY = "ready"  # in a folder that holds everything

_SOURCES = Path(__file__).parent
_NAME = re.compile(r"engine-[0-9a-f]{16}")
_HARMLESS = ("NUMBA_CACHE_", "NUMBA_NUM_THREADS", "NUMBA_THREADING_LAYER")  # settings that change no machine code


def cache_folder() -> Path:
    """The folder of this version of the engine, in $MOBEE_CACHE, else $XDG_CACHE_HOME/mobee, else ~/.cache/mobee."""
    home = os.environ.get("MOBEE_CACHE") or os.path.join(os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache"), "mobee")
    return Path(home) / f"engine-{key()}"


def key() -> str:
    """The hash of the engine's sources, Python, Numba, NumPy, the processor and Numba's settings."""
    digest = hashlib.sha256()
    for what in (platform.python_version(), *(version(name) for name in ("numba", "llvmlite", "numpy")), _processor(), *_settings()):
        digest.update(what.encode() + b"\0")
    for source in sorted(_SOURCES.rglob("*.py")):
        digest.update(source.relative_to(_SOURCES).as_posix().encode() + b"\0")
        digest.update(source.read_bytes() + b"\0")
    return digest.hexdigest()[:16]


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
    others = [path for path in folder.parent.iterdir() if _NAME.fullmatch(path.name) and path != folder and not path.is_symlink()]
    for old in sorted(others, key=_last_use, reverse=True)[KEPT:]:
        shutil.rmtree(old, ignore_errors=True)


def _last_use(folder: Path) -> float:
    for path in (folder / READY, folder):
        with contextlib.suppress(OSError):  # not ready, or removed by another process
            return path.stat().st_mtime
    return 0.0


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
