"""Every URDF that somebody has: does it load, are its links where Pinocchio has them, does it touch what coal says?

Claim: a URDF of others loads as it is or is refused with the line and a remedy; the frames of all links are Pinocchio's within 1e-9,
and with exact hulls the pairs of links that touch are coal's, in every pose.  Source: none; our own promise (docs/robots.md).
Run time: about five minutes for 181 files.

Without folders it looks at the files of icub_models, pybullet_data (without random_urdfs), mujoco and example-robot-data, as far as
these packages are installed.  Every file is on disk when it has been looked at; --resume goes on behind them.  The run's folder then holds
the table as urdf-files.md.  Pinocchio reads the file by itself, shapes and meshes included.
"""

from __future__ import annotations

import argparse
import importlib.metadata
import importlib.util
import sys
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from experiments.kit.command_line import Progress, positive_whole
from experiments.kit.records import Records, read_records
from experiments.urdf_files.figure import draw
from experiments.urdf_files.looked_at import LookedAt, look_at
from experiments.urdf_files.table import numbers, write_table
from mobee.errors import InvalidValue

NAME = "urdf-files"
CLAIM = "URDFs of others load or are refused with a remedy; links are Pinocchio's within 1e-9, contacts coal's"
SOURCE = "our own promise, docs/robots.md"

RECORDS = "urdf-files.csv"
FRAME_ERROR = 1e-9  # m and 1
LEFT_OUT = "random_urdfs"  # a thousand small things


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options."""
    text = "where to look for *.urdf, as NAME=PATH or PATH (default: packages that are installed)"
    parser.add_argument("--folders", nargs="+", default=[], metavar="DIR", help=text)
    parser.add_argument("--poses", type=positive_whole, default=100, metavar="N", help="random poses of each robot (default: 100)")
    parser.add_argument("--only", default="", metavar="TEXT", help="files with this in their path")


def run(arguments: argparse.Namespace, folder: Path) -> dict[str, Any]:
    """Look at every file that has not been looked at."""
    files = dict(_files(_folders(arguments.folders), arguments.only))
    if not files:
        raise InvalidValue("there is no .urdf file to look at; name folders with --folders DIR, or install icub-models.")
    path = folder / RECORDS
    done = {one.name for one in read_all(path)}
    with Records(path, LookedAt.columns()) as records, Progress() as progress, tempfile.TemporaryDirectory() as scratch:
        for number, (name, file) in enumerate(files.items()):
            progress.show(number / len(files), name)
            if name not in done:
                records.append(look_at(name, file, arguments.poses, arguments.seed, Path(scratch)).record())
    found = [one for one in read_all(path) if one.name in files]
    write_table(found, folder / "urdf-files.md")
    return results(found)


def read_all(path: Path) -> list[LookedAt]:
    """What a run has so far."""
    return [LookedAt.of_record(row) for row in read_records(path, LookedAt.columns())]


def results(found: Sequence[LookedAt]) -> dict[str, Any]:
    """The numbers of each set of files, and what went wrong."""
    sets = {set_name: [one for one in found if one.name.startswith(f"{set_name}/")] for set_name in dict.fromkeys(map(_set_of, found))}
    table = {set_name: numbers(some) for set_name, some in {**sets, "all": list(found)}.items()}
    whole = table["all"]
    passed = whole["crashes"] == 0 and whole["frame_error"] <= FRAME_ERROR and whole["other_contacts"] == 0
    refused = {one.name: one.message for one in found if one.outcome in ("refused", "crash")}
    other = {one.name: f"{one.other} of {one.contacts}, {one.deepest_other:.2g} m at most" for one in found if one.other > 0}
    apart = {one.name: one.message for one in found if one.outcome == "loads" and one.message}
    return {"passed": passed, "sets": table, "refused": refused, "contacts_that_differ": other, "not_compared": apart}


def _set_of(one: LookedAt) -> str:
    return one.name.partition("/")[0]


def _folders(given: Sequence[str]) -> dict[str, Path]:
    """The folders by the name of their set."""
    if not given:
        return dict(_installed())
    folders: dict[str, Path] = {}
    for text in given:
        name, _, path = text.rpartition("=")
        if not Path(path).is_dir():
            raise InvalidValue(f"{path}: there is no such folder. Give one that holds .urdf files.")
        folders[name or Path(path).resolve().name] = Path(path)
    return folders


def _installed() -> Iterator[tuple[str, Path]]:
    yield "icub_models", Path(sys.prefix) / "share" / "iCub" / "robots"
    for package in ("pybullet_data", "mujoco"):
        spec = importlib.util.find_spec(package)
        if spec is not None and spec.origin is not None:
            yield package, Path(spec.origin).parent
    try:
        robots = importlib.metadata.distribution("example-robot-data").locate_file("cmeel.prefix/share/example-robot-data/robots")
    except importlib.metadata.PackageNotFoundError:
        return
    yield "example-robot-data", Path(str(robots))


def _files(folders: dict[str, Path], only: str) -> Iterator[tuple[str, Path]]:
    """Files by set and path below its folder; those names are ASCII in records."""
    for name, folder in folders.items():
        for path in sorted(folder.rglob("*.urdf")):
            below = path.relative_to(folder)
            label = f"{name}/{below.as_posix()}".encode("ascii", "backslashreplace").decode()
            if LEFT_OUT not in below.parts and only in label:
                yield label, path


def figure(folder: Path) -> Path:
    """How far frames are off, and contacts at home with and without an SRDF."""
    return draw(read_all(folder / RECORDS), folder / "urdf-files.png")
