# SPDX-License-Identifier: Apache-2.0
"""URDF files by other authors: whether they load, and whether frames and contacts agree with Pinocchio and coal.

Claim: a URDF file by others loads as it is, or is refused with a message that names the line and a remedy.  In every pose the frames of all
links agree with Pinocchio's within 1e-9 (position in m, and elements of the rotation matrix), and, with exact convex hulls of the meshes,
the same pairs of links touch as by the collision library coal.  Source: none; our own aim (docs/robots.md).  Run time: about five minutes
for 181 files.

Without --folders, the files of the packages icub_models, pybullet_data (without random_urdfs), mujoco, robosuite, dm_control and
example-robot-data are compared, as far as these are installed.  The results of each file are written before the next file is compared, and
--resume continues after them.  At the end the table is in the run's folder as urdf-files.md.  Pinocchio reads each file by itself, shapes
and meshes included.
"""

from __future__ import annotations

import argparse
import importlib.metadata
import importlib.util
import sys
import tempfile
from collections.abc import Iterator, Sequence
from math import isnan
from pathlib import Path
from typing import Any

import numpy as np

from experiments.claims.robot_files.urdf_comparison import FileRecord, compare_file
from experiments.kit.command_line import Progress, positive_whole
from experiments.kit.experiment import Experiment, Steps
from experiments.kit.plots import new_figure
from experiments.kit.run_folder import Records, read_records
from mobee.errors import InvalidValue

