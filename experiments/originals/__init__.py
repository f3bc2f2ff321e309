"""Originals: does this library read the robot and world files of 2010 to 2014 as the programs of that time read them?

Claim: at least 95 % of the distinct files in the public histories of kailfrank/MoBeE and Juxi/icVision load as they are, and what is read
is what the program of 2014 read: places, normals, limits, pairs, clauses and contacts, by a second reading of its source (program_2014.py).
Source: kailfrank/MoBeE (2014), Juxi/icVision (2010 to 2013); thesis 2.3.1.  Run time: three minutes with 20 poses a file.

The files are not part of this project. Fetch the two repositories, and give the folder that holds them:

    mobee experiment run originals --checkouts FOLDER

`--poses 2000 --only icub_928d` compares one file in many poses.  Contacts are judged by coal, which comes with the extra `dev`.
"""

from __future__ import annotations

import argparse
import re
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Any

from experiments.kit.command_line import Progress, positive_whole
from experiments.kit.records import Records, read_records
from experiments.originals.checkouts import Original, find_originals
from experiments.originals.table import COLUMNS, RECORDS, TABLE, write_table
from mobee.check import check_file
from mobee.errors import InvalidValue, MobeeError
from mobee.model.world_file import load_world
from mobee.robot.load import load_robot
from mobee.robot.robot import Robot

if TYPE_CHECKING:
    from experiments.originals.compare import Comparison

NAME = "originals"
CLAIM = "robot and world files of 2010 to 2014 load, and mean what the program of 2014 took them to mean"
SOURCE = "kailfrank/MoBeE (2014), Juxi/icVision (2010 to 2013); thesis 2.3.1"
ENOUGH = 0.95  # of the files


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options."""
    parser.add_argument(
        "--checkouts", nargs="+", type=Path, required=True, metavar="FOLDER", help="with the repositories, or with the files"
    )
    parser.add_argument("--poses", type=positive_whole, default=20, metavar="N", help="random poses a robot (default: 20)")
    parser.add_argument("--only", default="", metavar="TEXT", help="only files whose name holds this, such as 2014-11 or icub_928d")


def run(arguments: argparse.Namespace, folder: Path) -> dict[str, Any]:
    """Load every file, compare every robot with the program's reading, and write the table."""
    originals = [one for one in find_originals(arguments.checkouts) if arguments.only in one.name]
    if not originals:
        raise InvalidValue(f"no file of 2010 to 2014 is below {', '.join(map(str, arguments.checkouts))}, or none matches --only.")
    files = folder / "files"
    files.mkdir(exist_ok=True)
    done = {row["hash"] for row in read_records(folder / RECORDS, COLUMNS)}
    with Records(folder / RECORDS, COLUMNS) as records, Progress() as progress:
        for index, original in enumerate(originals):
            if original.hash not in done:
                path = files / f"{original.name}.xml"
                path.write_bytes(original.content)
                records.append(_look(original, path, arguments.poses, arguments.seed))
            progress.show((index + 1) / len(originals), original.name)
    return results(folder)


def results(folder: Path) -> dict[str, Any]:
    """How many files load and agree, and the table."""
    rows = read_records(folder / RECORDS, COLUMNS)
    write_table(rows, folder / TABLE)
    loaded = [row for row in rows if row["loads"] == "yes"]
    compared = [row for row in loaded if row["agrees"]]
    share = len(loaded) / len(rows)
    agree = all(row["agrees"] == "yes" for row in compared)
    return {
        "files": len(rows),
        "robots": sum(row["kind"] == "robot" for row in rows),
        "load": len(loaded),
        "share": round(share, 4),
        "compared": len(compared),
        "poses": sum(int(row["poses"]) for row in compared),
        "contacts": sum(int(row["contacts"]) for row in compared),
        "agree": sum(row["agrees"] == "yes" for row in compared),
        "table": str(folder / TABLE),
        "passed": share >= ENOUGH and agree,
    }


def _look(original: Original, path: Path, poses: int, seed: int) -> dict[str, str]:
    """One row of the table."""
    row = dict.fromkeys(COLUMNS, "") | {"kind": original.kind, "hash": original.hash, "date": original.date}
    row |= {"file": f"{original.repository}: {original.path}"}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            if original.kind == "world":
                return row | {"loads": "yes", "shapes": str(len(load_world(path).objects)), "read_as": _read_as(path)}
            robot = load_robot(path)
        except MobeeError as error:
            return row | {"loads": "no", "read_as": re.sub(r"^.*?\.xml:", "line ", str(error))}
        row |= {"loads": "yes", "motors": str(len(robot.motors)), "shapes": str(len(robot.shapes)), "read_as": _read_as(path)}
        if b"<branch" in original.content:  # another program
            return row
        try:
            found = _compare(path, robot, poses, seed)
        except ValueError as error:  # not even the volumes are the same
            return row | {"poses": "0", "contacts": "0", "agrees": f"no: {error}"}
    agrees = "yes" if found.agrees else f"no: {found}"
    return row | {"poses": str(poses), "contacts": str(found.seen), "place": f"{found.place:.1e}", "agrees": agrees}


def _compare(path: Path, robot: Robot, poses: int, seed: int) -> Comparison:
    try:
        from experiments.originals.compare import compare
    except ImportError:
        raise InvalidValue('coal, which judges contacts, is not installed: pip install "mobee[dev]".') from None
    return compare(path, robot, poses, seed)


def _read_as(path: Path) -> str:
    """The generation that the file was taken for."""
    notes = [finding.what for finding in check_file(path).findings if finding.check == "older-version"]
    said = next((note for note in notes if note.startswith("read as")), "")
    return said.removeprefix("read as a file of ").removeprefix("read as a world of ").split(", for ")[0].split(": <")[0]


def figure(folder: Path) -> Path:
    """The iCub of 2014, VirtualSkin's iCub, the Katana and the table world as the files draw them."""
    from experiments.originals.figure import draw

    return draw(folder / "files", folder / "originals.png")
