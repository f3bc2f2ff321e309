# SPDX-License-Identifier: Apache-2.0
"""Which process writes what in a file: a claim excludes other processes, and ends with its process at the latest.

A claim is a lock on one byte of a file beside the data.  Such locks belong to a process: the same process may claim twice, and all its
locks on a file end when it closes any descriptor of that file.  Therefore a process opens the file once and counts its claims.
"""

from __future__ import annotations

import os
import zlib
from collections import Counter
from contextlib import suppress
from pathlib import Path

from mobee.errors import InUse, MobeeError, NoRoom

try:
    import fcntl
except ImportError:  # no such locks on this system: nothing is excluded
    fcntl = None  # type: ignore[assignment]


class _LockFile:
    """The file of locks beside one file, as this process has it open."""

    def __init__(self, path: Path) -> None:
        self.descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
        self.claims: Counter[str] = Counter()


_open: dict[Path, _LockFile] = {}


def claim(path: Path, name: str) -> None:
    """Claim the right to write what `name` has in a file; raises InUse while another process has it."""
    if fcntl is None:
        return
    where = path.with_name(path.name + "-lock").absolute()
    try:
        file = _open.get(where) or _open.setdefault(where, _LockFile(where))
        fcntl.lockf(file.descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB, 1, _byte(name))
    except (BlockingIOError, PermissionError) as error:
        if where in _open:
            _close_if_unused(where)
            raise InUse(
                f"{path}: another process writes the data of {name}: end it first (`mobee status` shows the systems that run), "
                "or use another file or run folder."
            ) from None
        raise MobeeError(f"{path}: {where.name} beside it cannot be made ({error.strerror}).") from None
    except OSError as error:
        raise NoRoom(f"{path}: {where.name} beside it cannot be made ({error.strerror}).") from None
    file.claims[name] += 1


def release(path: Path, name: str) -> None:
    """End a claim."""
    where = path.with_name(path.name + "-lock").absolute()
    file = _open.get(where)
    if file is None or fcntl is None or not file.claims[name]:
        return
    file.claims[name] -= 1
    if not file.claims[name]:
        with suppress(OSError):
            fcntl.lockf(file.descriptor, fcntl.LOCK_UN, 1, _byte(name))
    _close_if_unused(where)


def _close_if_unused(where: Path) -> None:
    if not any(_open[where].claims.values()):
        os.close(_open.pop(where).descriptor)


def _byte(name: str) -> int:
    return zlib.crc32(name.encode())