RECORDS = "urdf-files.csv"
MAX_FRAME_ERROR = 1e-9  # m and 1
SKIPPED_FOLDER = "random_urdfs"  # a thousand small objects
TABLE_HEAD = (
    "file",
    "motors",
    "links",
    "SRDF: home",
    "frame difference",
    "contacts: coal, differ",
    "at home: as loaded, no SRDF",
    "load s",
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command-line options of this experiment to the parser."""
    text = "where to look for *.urdf, as NAME=PATH or PATH (default: packages that are installed)"
    parser.add_argument("--folders", nargs="+", default=[], metavar="DIR", help=text)
    parser.add_argument("--poses", type=positive_whole, default=100, metavar="N", help="random poses of each robot (default: 100)")
    parser.add_argument("--only", default="", metavar="TEXT", help="files with this in their path")


def run(arguments: argparse.Namespace, folder: Path) -> dict[str, Any]:
    """Compare every file that is not in the records in `folder` yet, write the table, and return the results of all files."""
    files = dict(_files(named_folders(arguments.folders), arguments.only))
    if not files:
        raise InvalidValue("there is no .urdf file to compare; name folders with --folders DIR, or install icub-models.")
    path = folder / RECORDS
    done = {one.name for one in read_all(path)}
    with Records(path, FileRecord.columns()) as records, Progress() as progress, tempfile.TemporaryDirectory() as scratch:
        for number, (name, file) in enumerate(files.items()):
            progress.show(number / len(files), name)
            if name not in done:
                records.append(compare_file(name, file, arguments.poses, arguments.seed, Path(scratch)).record())
    found = [one for one in read_all(path) if one.name in files]
    write_table(found, folder / "urdf-files.md")
    return results(found)


def read_all(path: Path) -> list[FileRecord]:
    """Read the records of a run from its CSV file, one for each URDF file; returns an empty list if there is no CSV file."""
    return [FileRecord.of_record(row) for row in read_records(path, FileRecord.columns())]


def results(found: Sequence[FileRecord]) -> dict[str, Any]:
    """Return the results of all files.

    Keys: "sets", dict from the name of a set of files, or "all", to the dict that `numbers` returns for it.  Three dicts from the name of a
    file to a text: "refused", why it was refused or crashed; "contacts_that_differ", how many, and their largest depth [m]; "not_compared",
    why.  "passed", whether no file crashes, frames differ by at most 1e-9 (m, or element of a rotation matrix), and no contact differs.
    """
    sets = {set_name: [one for one in found if one.name.startswith(f"{set_name}/")] for set_name in dict.fromkeys(map(_set_of, found))}
    table = {set_name: numbers(some) for set_name, some in {**sets, "all": list(found)}.items()}
    whole = table["all"]
    passed = whole["crashes"] == 0 and whole["frame_error"] <= MAX_FRAME_ERROR and whole["other_contacts"] == 0
    refused = {one.name: one.message for one in found if one.outcome in ("refused", "crash")}
    other = {one.name: f"{one.other} of {one.contacts}, {one.deepest_other:.2g} m at most" for one in found if one.other > 0}
    apart = {one.name: one.message for one in found if one.outcome == "loads" and one.message}
    return {"passed": passed, "sets": table, "refused": refused, "contacts_that_differ": other, "not_compared": apart}


def _set_of(one: FileRecord) -> str:
    return one.name.partition("/")[0]


def named_folders(given: Sequence[str]) -> dict[str, Path]:
    """Return a dict from the name of a set of files to the folder in which to look for them.

    `given`: texts NAME=PATH or PATH; if empty, the installed packages are used.  Raises InvalidValue for a folder that does not exist.
    """
    if not given:
        return dict(_installed())
    folders: dict[str, Path] = {}
    for text in given:
        name, _, path = text.rpartition("=")
        if not Path(path).is_dir():
            raise InvalidValue(f"{path}: there is no such folder. Give one that holds robot files.")
        folders[name or Path(path).resolve().name] = Path(path)
    return folders


def _installed() -> Iterator[tuple[str, Path]]:
    yield "icub_models", Path(sys.prefix) / "share" / "iCub" / "robots"
    for package, inner in (("pybullet_data", ""), ("mujoco", ""), ("robosuite", "models/assets/robots"), ("dm_control", "suite")):
        spec = importlib.util.find_spec(package)
        if spec is not None and spec.origin is not None:
            yield package, Path(spec.origin).parent / inner
    try:
        robots = importlib.metadata.distribution("example-robot-data").locate_file("cmeel.prefix/share/example-robot-data/robots")
    except importlib.metadata.PackageNotFoundError:
        return
    yield "example-robot-data", Path(str(robots))


def _files(folders: dict[str, Path], only: str) -> Iterator[tuple[str, Path]]:
    """Yield a label and the path of every URDF file in `folders`, which are given by name; files in SKIPPED_FOLDER are left out.

    The label is the folder's name, "/" and the path below the folder, in ASCII.  `only`: text that the label must contain.
    """
    for name, folder in folders.items():
        for path in sorted(folder.rglob("*.urdf")):
            below = path.relative_to(folder)
            label = f"{name}/{below.as_posix()}".encode("ascii", "backslashreplace").decode()
            if SKIPPED_FOLDER not in below.parts and only in label:
                yield label, path


def figure(folder: Path) -> Path:
    """Draw the frame errors, and the contacts at home with and without an SRDF, to a file in `folder`; returns its path.

    Files are sorted by value in each panel.
    """
    found, path = read_all(folder / RECORDS), folder / "urdf-files.png"
    loaded = [one for one in found if one.outcome == "loads"]
    drawing = new_figure(9.0, 3.5)
    left, right = drawing.subplots(1, 2)
    errors = np.sort([one.frame_error for one in loaded if not np.isnan(one.frame_error)])
    left.semilogy(np.maximum(errors, 1e-17), ".", color="C0")
    left.axhline(MAX_FRAME_ERROR, color="0.5", linestyle="--", label="allowed")
    left.set(xlabel="files", ylabel="largest frame difference from Pinocchio")
    left.legend()
    for label, counts in (("without an SRDF", [one.at_home_without for one in loaded]), ("as loaded", [one.at_home for one in loaded])):
        right.plot(-np.sort(-np.array(counts, dtype=int)), ".-", label=label)
    right.set(xlabel="files", ylabel="solid contacts at home", yscale="symlog")
    right.legend()
    drawing.savefig(path, dpi=150)
    return path


def numbers(found: Sequence[FileRecord]) -> dict[str, Any]:
    """Summarise the given files: return counts of files, links and contacts, the largest frame error, and times to load [s].

    Main keys: "load", "things" (no joint moves), "refused" and "crashes", numbers of files; "links", number of links whose frames were
    compared; "contacts", number of contacts by the collision library coal; "other_contacts", number of those that only coal or only this
    library finds; "touch_at_home", number of robots with contacts at home.
    """
    loaded = [one for one in found if one.outcome == "loads"]
    compared = [one for one in loaded if one.contacts >= 0]
    seconds = sorted(one.seconds for one in loaded)
    return {
        "files": len(found),
        "things": sum(one.outcome == "thing" for one in found),
        "refused": sum(one.outcome == "refused" for one in found),
        "crashes": sum(one.outcome == "crash" for one in found),
        "load": len(loaded),
        "links": sum(one.links for one in loaded if one.links >= 0),
        "frame_error": max((one.frame_error for one in loaded if not isnan(one.frame_error)), default=0.0),
        "compared_with_coal": len(compared),
        "contacts": sum(one.contacts for one in compared),
        "other_contacts": sum(one.other for one in compared),
        "srdf_found": sum(bool(one.srdf) for one in loaded),
        "touch_at_home": sum(one.at_home > 0 for one in loaded),
        "touch_at_home_without_srdf": sum(one.at_home_without > 0 for one in loaded),
        "load_median_s": round(seconds[len(seconds) // 2], 3) if seconds else 0.0,
        "load_most_s": round(max(seconds, default=0.0), 2),
    }


def write_table(found: Sequence[FileRecord], path: Path) -> None:
    """Write a Markdown table with a line per file to `path`.

    First come files that load, then those that are refused, then those without a moving joint.
    """
    loads, refused, without_joints = (
        [one for one in found if one.outcome in kinds] for kinds in (("loads",), ("refused", "crash"), ("thing",))
    )
    lines = [_row(TABLE_HEAD), _row(["---"] * len(TABLE_HEAD)), *(_row(_cells(one)) for one in loads)]
    lines += ["", _row(("refused", "why")), _row(("---", "---")), *(_row((one.name, one.message)) for one in refused)]
    lines += ["", f"Without a moving joint ({len(without_joints)}): {', '.join(one.name for one in without_joints)}."]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _row(cells: Sequence[str]) -> str:
    return f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in cells)} |"


def _cells(one: FileRecord) -> tuple[str, ...]:
    srdf = f"{one.srdf}: {one.home or 'zero'}" if one.srdf else ""
    frames = "" if isnan(one.frame_error) else f"{one.frame_error:.0e}"
    contacts = f"{one.contacts}, {one.other}" if one.contacts >= 0 else one.message
    return (
        one.name, str(one.motors), str(max(one.links, 0) or ""), srdf, frames, contacts, f"{one.at_home}, {one.at_home_without}",
        f"{one.seconds:.2f}",
    )  # fmt: skip


EXPERIMENT = Experiment(
    claim="URDFs of others load or are refused with a remedy; links are Pinocchio's within 1e-9, contacts coal's",
    source="our own aim, docs/robots.md",
    method=Steps(add_arguments, run, figure),
)
