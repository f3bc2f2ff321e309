# SPDX-License-Identifier: Apache-2.0
"""Originals: whether this library reads the robot and world files of 2010 to 2014 as the programs of that time did.

Claim: at least 95 % of the distinct files in the public histories of kailfrank/MoBeE and Juxi/icVision load as they are.  Positions,
normals of markers, motor limits, tested pairs of volumes, clauses (constraints on several joints) and contacts are those that the program
of 2014 computes.  That program is not run: program_2014.py implements its rules again, after its source code.  Source: kailfrank/MoBeE
(2014), Juxi/icVision (2010 to 2013); thesis 2.3.1.
Run time: three minutes with 20 poses a file.

The files are not part of this project.  Fetch the two repositories, and give the folder that holds them:

    mobee experiment run originals --checkouts FOLDER

`--poses 2000 --only icub_928d` compares one file in many poses.  Contacts are computed by coal, which comes with the extra `dev`.
"""

from __future__ import annotations

import argparse
import re
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Any

from experiments.claims.robot_files.original_files import Original, find_originals
from experiments.kit.command_line import Progress, positive_whole
from experiments.kit.experiment import Experiment, Steps
from experiments.kit.run_folder import Records, read_records
from mobee.check import check_file
from mobee.errors import InvalidValue, MobeeError
from mobee.model.model import Model
from mobee.model.pose import Pose
from mobee.model.world import World
from mobee.model.world_file import load_world
from mobee.rendering.sheet import Panel, pictures_of, write_sheet
from mobee.rendering.solid import Solid, object_solids, robot_solids
from mobee.robot.load import load_robot
from mobee.robot.robot import Robot

if TYPE_CHECKING:
    from experiments.claims.robot_files.original_comparison import Comparison

MIN_SHARE = 0.95  # of the files must load
RECORDS, TABLE = "originals.csv", "originals.md"
COLUMNS = ("kind", "date", "file", "hash", "loads", "read_as", "motors", "shapes", "poses", "contacts", "place", "agrees")
HEADINGS = ("first seen", "file", "Git hash", "motors", "shapes or objects", "read as, or why not", "poses, contacts", "agree")

