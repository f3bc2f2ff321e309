# SPDX-License-Identifier: Apache-2.0
"""The folder of an experiment's run: its options, the versions of the software, its records and its results.

`Records` appends records to a CSV file one by one, so that an interruption loses no finished record.  `encoded` and `decoded` convert
structs to JSON and back.  Unlike msgspec's own JSON, in which infinity becomes null, every float is read as it was written.
"""

from __future__ import annotations

import csv
import io
import json
import os
import platform
import re
import shutil
import subprocess
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, fields
from importlib import metadata
from pathlib import Path
from types import TracebackType
from typing import Any, ClassVar, Self, TypeVar

import msgspec

from experiments.registry import all_names, current_name
from mobee.errors import InvalidValue
from mobee.robot.writing import write_whole

PACKAGES = ("mobee", "numpy", "python-fcl", "mujoco", "matplotlib")
SOURCES = ("core", "mobee", "experiments")
CONFIG, VERSIONS, RESULTS = "config.json", "versions.json", "results.json"
T = TypeVar("T")


def new_run(runs: Path, name: str, options: Mapping[str, Any]) -> Path:
    """Make the folder `runs`/<time>-<name> of a new run, with config.json and versions.json, and return it.

    `runs`: the folder of all runs, made if it does not exist.  `name`: name of the experiment.  `options`: options of the run, by name.
    <time> is the local time, as 20260131-142530; if the folder exists, -2, -3, ... is appended.  Raises OSError if it cannot be written.
    """
    runs.mkdir(parents=True, exist_ok=True)
    stamp = time.strftime("%Y%m%d-%H%M%S")
    number = 1
    while True:
        folder = runs / (f"{stamp}-{name}" if number == 1 else f"{stamp}-{name}-{number}")
        try:
            folder.mkdir()
            break
        except FileExistsError:  # two runs in one second get two folders
            number += 1
    try:
        write(folder / CONFIG, {"experiment": name, "options": dict(options)})
        write(folder / VERSIONS, _versions())
    except BaseException:  # a full disk or Ctrl-C: a folder without options could not be resumed
        shutil.rmtree(folder)
        raise
    return folder


def discard_unused(folder: Path) -> None:
    """Remove the folder of a run, if it has only config.json, versions.json and empty files: the run wrote no result."""
    if all(path.name in (CONFIG, VERSIONS) or (path.is_file() and path.stat().st_size == 0) for path in folder.iterdir()):
        shutil.rmtree(folder)


def experiment_of(folder: Path) -> str:
    """Return the name of the experiment of a run; raises InvalidValue if `folder` is not the folder of a run."""
    return _begun(folder)[0]


def _begun(folder: Path) -> tuple[str, dict[str, Any]]:
    """Return the experiment's name and the options of a run."""
    try:
        config = json.loads((folder / CONFIG).read_text())
        return str(config["experiment"]), dict(config["options"])
    except (OSError, ValueError, KeyError, TypeError):
        raise InvalidValue(f"{folder} is not the folder of a run: it has no readable {CONFIG}.") from None


def options_of(folder: Path, name: str) -> dict[str, Any]:
    """Return the recorded options of a run, by name; raises InvalidValue if it is not a run of the experiment `name`."""
    begun, options = _begun(folder)
    if current_name(begun) != current_name(name):
        raise InvalidValue(f"{folder} is a run of {begun!r}, not of {name!r}.")
    return options


