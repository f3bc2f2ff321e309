# SPDX-License-Identifier: Apache-2.0
"""The SQLite file of a run: opens it, locks the data of an agent for one process, and reports errors of SQLite in one line.

In a run one or several agents learn; the file holds what they have recorded, such as transitions and reaches.

A lock lets only one process write the data of an agent; when a process ends, its locks end too. A lock covers one byte of a second file,
named as the data file with "-lock" appended. The operating system gives such a lock to a process, not to a descriptor. So the same process
may lock a byte twice; and if it closes any descriptor of the file, all its locks on the file end. Therefore a process opens the file only
once and counts its locks.
"""

from __future__ import annotations

import errno
import json
import os
import sqlite3
import time
import zlib
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from mobee.errors import InUse, MobeeError, NoRoom

SCHEMA = 1
APPLICATION_ID = 0x4D6F4265  # "MoBe": marks the file as ours
BUSY_TIMEOUT = 10.0  # s; another agent's commit takes milliseconds
TABLES = """
CREATE TABLE meta (agent TEXT NOT NULL, key TEXT NOT NULL, value TEXT NOT NULL, PRIMARY KEY (agent, key));
CREATE TABLE transitions (
    agent TEXT NOT NULL, n INTEGER NOT NULL, s INTEGER NOT NULL, a INTEGER NOT NULL, s_next INTEGER NOT NULL, reward REAL NOT NULL,
    settled INTEGER NOT NULL, duration REAL NOT NULL, q TEXT NOT NULL, touched TEXT NOT NULL, t REAL NOT NULL, PRIMARY KEY (agent, n));
"""
DAMAGED = "it is damaged; nothing was written to it. Restore it from a copy, or give another path"
NO_ROOM = ("SQLITE_FULL", "SQLITE_IOERR_WRITE", "SQLITE_IOERR_FSYNC", "SQLITE_IOERR_TRUNCATE", "SQLITE_IOERR_SHM")
REMEDIES = {
    "SQLITE_FULL": "the disk is full; make room and start again, all that was committed is safe",
    "SQLITE_IOERR": "the disk refused the write (full, over quota or failing); all that was committed is safe",
    "SQLITE_BUSY": f"another process kept it locked for {BUSY_TIMEOUT:g} s; find and end it",
    "SQLITE_READONLY": "it may not be written; check its permissions and those of its folder",
    "SQLITE_CANTOPEN": "it cannot be opened; check that its folder exists and may be written",
    "SQLITE_NOTADB": "it is not a database; give another path",
    "SQLITE_CORRUPT": DAMAGED,
    "SQLITE_CONSTRAINT": "another process writes transitions of the same agent; run one process an agent",
}
FULL = (errno.ENOSPC, errno.EDQUOT)


def opened(path: Path, read_only: bool, durable: bool = True) -> sqlite3.Connection:
    """Open the SQLite file with the data of the agents of a run and return the connection; a new file gets its tables.

    A file that is damaged, or was written by another program or with another schema, is refused and not changed. `read_only`: nothing
    is written to the file or beside it, and a file without tables is refused too. `durable`: True: a commit waits for the disk and
    survives a power cut; False: a commit survives the end of the process, but not a power cut. Every error is a MobeeError of one line.
    """
    with explained(path):
        database = sqlite3.connect(
            _address(path) if read_only else path, timeout=BUSY_TIMEOUT, isolation_level=None, check_same_thread=False, uri=read_only
        )
        try:
            if read_only:
                if not _is_ours(path, database):
                    raise MobeeError(f"{path} holds no transitions yet: it is empty.")
            else:
                _prepare(path, database, durable)
            _check(path, database)
        except BaseException:
            database.close()
            raise
    return database


@contextmanager
def transaction(database: sqlite3.Connection) -> Iterator[None]:
    """Run the body of a `with` statement as one transaction; no other process can write meanwhile. An error in the body undoes it."""
    database.execute("BEGIN IMMEDIATE")
    try:
        yield
        database.execute("COMMIT")
    finally:
        if database.in_transaction:  # a full disk has already rolled back
            database.execute("ROLLBACK")


