# SPDX-License-Identifier: Apache-2.0
"""Locks that let only one process write the data of an agent into a file; when a process ends, its locks end too.

A lock covers one byte of a second file, named as the data file with "-lock" appended.  The operating system gives such a lock to a process,
not to a descriptor.  So the same process may lock a byte twice; and if it closes any descriptor of the file, all its locks on the file end.
Therefore a process opens the file only once and counts its locks.
"""

from __future__ import annotations

import errno
import os
import zlib
from collections import Counter
from contextlib import suppress
from pathlib import Path

from mobee.errors import InUse, MobeeError, NoRoom

try:
    import fcntl
except ImportError:  # no such locks on this system: nothing is excluded
    fcntl = None  # type: ignore[assignment]  # mypy expects a module here

FULL = (errno.ENOSPC, errno.EDQUOT)


class _LockFile:
    """The file of locks beside one file, as this process has it open."""

    def __init__(self, path: Path) -> None:
        self.descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
        self.held: Counter[str] = Counter()


_open: dict[Path, _LockFile] = {}


def lock(path: Path, name: str) -> None:
    """Lock the data of the agent `name` in the file `path` against other processes.

    Raises InUse while another process holds the lock, NoRoom if the disk is full, MobeeError if no lock can be made for another reason.
    On a system without such locks (no module fcntl) nothing is done.
    """
    if fcntl is None:
        return
    where = path.with_name(path.name + "-lock").absolute()
    try:
        file = _open.get(where) or _open.setdefault(where, _LockFile(where))
        fcntl.lockf(file.descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB, 1, _byte(name))
    except OSError as error:
        is_open = where in _open
        if is_open:
            _close_if_unused(where)
        if is_open and isinstance(error, BlockingIOError | PermissionError):
            raise InUse(
                f"{path}: another process writes the data of {name}: end it first (`mobee status` shows the systems that run), "
                "or use another file or run folder."
            ) from None
        kind = NoRoom if error.errno in FULL else MobeeError
        raise kind(f"{path}: {where.name} beside it cannot be {'locked' if is_open else 'made'} ({error.strerror}).") from None
    file.held[name] += 1


def unlock(path: Path, name: str) -> None:
    """Undo one call of `lock` with the same arguments; the data are unlocked after as many calls of `unlock`. Never raises an error."""
    where = path.with_name(path.name + "-lock").absolute()
    file = _open.get(where)
    if file is None or fcntl is None or not file.held[name]:
        return
    file.held[name] -= 1
    if not file.held[name]:
        with suppress(OSError):  # a lock that cannot be released ends when this process closes the file
            fcntl.lockf(file.descriptor, fcntl.LOCK_UN, 1, _byte(name))
    _close_if_unused(where)


def _close_if_unused(where: Path) -> None:
    if not any(_open[where].held.values()):
        os.close(_open.pop(where).descriptor)


def _byte(name: str) -> int:
    return zlib.crc32(name.encode())