def keep_options(folder: Path, name: str, options: Mapping[str, Any]) -> None:
    """Record new options of a run of the experiment `name` that is continued: write them into its config.json, if they have changed.

    Then results.json is removed: its results are of the former options, and an interruption must not leave them with the new ones.
    `folder`: folder of the run.  `options`: all options of the run, by name.
    """
    if options_of(folder, name) != json.loads(json.dumps(options, default=str)):
        (folder / RESULTS).unlink(missing_ok=True)
        with (folder / CONFIG).open("r+") as config:  # not replaced, because it is locked; not emptied first, because the disk may be full
            config.write(_json({"experiment": name, "options": dict(options)}))
            config.truncate()


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Lock the folder of a run against other processes for the duration of a `with` statement; without effect on Windows.

    Raises InvalidValue if another process holds the lock, OSError if config.json cannot be opened.
    """
    with (folder / CONFIG).open("r+") as config:
        _lock(config.fileno(), folder)
        yield  # unlocked when the file is closed, at the latest when the process ends


def _lock(config: int, folder: Path) -> None:
    try:
        import fcntl
    except ImportError:  # Windows has no fcntl: runs are not locked there
        return
    try:
        fcntl.flock(config, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise InvalidValue(
            f"{folder}: another process works on this run. Wait until it ends, or begin a new run without --resume."
        ) from None


def newest_run(runs: Path, name: str) -> Path:
    """Return the folder of the newest run of an experiment in the folder `runs`; raises InvalidValue if there is none."""
    runs_of_it = re.compile(rf"(\d{{8}}-\d{{6}})-(?:{'|'.join(map(re.escape, all_names(name)))})(?:-(\d+))?")
    found = {path.parent: match.groups() for path in runs.glob(f"*/{CONFIG}") if (match := runs_of_it.fullmatch(path.parent.name))}
    if not found:
        raise InvalidValue(f"no run of {name!r} in {runs}: start one with `mobee experiment run {name}`, or name its folder.")
    return max(found, key=lambda folder: (found[folder][0], int(found[folder][1] or 1)))


def given_run(folder: Path, runs: Path, name: str) -> Path:
    """Return `folder` if it is a folder; otherwise raises InvalidValue with a message that names the experiment's newest run in `runs`."""
    if folder.is_dir():
        return folder
    try:
        newest = newest_run(runs, name)
    except InvalidValue as error:
        raise InvalidValue(f"{folder}: there is no such folder; {error}") from None
    raise InvalidValue(f"{folder}: there is no such folder. The newest run of {name!r} is {newest}.")


def write(path: Path, content: Mapping[str, Any]) -> None:
    """Write `content` as indented JSON to a file; values that JSON does not have are written as text.

    If the file cannot be written, for example on a full disk, or if the program is killed, the former file stays as it is.
    """
    write_whole(path, _json(content).encode())


def _json(content: Mapping[str, Any]) -> str:
    return json.dumps(content, indent=2, default=str) + "\n"


def read(path: Path) -> dict[str, Any]:
    """Return the content of a JSON file, as `write` writes it; raises InvalidValue if the file is missing or damaged."""
    try:
        return dict(json.loads(path.read_text()))
    except (OSError, ValueError, TypeError):
        raise InvalidValue(f"{path} cannot be read: it is missing or damaged.") from None


def _versions() -> dict[str, Any]:
    packages = {}
    for package in PACKAGES:
        try:
            packages[package] = metadata.version(package)
        except metadata.PackageNotFoundError:
            continue
    machine = {"python": platform.python_version(), "platform": platform.platform(), "processor": _processor()}
    return {**machine, "commit": _commit(), "sources": _sources(), "packages": packages, "begun": time.strftime("%Y-%m-%dT%H:%M:%S%z")}


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:  # not Linux
        return platform.processor()
    return next((line.partition(":")[2].strip() for line in lines if line.startswith("model name")), platform.machine())


def _commit() -> str | None:
    """Return the commit of the sources, with a + if they have been edited since; None outside a git checkout."""
    return _git("describe", "--always", "--abbrev=12", "--dirty=+", "--exclude=*") or None


def _sources() -> dict[str, str]:
    """Return git's hash of each folder of sources at the commit: other commits with the same hashes give the same results."""
    return {folder: found[:12] for folder in SOURCES if (found := _git("rev-parse", "--verify", "--quiet", f"HEAD:{folder}"))}


def _git(*command: str) -> str:
    """Return the output of a git command for the repository of this file; "" outside a checkout."""
    try:
        done = subprocess.run(["git", "-C", str(Path(__file__).parent), *command], capture_output=True, text=True, timeout=10.0)
    except (OSError, subprocess.TimeoutExpired):
        return ""
    return done.stdout.strip()


def encoded(record: Any, indent: int | None = None) -> str:
    """Return a msgspec Struct, or a list of Structs, as JSON text; numbers that are not finite are written as Infinity, -Infinity or NaN.

    `indent`: spaces for each level; None: all in one line.  `record`: the Struct or list.
    """
    return json.dumps(msgspec.to_builtins(record), indent=indent)