# Of the figure.
ICUB, VIRTUAL_SKIN, WORLD = "2014-11-14_icub_9*.xml", "2011-07-21_icub_*.xml", "2014-11-14_world_*.xml"
FIELD_COLOR = (0.35, 0.55, 0.85)
FIELD_OPACITY = 0.22
HEIGHT = 460  # pixels
VIEW = (-40.0, 20.0)  # deg


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command-line options of this experiment to the parser."""
    parser.add_argument(
        "--checkouts", nargs="+", type=Path, required=True, metavar="FOLDER", help="folders with the repositories, or with the files"
    )
    parser.add_argument("--poses", type=positive_whole, default=20, metavar="N", help="random poses a robot (default: 20)")
    parser.add_argument("--only", default="", metavar="TEXT", help="only files whose names contain this, such as 2014-11 or icub_928d")


def run(arguments: argparse.Namespace, folder: Path) -> dict[str, Any]:
    """Load every file, compare each robot with its reading by the rules of MoBeE of 2014, and write the table.

    `program_2014` reads a file by these rules, which follow the program's source.  Files that the records in `folder` contain already are
    skipped.  Returns the results.  Raises InvalidValue if no file is found.
    """
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
                records.append(_row_of(original, path, arguments.poses, arguments.seed))
            progress.show((index + 1) / len(originals), original.name)
    return results(folder)


def results(folder: Path) -> dict[str, Any]:
    """Write the table of the run in `folder`, and return the counts of its files.

    Keys: "files", "robots" and "load", numbers of files; "share", of files that load; "compared", number of robots that this
    library and `program_2014` have both read; "agree", number of those for which the results agree; "poses" and "contacts", numbers of
    poses and of contacts, summed over the compared robots; "table", path of the table; "passed", whether at least 95 % of the files load
    and all compared robots agree.  Raises InvalidValue if no file was read yet.
    """
    rows = read_records(folder / RECORDS, COLUMNS)
    if not rows:
        raise InvalidValue(f"{folder} has no record of a file: continue the run with --resume.")
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
        "passed": share >= MIN_SHARE and agree,
    }


def _row_of(original: Original, path: Path, poses: int, seed: int) -> dict[str, str]:
    """Load an original file, compare it with its reading by the rules of MoBeE of 2014, and return its row of the table.

    `poses`: number of random poses in which the contacts of both readings are compared.  `seed`: of the poses.
    """
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
        except ValueError as error:  # the volumes differ
            return row | {"poses": "0", "contacts": "0", "agrees": f"no: {error}"}
    agrees = "yes" if found.agrees else f"no: {found}"
    return row | {"poses": str(poses), "contacts": str(found.all_contacts), "place": f"{found.position_error:.1e}", "agrees": agrees}


def _compare(path: Path, robot: Robot, poses: int, seed: int) -> Comparison:
    try:
        from experiments.claims.robot_files.original_comparison import compare
    except ImportError:
        raise InvalidValue('coal, which computes the contacts, is not installed: pip install "mobee[dev]".') from None
    return compare(path, robot, poses, seed)


def _read_as(path: Path) -> str:
    """Return the programs (names and years) for which the file was written, as a note of `mobee check` names them; "" without a note."""
    notes = [finding.what for finding in check_file(path).findings if finding.check == "older-version"]
    note = next((text for text in notes if text.startswith("read as")), "")
    return note.removeprefix("read as a file of ").removeprefix("read as a world of ").split(", for ")[0].split(": <")[0]


def write_table(rows: list[dict[str, str]], path: Path) -> None:
    """Write the rows as a Markdown table to `path`, first robots, then worlds.  `rows`: dicts with COLUMNS as keys."""
    lines = [f"| {' | '.join(HEADINGS)} |\n", "|---" * len(HEADINGS) + "|\n"]
    for row in sorted(rows, key=lambda one: (one["kind"], one["date"], one["file"], one["hash"])):
        compared = f"{row['poses']}, {row['contacts']}" if row["poses"] else ""
        read_as = row["read_as"] if row["loads"] == "yes" else f"**refused**: {row['read_as']}"
        cells = (row["date"], row["file"], row["hash"][:10], row["motors"], row["shapes"], read_as, compared, row["agrees"])
        lines.append("| " + " | ".join(cell.replace("|", "/") for cell in cells) + " |\n")
    path.write_text("".join(lines), encoding="utf-8")


def figure(folder: Path) -> Path:
    """Draw the iCubs of MoBeE (2014) and of VirtualSkin (2011), the Katana and the table world to a file in `folder`; returns its path.

    VirtualSkin is the predecessor of MoBeE.  Raises InvalidValue if one of the robot or world files is missing.
    """
    files, path = folder / "files", folder / "originals.png"
    icub, skin = _robot(files, ICUB), _robot(files, VIRTUAL_SKIN)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        world = load_world(_first_match(files, WORLD))
    panels = [
        _panel(icub, World(), "icub.xml, MoBeE 2014: solids and fields at home"),
        _panel(skin, World(), "icub.xml, VirtualSkin 2011: solids at home"),
        _panel(load_robot("katana"), World(), "the Katana of the thesis, appendix B"),
        _panel(icub, world, "world.xml, MoBeE 2014: table, target, cylinder"),
    ]
    return write_sheet([("", panels[:2]), ("", panels[2:])], path)


def _panel(robot: Robot, world: World, caption: str) -> Panel:
    pose = Model(robot, world).evaluate(robot.home)
    solids = [*robot_solids(pose), *object_solids(world.objects), *(_fields(pose) if not world.objects else [])]
    (picture,) = pictures_of([solids], VIEW, HEIGHT)
    return Panel(picture, caption)


def _fields(pose: Pose) -> list[Solid]:
    """Return the fields of a robot as transparent volumes, without those that extend far below the robot."""
    found = []
    for shape in pose.robot.shapes:
        if shape.role == "field" and max(shape.size) < 0.5:
            link = pose.transforms[shape.link]
            place, turn = link[:3, :3] @ shape.position + link[:3, 3], link[:3, :3] @ shape.rotation
            found.append(Solid(shape.kind, shape.size, place, turn, FIELD_COLOR, FIELD_OPACITY, group=-3))
    return found


def _robot(files: Path, pattern: str) -> Robot:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return load_robot(_first_match(files, pattern))


def _first_match(files: Path, pattern: str) -> Path:
    found = sorted(files.glob(pattern))
    if not found:
        raise InvalidValue(f"{files} holds no {pattern}: run the experiment on all files first, without --only.")
    return found[0]


EXPERIMENT = Experiment(
    claim="robot and world files of 2010 to 2014 load, and mean what the program of 2014 took them to mean",
    source="kailfrank/MoBeE (2014), Juxi/icVision (2010 to 2013); thesis 2.3.1",
    method=Steps(add_arguments, run, figure),
)