@contextmanager
def explained(path: Path) -> Iterator[None]:
    """Convert SQLite errors in the body of a `with` statement into a MobeeError of one line, with the file `path` and the remedy.

    If the disk refuses a write, the error is a NoRoom.
    """
    try:
        yield
    except UnicodeDecodeError as error:
        raise damaged(path, "a text in it is no UTF-8") from error
    except sqlite3.Error as error:
        name = getattr(error, "sqlite_errorname", "")
        remedy = next((text for key, text in REMEDIES.items() if name.startswith(key)), "")
        kind = NoRoom if name.startswith(NO_ROOM) else MobeeError
        raise kind(f"{path}: {remedy or 'SQLite failed'} ({' '.join(str(error).split())[:200]}).") from error


def damaged(path: Path, what: str) -> MobeeError:
    """Return the error for a damaged file, to be raised by the caller. `what`: what is wrong with the file, for the message."""
    return MobeeError(f"{path}: {what}: {DAMAGED}.")


def json_of(path: Path, what: str, text: object) -> Any:
    """Return the value of a JSON text that was read from a data file; raises MobeeError if the text is not valid JSON.

    `path`: the file. `what`: name of the value, such as "the setting seed". Both are only used in the message of the error. `text`: the
    JSON text; the error is also raised if it is not a str, because then the file was damaged.
    """
    try:
        if isinstance(text, str):
            return json.loads(text)
    except (ValueError, RecursionError):
        pass
    raise damaged(path, f"{what} is not what MoBeE writes")


def _check(path: Path, database: sqlite3.Connection) -> None:
    """Raise MobeeError if pages or indices of the file are damaged, or one of the two tables is absent; it reads the whole file."""
    (found,) = database.execute("PRAGMA integrity_check(1)").fetchone()
    if found != "ok":
        raise damaged(path, " ".join(str(found).split())[:200])
    kinds = dict(database.execute("SELECT name, type FROM sqlite_master WHERE name IN ('meta', 'transitions')"))
    if kinds != {"meta": "table", "transitions": "table"}:
        raise damaged(path, "the tables meta and transitions are not both there")


def _address(path: Path) -> str:
    """Return the URI to read from; without a log beside it the file is opened as immutable, since SQLite would create a log."""
    log = path.with_name(path.name + "-wal")
    mode = "mode=ro" if log.exists() and log.stat().st_size else "mode=ro&immutable=1"
    return f"{path.absolute().as_uri()}?{mode}"


def _prepare(path: Path, database: sqlite3.Connection, durable: bool) -> None:
    database.execute(f"PRAGMA synchronous = {'FULL' if durable else 'OFF'}")
    with transaction(database):  # agents that start together must not make the tables twice
        if not _is_ours(path, database):
            for statement in TABLES.split(";")[:-1]:
                database.execute(statement)
            database.execute(f"PRAGMA application_id = {APPLICATION_ID}")
            database.execute(f"PRAGMA user_version = {SCHEMA}")
    _write_ahead(database)


def _is_ours(path: Path, database: sqlite3.Connection) -> bool:
    """Return whether the file has our tables; False for a new file; raises MobeeError for one of another program or schema."""
    application, version = (database.execute(f"PRAGMA {name}").fetchone()[0] for name in ("application_id", "user_version"))
    tables = database.execute("SELECT count(*) FROM sqlite_master").fetchone()[0]
    if not tables and not application and not version:
        if path.stat().st_size:
            raise MobeeError(f"{path}: a database without tables, which is damaged or of another program. Give another path.")
        return False
    if application != APPLICATION_ID:
        raise MobeeError(f"{path}: a database of another program. Give another path.")
    if version != SCHEMA:
        raise MobeeError(f"{path}: written with schema {version}, this mobee reads {SCHEMA}. Use the version that wrote it.")
    return True


def _write_ahead(database: sqlite3.Connection) -> None:
    """Switch to the write-ahead log; SQLite does not wait by itself when two processes do this at once."""
    deadline = time.monotonic() + BUSY_TIMEOUT
    while True:
        try:
            database.execute("PRAGMA journal_mode = WAL")
            return
        except sqlite3.OperationalError as error:
            if not error.sqlite_errorname.startswith("SQLITE_BUSY") or time.monotonic() > deadline:
                raise
            time.sleep(0.01)


try:
    import fcntl
except ImportError:  # no such locks on this system: nothing is excluded
    fcntl = None  # type: ignore[assignment]  # mypy expects a module here


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
