# SPDX-License-Identifier: Apache-2.0
"""`mobee check`: reports faults of a robot or world file, with line numbers."""

from __future__ import annotations

import argparse
import json
import shutil
import textwrap
import warnings
from collections import Counter
from dataclasses import asdict
from pathlib import Path
from typing import Any

from mobee.check import Finding, UntestedGroup, check_file, untested_groups
from mobee.check.interface import SEVERITIES, count, length
from mobee.check.touching import POSES, LeftOut, TouchingPair, leave_out_touching, touching_pairs
from mobee.errors import MobeeError
from mobee.model.world import World
from mobee.model.world_file import load_world
from mobee.robot.load import ROBOTS, find_file, load_robot
from mobee.robot.mjcf.compiled import is_mjcf
from mobee.robot.robot import Robot
from mobee_cli.errors import UserError
from mobee_cli.robot_options import add_urdf_options, urdf_options
from services.common.exit_codes import BAD_INPUT, FAILED

_NOTES = "Exit code: 0 no warnings or errors, 1 at least one of them, 2 the file cannot be\nread."
_SRDF_COLUMNS = ("link1", "link2", "reason", "at home", "random poses")
FEW = 0.5  # of the random poses: a pair that touches in fewer may be a true collision


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `mobee check` to the parser: the file and others."""
    parser.epilog = _NOTES
    parser.add_argument("file", help="shipped robot or world, or path of a .xml, .urdf or MJCF file")
    parser.add_argument("--world", metavar="FILE", help="also check what the robot touches at home in this world")
    add_urdf_options(parser)
    parser.add_argument(
        "--write-srdf",
        nargs="?",
        const="",
        metavar="OUT",
        help="first write the pairs of links whose solids touch at home, or in all of many random poses, to the SRDF of a URDF: to OUT, "
        "to the SRDF that is read, or to a new one beside the URDF; its other content is kept. For an XML file: print the lines to add",
    )
    parser.add_argument("--pairs", action="store_true", help="list every pair of links that is never tested, and why")
    parser.add_argument("--json", action="store_true", help="print as JSON")


def run(arguments: argparse.Namespace) -> int:
    """Run `mobee check`: check a robot or world file, print the findings, and return the exit code (0: at most notes, 1: a fault)."""
    try:
        world = load_world(arguments.world) if arguments.world else None
        written = _write_srdf(arguments) if arguments.write_srdf is not None else None
        options = urdf_options(arguments)
        if written is not None and written[2] is not None:
            options["srdf"] = written[2]
        checked = check_file(arguments.file, world, **options)
    except MobeeError as error:
        raise UserError(str(error), BAD_INPUT) from None
    content = checked.content
    groups = untested_groups(content) if isinstance(content, Robot) else []
    if arguments.json:
        extra = {"srdf": written[1]} if written is not None else {}
        print(json.dumps(extra | _as_json(content, checked.findings, groups), indent=2))
    else:
        report = written[0] if written is not None else []
        lines = [part for line in report for part in ([line] if not line or line.startswith(" ") else _wrapped(line, ""))]
        lines += _findings(checked.findings)
        if isinstance(content, Robot):
            lines += [*_pairs(content, groups, arguments.pairs), *_srdf(content), *_masses(content)]
        print("\n".join([*lines, _summary(content, checked.findings)]))
    return FAILED if any(finding.severity != "note" for finding in checked.findings) else 0


def _findings(findings: tuple[Finding, ...]) -> list[str]:
    lines = []
    for finding in findings:
        lines.append(f"{finding.where}: {finding.severity}: {finding.what}")
        for text in (finding.why, finding.remedy):
            lines += _wrapped(text, "    ") if text else []
    return lines


def _pairs(robot: Robot, groups: list[UntestedGroup], every: bool) -> list[str]:
    """Return a summary of the pairs that are never tested, or all of them."""
    tested = f"{count(robot.solid_pairs, 'pair')} of solids, {len(robot.field_pairs)} of fields"
    lines = ["", f"Tested: {tested}. Never tested{'' if every else ' (--pairs names them)'}:"]
    kinds: dict[str, list[UntestedGroup]] = {}
    for group in groups:
        kinds.setdefault(group.reason if every else group.kind, []).append(group)
    for title, alike in kinds.items():
        links = [link for group in alike for link in group.links]
        shapes = f"{sum(group.solids for group in alike)} of solids, {sum(group.fields for group in alike)} of fields"
        lines += _wrapped(f"{alike[0].reason if len(alike) == 1 else title}: {count(links, 'pair')} of links ({shapes})", "  ", "    ")
        if every:
            lines += _wrapped(", ".join(one if one == other else f"{one} - {other}" for one, other in links), "    ")
    return lines


def _srdf(robot: Robot) -> list[str]:
    """Return a text, as lines, that names the SRDF file that was read with a URDF and says which pose is home; [] without an SRDF."""
    file = robot.where.get(("srdf", robot.name))
    if file is None:
        return []
    poses = [f"its pose {name!r} (line {line.rpartition(':')[2]})" for (kind, name), line in robot.where.items() if kind == "pose"]
    home = poses[0] if poses else "every motor at 0, or as near to 0 as the zones before its limits allow"
    return _wrapped(f"SRDF: {file.rpartition(':')[0]}. Home: {home}.", "", "  ")


def _masses(robot: Robot) -> list[str]:
    """Return the mass of the robot."""
    if not robot.bodies:
        return _wrapped("Masses: none. In the torque modality gravity is not compensated.", "", "  ")
    return [f"Masses: {sum(body.mass for body in robot.bodies):.4g} kg on {count(robot.bodies, 'link')}."]


def _summary(content: Robot | World, findings: tuple[Finding, ...]) -> str:
    counts = Counter(finding.severity for finding in findings)
    found = [f"{counts[severity]} {severity}{'' if counts[severity] == 1 else 's'}" for severity in SEVERITIES if counts[severity]]
    summary = ", ".join(found)
    if isinstance(content, World):
        return f"{count(content.objects, 'object')}: {summary or 'nothing is wrong'}"
    held = (count(content.parts, "part"), count(content.motors, "motor"), count(content.joints, "joint"), count(content.shapes, "shape"))
    return f"\n{content.name}: {', '.join(held)}: {summary or 'nothing is wrong'}"


def _wrapped(text: str, indent: str, then: str | None = None) -> list[str]:
    columns = shutil.get_terminal_size().columns  # 80 in a pipe
    after = indent if then is None else then
    return textwrap.wrap(text, columns, initial_indent=indent, subsequent_indent=after, break_long_words=False, break_on_hyphens=False)


def _as_json(content: Robot | World, findings: tuple[Finding, ...], groups: list[UntestedGroup]) -> dict[str, Any]:
    listed: dict[str, Any] = {"findings": [asdict(finding) for finding in findings]}
    if isinstance(content, Robot):
        tested = {"solid_pairs": len(content.solid_pairs), "field_pairs": len(content.field_pairs)}
        mass = sum(body.mass for body in content.bodies)
        listed |= {"robot": content.name, "mass": mass, "tested": tested, "untested": [asdict(group) for group in groups]}
    return listed


def _write_srdf(arguments: argparse.Namespace) -> tuple[list[str], dict[str, Any], Path | None]:
    """Write the pairs of links that touch at home or in all random poses into the SRDF of a URDF, so that they are not tested.

    For another robot file the pairs are only listed. Returns the report as lines and as JSON data, and the path of the SRDF with which the
    robot is read, None without one.
    """
    path = find_file(arguments.file, ROBOTS, "robot")
    if path.suffix.lower() != ".urdf":
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # the findings repeat what the reader says
            pairs = touching_pairs(load_robot(path))
        return _ignores(pairs, is_mjcf(path)), {"pairs": [asdict(pair) for pair in pairs]}, None
    out = Path(arguments.write_srdf) if arguments.write_srdf else None
    done = leave_out_touching(path, out, **urdf_options(arguments))
    result = asdict(done) | {"path": str(done.path)}
    return _written(path, done), result, done.path


def _written(path: Path, done: LeftOut) -> list[str]:
    lines = [_title(done), *_table(done.pairs)]
    for pair in done.enabled:
        lines.append(f"Not written: {pair.first} - {pair.second}, because <enable_collisions> of that file requests its test.")
    few = [pair for pair in done.pairs if pair.share < FEW]
    if few:
        lines.append(
            f"Check the {count(few, 'pair')} that {'touches' if len(few) == 1 else 'touch'} in less than half of the random poses: "
            "from now on collisions of these links are not detected. If home is wrong, correct home and remove the line."
        )
    found = f"load_robot finds {done.path.name} by its name" if done.found else f'read it with srdf="{done.path}", or --srdf {done.path}'
    at_home = "does not touch itself" if not done.touching else f"still touches itself at {count(range(done.touching), 'place')}"
    return [*lines, f"With it {path.name} {at_home} at home; {found}.", ""]


def _title(done: LeftOut) -> str:
    if not done.pairs:
        return f"{done.path}: nothing to add; no other links touch at home or in all of {POSES} random poses."
    kept = ", which keeps what it had" if done.merged else ""
    return f"{done.path}: wrote {count(done.pairs, 'pair')} of links that touch at home or in all of {POSES} random poses{kept}."


def _ignores(pairs: tuple[TouchingPair, ...], mjcf: bool) -> list[str]:
    """Return a report with the XML lines that exclude pairs from the tests for contact, for the user to add to a robot file.

    The file is an MJCF, or one in the zero-position format (mobee's own).
    """
    if not pairs:
        return [f"No links touch at home or in all of {POSES} random poses.", ""]
    if mjcf:
        lines = [f' <exclude body1="{pair.first}" body2="{pair.second}"/>' for pair in pairs]
        return ["An MJCF has no SRDF. To exclude these pairs, add these lines to its <contact>:", *lines, "", *_table(pairs), ""]
    lines = [f' <ignore first="{pair.first}" second="{pair.second}"/>' for pair in pairs]
    return ["A zero-position file has no SRDF. To exclude these pairs, add these lines below its root:", *lines, "", *_table(pairs), ""]


def _table(pairs: tuple[TouchingPair, ...]) -> list[str]:
    if not pairs:
        return []
    rows = [_SRDF_COLUMNS, *((p.first, p.second, p.reason, length(p.depth) if p.depth else "-", f"{100.0 * p.share:.4g} %") for p in pairs)]
    widths = [max(len(row[column]) for row in rows) for column in range(len(_SRDF_COLUMNS))]
    return ["  " + "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows]