def decoded(text: str, kind: type[T]) -> T:
    """Return the object of type `kind` that `encoded` has written as `text`; raises msgspec.ValidationError for another type."""
    return msgspec.convert(json.loads(text), type=kind)


class Records:
    """A CSV file with a header, to which records are appended; each record is written to the file when `append` returns.

    `columns`: names of the columns.  When an existing file is opened, an incomplete last line is removed.
    """

    def __init__(self, path: Path, columns: tuple[str, ...]) -> None:
        self.path, self.columns = path, columns
        self._file = path.open("a+", newline="", encoding="utf-8")
        self._file.truncate(len(_whole(path)))
        self._file.seek(0, os.SEEK_END)
        self._writer = csv.DictWriter(self._file, columns)

    def append(self, record: Mapping[str, object]) -> None:
        """Write one record, a value for each column, and before the first record the header."""
        if self._file.tell() == 0:
            self._writer.writeheader()
        self._writer.writerow(record)
        self._file.flush()

    def __enter__(self) -> Records:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self._file.close()


def read_records(path: Path, columns: tuple[str, ...]) -> list[dict[str, str]]:
    """Return all complete records of a CSV file, each as a dict from column name to text, with these columns; [] if there is no file.

    Raises InvalidValue if the file is damaged, or lacks one of the columns.
    """
    if not path.exists():
        return []
    try:
        reader = csv.DictReader(io.StringIO(_whole(path).decode(), newline=""))
    except UnicodeDecodeError as error:
        raise InvalidValue(f"{path} is damaged ({error}): restore it, or start a new run without --resume.") from None
    names, rows = tuple(reader.fieldnames or columns), []
    if absent := [column for column in columns if column not in names]:
        raise InvalidValue(
            f"{path} has no column {', '.join(absent)}: it is damaged, or of another version. Start a new run without --resume."
        )
    for row in reader:
        if None in row or None in row.values():
            raise InvalidValue(
                f"{path}, line {reader.line_num}: no record with the columns {', '.join(names)}. Restore the line, or start a new run "
                "without --resume."
            )
        rows.append({column: row[column] for column in columns})
    return rows


def _whole(path: Path) -> bytes:
    """Return the complete lines of a file."""
    content = path.read_bytes()
    return content[: content.rfind(b"\n") + 1]


def rounded(**values: Any) -> dict[str, Any]:
    """Return the keyword arguments as a dict, with floats rounded to six decimals: the values that one run of a sweep returns."""
    return {name: round(value, 6) if isinstance(value, float) else value for name, value in values.items()}


@dataclass(frozen=True, slots=True)
class Row:
    """Base class of dataclasses that are records of a CSV file; their fields are of type str, int, float or bool.

    `PLACES`: number of decimals to which floats are rounded in a record; None: they are not rounded.
    """

    PLACES: ClassVar[int | None] = 6  # of numbers in the record; None: all digits

    @classmethod
    def columns(cls) -> tuple[str, ...]:
        """Return the names of the dataclass fields, in their order: they are the column names of the CSV file that has such records."""
        return tuple(field.name for field in fields(cls))

    def record(self) -> dict[str, object]:
        """Return the fields by name, as one record of the file, or as the values of a cell (one run of a sweep).

        Floats are rounded to PLACES decimals, 6 unless a subclass sets another number (None: they are not rounded).  Characters of texts
        that are not ASCII are written as escapes.
        """
        return {name: self._written(getattr(self, name)) for name in self.columns()}

    def _written(self, value: object) -> object:
        if isinstance(value, float) and self.PLACES is not None:
            return round(value, self.PLACES)
        return value.encode("ascii", "backslashreplace").decode() if isinstance(value, str) else value

    @classmethod
    def of_record(cls, row: Mapping[str, str]) -> Self:
        """Return the object that a row of the file describes; `row`: text by column name, as `read_records` returns it."""
        read: dict[str, Any] = {"float": float, "int": int, "bool": "True".__eq__, "str": str}
        return cls(**{field.name: read[str(field.type)](row[field.name]) for field in fields(cls)})
