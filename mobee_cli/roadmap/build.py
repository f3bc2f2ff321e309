"""Builds a roadmap: poses that satisfy a task's costs, spread over its task space and joined to a graph."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

from experiments.kit.command_line import Progress
from mobee import Model
from mobee.roadmap.ik.ngik import METHODS
from mobee_cli.errors import UserError
from mobee_cli.robot_options import add_robot, add_world, given_options, robot_given, world_given
from services.common.exit_codes import BAD_INPUT, INTERRUPTED

NOTES = """The map is on disk every 10 s: after Ctrl-C, or a crash, the same command goes
on with it. A file of other settings, or of another robot or world, is refused.
A task of your own is a Python file with a function example(), or example(model),
which is given the robot of --robot in the world of --world: docs/roadmaps.md.
The tasks that come with mobee need the icub."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """What, how, where to."""
    parser.add_argument(
        "task", metavar="TASK|FILE.py", help="a task that comes with mobee, or a file of your own; `mobee roadmap tasks` lists them"
    )
    add_robot(parser, "of a task file; default: the icub")
    add_world(parser)
    parser.add_argument("-o", "--output", type=Path, metavar="MAP.npz", help="where to (default: TASK.npz, here)")
    parser.add_argument("--method", choices=METHODS, default="hybrid", help="how poses are found (default: %(default)s)")
    parser.add_argument("--seed", type=int, default=0, metavar="N", help="of all that is drawn (default: 0)")
    text = "join each pose to so many nearest (default: as many as the task has coordinates, those found before it)"
    parser.add_argument("--neighbours", type=int, metavar="K", help=text)
    text = "no edge along which a motor turns by more; 0: no limit (default: %(default)g)"
    parser.add_argument("--longest", type=float, default=0.4, metavar="RAD", help=text)


def run(arguments: argparse.Namespace) -> int:
    """Build, or go on; tell what came of it."""
    from mobee_cli.roadmap.task_file import task_named
    from mobee_cli.roadmap.text import as_json, summary

    example = task_named(arguments.task, given_options(arguments), lambda: Model(robot_given(arguments), world_given(arguments)))
    path: Path = arguments.output or Path(f"{Path(arguments.task).stem}.npz")
    if not path.resolve().parent.is_dir():
        raise UserError(f"--output {path}: there is no folder {path.resolve().parent}: make it", BAD_INPUT)
    trm = _built(example, path, arguments)
    print(json.dumps(as_json(trm, path), indent=2) if arguments.json else "\n".join(summary(trm, path)))
    return 0


def _built(example: Any, path: Path, arguments: argparse.Namespace) -> Any:
    from experiments.kit.roadmap_task import build

    known = "nothing"
    with Progress() as bar:

        def show(now: Any) -> None:
            nonlocal known
            known = f"{now.vertices} vertices, {now.open} open, {now.evaluations} evaluations, {now.seconds:.0f} s"
            bar.show(1.0 - now.open / max(now.vertices, 1), known)

        try:
            return build(
                example, arguments.method, arguments.seed, path, show, neighbours=arguments.neighbours, longest=arguments.longest or None
            )
        except KeyboardInterrupt:
            if not path.exists():
                raise
            raise UserError(f"interrupted at {known}. {path} holds them; the same command goes on with it.", INTERRUPTED) from None
