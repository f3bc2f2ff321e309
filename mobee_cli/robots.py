"""`mobee robots`: what comes with mobee."""

from __future__ import annotations

import argparse
import json

from mobee.robot.load import load_robot, shipped_robots, shipped_worlds


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options."""
    parser.add_argument("--json", action="store_true", help="print as JSON")


def run(arguments: argparse.Namespace) -> int:
    """Print the robots with their parts, and the worlds."""
    robots = {name: {part: list(body.motors) for part, body in load_robot(name).parts.items()} for name in shipped_robots()}
    if arguments.json:
        print(json.dumps({"robots": robots, "worlds": shipped_worlds()}, indent=2))
        return 0
    for name, parts in robots.items():
        counts = ", ".join(f"{part} {len(motors)}" for part, motors in parts.items())
        print(f"{name:<12} {sum(map(len, parts.values()))} motors: {counts}")
    print(f"worlds: {', '.join(shipped_worlds())}")
    return 0
