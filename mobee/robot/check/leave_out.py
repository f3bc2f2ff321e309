"""Writes the pairs of links that touch at home, or in every pose, into the SRDF of a URDF."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mobee.errors import InvalidValue, RobotFileError
from mobee.model import Model
from mobee.robot.check.subject import Subject
from mobee.robot.check.touching_pairs import TouchingPair, touching_pairs
from mobee.robot.load import ROBOTS, find_file, load_robot
from mobee.robot.robot import Robot
from mobee.robot.urdf.merge_srdf import disabled_and_enabled, write_disabled
from mobee.robot.urdf.srdf import find_srdf
from mobee.robot.xml_file import is_file
from mobee.robot.xml_node import read_xml


@dataclass(frozen=True, slots=True)
class LeftOut:
    """What was written where, and what still touches at home."""

    path: Path
    merged: bool  # whether the file was there before, or took over the text of another SRDF
    pairs: tuple[TouchingPair, ...]  # new in the file
    enabled: tuple[TouchingPair, ...]  # not written: the file asks for their test
    touching: int  # contacts of solids at home, of the robot as it is now read
    found: bool  # whether load_robot finds the file by itself


def leave_out_touching(urdf: str | Path, out: Path | None = None, **options: Any) -> LeftOut:
    """Write <disable_collisions> for every two links of a URDF whose solids touch at home or in all of many random poses.

    `out`: the SRDF; None: the one that the robot is read with, or a new one beside it.  What is in an SRDF stays, word for word;
    it is written whole or not at all.  `options`: of load_robot.  Raises RobotFileError or InvalidValue where that cannot be done.
    """
    path = find_file(urdf, ROBOTS, "robot")
    if path.suffix.lower() != ".urdf":
        raise InvalidValue(f"{path} is no URDF: in zero-position XML <ignore first= second=> leaves out a pair. Leave out --write-srdf.")
    used = _used(path, options.get("srdf"))
    target = _target(path, out, used, options.get("srdf"))
    base = target if is_file(target) else used
    robot = _read(path, options, base)
    _require_links(robot, path)
    disabled, enabled = disabled_and_enabled(base) if base is not None else (set(), set())
    touching = [pair for pair in touching_pairs(robot) if frozenset((pair.first, pair.second)) not in disabled]
    new = tuple(pair for pair in touching if frozenset((pair.first, pair.second)) not in enabled)
    if new or not is_file(target):
        write_disabled(target, base, robot.name, ((pair.first, pair.second, pair.reason) for pair in new))
    again = _read(path, options, target)
    left = sum(contact.kind == "solid" for contact in Model(again).evaluate(again.home).contacts)
    wanted = tuple(pair for pair in touching if pair not in new)
    return LeftOut(target, base is not None, new, wanted, left, _is_found(path, target))


def _read(path: Path, options: dict[str, Any], srdf: Path | None) -> Robot:
    """The robot; what its reader warns of is for the check to say."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return load_robot(path, **options | {"srdf": srdf})


def _used(path: Path, srdf: str | Path | None) -> Path | None:
    """The SRDF that load_robot reads."""
    if srdf is not None:
        return Path(srdf)
    root = read_xml(path)
    return find_srdf(path, root.optional("name") or path.stem)


def _is_found(path: Path, srdf: Path) -> bool:
    found = _used(path, None)
    return found is not None and found.resolve() == srdf.resolve()


def _target(path: Path, out: Path | None, used: Path | None, srdf: str | Path | None) -> Path:
    target = out or used or path.with_suffix(".srdf")
    if target.suffix.lower() != ".srdf":
        raise InvalidValue(f"{target} is no name for an SRDF. Give one that ends in .srdf.")
    if srdf is not None and is_file(target) and target.resolve() != Path(srdf).resolve():
        raise InvalidValue(
            f"{target} is there already, and the robot is read with {srdf}. Read it with --srdf {target}, or name a new file."
        )
    return target


def _require_links(robot: Robot, path: Path) -> None:
    """Raise where several links stand in one line: lines are all that says which link of the URDF a shape is on."""
    subject = Subject(robot)
    unknown = next((shape for shape in robot.shapes if subject.urdf_link(shape.name) is None), None)
    if unknown is not None:
        line = subject.where("shape", unknown.name)
        raise RobotFileError(f"{line}: several links stand in this line. Put each on lines of its own: xmllint --format {path.name}")
