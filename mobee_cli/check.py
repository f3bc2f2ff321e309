"""`mobee check`: what is wrong with a robot or a world, with the line of each."""

from __future__ import annotations

import argparse
import json
import shutil
import textwrap
from collections import Counter
from dataclasses import asdict
from typing import Any

from mobee.check import Finding, UntestedGroup, check_file, untested_groups
from mobee.check.finding import SEVERITIES, count
from mobee.errors import MobeeError
from mobee.model.world import World
from mobee.model.world_file import load_world
from mobee.robot.robot import Robot
from mobee_cli import check_srdf
from mobee_cli.errors import UserError
from mobee_cli.robot_options import add_urdf_options, urdf_options
from services.common.exit_codes import BAD_INPUT, FAILED

_NOTES = "Exit code: 0 nothing but notes, 1 at least one warning or error, 2 the file cannot be read."


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """File and options."""
    parser.epilog = _NOTES
    parser.add_argument("file", help="shipped robot or world, or path of a .xml or .urdf file")
    parser.add_argument("--world", metavar="FILE", help="also what the robot touches at home in this world")
    add_urdf_options(parser)
    check_srdf.add_arguments(parser)
    parser.add_argument("--pairs", action="store_true", help="list every pair of links that is never tested, and why")
    parser.add_argument("--json", action="store_true", help="print as JSON")


def run(arguments: argparse.Namespace) -> int:
    """Check and print."""
    try:
        world = load_world(arguments.world) if arguments.world else None
        written = check_srdf.write(arguments) if arguments.write_srdf is not None else None
        options = urdf_options(arguments)
        if written is not None and written[2] is not None:
            options["srdf"] = written[2]
        checked = check_file(arguments.file, world, **options)
    except MobeeError as error:
        raise UserError(str(error), BAD_INPUT) from None
    content = checked.content
    groups = untested_groups(content) if isinstance(content, Robot) else []
    if arguments.json:
        told = {"srdf": written[1]} if written is not None else {}
        print(json.dumps(told | _as_json(content, checked.findings, groups), indent=2))
    else:
        said = written[0] if written is not None else []
        lines = [part for line in said for part in ([line] if not line or line.startswith(" ") else _wrapped(line, ""))]
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
    """The summary of what is never tested, or all of it."""
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
    """Which SRDF was read with a URDF, and which of its poses is home."""
    file = robot.where.get(("srdf", robot.name))
    if file is None:
        return []
    poses = [f"its pose {name!r} (line {line.rpartition(':')[2]})" for (kind, name), line in robot.where.items() if kind == "pose"]
    home = poses[0] if poses else "every motor at 0, or as near to it as the zones before its limits let it"
    return _wrapped(f"SRDF: {file.rpartition(':')[0]}. Home: {home}.", "", "  ")


def _masses(robot: Robot) -> list[str]:
    """What the robot weighs."""
    if not robot.bodies:
        return _wrapped("Masses: none. In the torque modality the robot's own weight is not compensated.", "", "  ")
    return [f"Masses: {sum(body.mass for body in robot.bodies):.4g} kg on {count(robot.bodies, 'link')}."]


def _summary(content: Robot | World, findings: tuple[Finding, ...]) -> str:
    counts = Counter(finding.severity for finding in findings)
    said = ", ".join(f"{counts[severity]} {severity}{'' if counts[severity] == 1 else 's'}" for severity in SEVERITIES if counts[severity])
    if isinstance(content, World):
        return f"{count(content.objects, 'object')}: {said or 'nothing is wrong'}"
    held = (count(content.parts, "part"), count(content.motors, "motor"), count(content.joints, "joint"), count(content.shapes, "shape"))
    return f"\n{content.name}: {', '.join(held)}: {said or 'nothing is wrong'}"


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
