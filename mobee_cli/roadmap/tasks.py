"""Lists the shipped tasks."""

from __future__ import annotations

import argparse
import json

NOTES = "`mobee roadmap build TASK` builds the map of one. They need the robot icub."


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """None."""


def run(arguments: argparse.Namespace) -> int:
    """List them."""
    from experiments.claims.ch3_roadmaps.trm_tasks import EXAMPLES
    from mobee_cli.roadmap.text import wrapped

    found = [(name, make()) for name, make in EXAMPLES.items()]
    if arguments.json:
        told = [
            {
                "task": name,
                "robot": one.model.robot.name,
                "figure": one.figure,
                "title": one.title,
                "coordinates": list(one.task.names),
            }
            for name, one in found
        ]
        print(json.dumps(told, indent=2))
        return 0
    for name, one in found:
        print(f"{name:<17} {one.figure:<16} {one.title:<16} {_short(one.task.names, 28)}")
    robots = ", ".join(sorted({one.model.robot.name for _, one in found}))
    text = f"All of them need the robot {robots}. `mobee roadmap build FILE.py --robot ROBOT` builds a task of your own: docs/roadmaps.md."
    print("\n".join(["", *wrapped(text)]))
    return 0


def _short(names: tuple[str, ...], room: int) -> str:
    """The names, as many as there is room for."""
    whole, kept = ", ".join(names), list(names)
    while len(whole) > room and len(kept) > 1:
        kept.pop()
        whole = f"{', '.join(kept)}, ..."
    return whole[:room]
