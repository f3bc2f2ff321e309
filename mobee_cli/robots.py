# SPDX-License-Identifier: Apache-2.0
"""`mobee robots`: lists the shipped robots and worlds."""

from __future__ import annotations

import argparse
import json
import re
import shutil
import textwrap
from collections import Counter
from typing import Any

from mobee.model.world_file import WORLDS, load_world, shipped_worlds
from mobee.robot.load import ROBOTS, load_robot, shipped_robots

_README = "README.md"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `mobee robots` to the parser."""
    parser.add_argument("--json", action="store_true", help="print as JSON")


def run(arguments: argparse.Namespace) -> int:
    """Run `mobee robots`: print the shipped robots with their parts and shapes, the worlds, and their sources and licences.

    Returns the exit code.
    """
    text = (ROBOTS / _README).read_text()
    listed = {
        "robots": {name: _robot(name, text) for name in shipped_robots()},
        "worlds": {name: _world(name, (WORLDS / _README).read_text()) for name in shipped_worlds()},
        "licences": _section(text, "Licences"),
        "readme": [str(folder / _README) for folder in (ROBOTS, WORLDS)],
    }
    print(json.dumps(listed, indent=2) if arguments.json else _as_text(listed))
    return 0


def _robot(name: str, readme: str) -> dict[str, Any]:
    robot = load_robot(name)
    roles = Counter(shape.role for shape in robot.shapes)
    return {
        "parts": {part: list(body.motors) for part, body in robot.parts.items()},
        "counts": {
            "joints": len(robot.joints),
            "solids": roles["solid"],
            "fields": roles["field"],
            "markers": len(robot.markers),
            "constraints": len(robot.clauses),
            "masses": len(robot.bodies),
        },
        "about": _row(readme, name),
        "file": str(ROBOTS / f"{name}.xml"),
    }


def _world(name: str, readme: str) -> dict[str, Any]:
    objects = {one.name: one.role for one in load_world(name).objects.values()}
    return {"objects": objects, "about": _row(readme, name), "file": str(WORLDS / f"{name}.xml")}


def _row(readme: str, name: str) -> str:
    """Return the row of a file in the README's table."""
    found = re.search(rf"^\| `{re.escape(name)}\.xml` \| (.*?) \|$", readme, re.MULTILINE)
    return _plain(found[1]) if found else ""


def _section(readme: str, title: str) -> str:
    found = re.search(rf"^## {title}\n(.*?)(?=^## |\Z)", readme, re.MULTILINE | re.DOTALL)
    return _plain(found[1]) if found else ""


def _plain(markdown: str) -> str:
    """Remove marks and line breaks from Markdown; a link becomes its text."""
    return " ".join(re.sub(r"\[([^]]*)\]\([^)]*\)", r"\1", markdown).replace("`", "").replace("**", "").split())


def _as_text(listed: dict[str, Any]) -> str:
    lines = []
    for name, robot in listed["robots"].items():
        parts = ", ".join(f"{part} {len(motors)}" for part, motors in robot["parts"].items())
        lines += _entry(name, f"{sum(map(len, robot['parts'].values()))} motors: {parts}")
        lines += _entry("", ", ".join(f"{count} {what}" for what, count in robot["counts"].items() if count))
        lines += _entry("", robot["about"])
    lines += ["", "Worlds"]
    for name, world in listed["worlds"].items():
        lines += _entry(name, ", ".join(f"{one} ({role})" for one, role in world["objects"].items()))
    lines += [
        "",
        *_entry("Licences", listed["licences"]),
        "",
        "Grammar and origin of every number:",
        *(f"  {path}" for path in listed["readme"]),
    ]
    return "\n".join(lines)


def _entry(name: str, text: str) -> list[str]:
    columns = shutil.get_terminal_size().columns  # 80 in a pipe
    return textwrap.wrap(text, columns, initial_indent=f"{name:<12} ", subsequent_indent=" " * 13, break_on_hyphens=False)
