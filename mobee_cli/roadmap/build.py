# SPDX-License-Identifier: Apache-2.0
"""`mobee roadmap build`: builds a roadmap, a graph of poses for a task.

Each pose is within the tolerances of the task's cost functions. The poses are spread over the task space.
"""

from __future__ import annotations

import argparse
import json
import math
from pathlib import Path
from typing import Any

from experiments.kit.command_line import Progress
from mobee import Model
from mobee.roadmap.ik.solve import METHODS
from mobee_cli.errors import UserError
from mobee_cli.robot_options import add_robot, add_world, given_options, robot_given, world_given
from services.common.exit_codes import BAD_INPUT, INTERRUPTED

DESCRIPTION = """Build a roadmap: poses that satisfy a task's costs, spread over its task space
and joined by edges."""
NOTES = """The roadmap is saved every 10 s: after Ctrl-C or a crash, the same command
resumes. A file of other settings, or of another robot or world, is refused.
Your own task is a Python file with a function example(), or example(model):
then it gets the robot of --robot in the world of --world; see docs/roadmaps.md.
The shipped tasks need the icub."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `mobee roadmap build` to the parser: task, method, file and others."""
    parser.add_argument("task", metavar="TASK|FILE.py", help="a shipped task, see `mobee roadmap tasks`, or your own file")
    add_robot(parser, "for a task file; default: icub")
    add_world(parser)
    parser.add_argument("-o", "--output", type=Path, metavar="MAP.npz", help="file to write (default: TASK.npz)")
    parser.add_argument("--method", choices=METHODS, default="hybrid", help="how poses are found (default: %(default)s)")
    parser.add_argument("--seed", type=int, default=0, metavar="N", help="seed of the random numbers (default: 0)")
    text = "join each pose to its K nearest (default: to as many earlier ones as the task has coordinates)"
    parser.add_argument("--neighbours", type=int, metavar="K", help=text)
    text = "largest turn of a motor along an edge; 0: no limit (default: %(default)g)"
    parser.add_argument("--longest", type=float, default=0.4, metavar="RAD", help=text)


def run(arguments: argparse.Namespace) -> int:
    """Run `mobee roadmap build`: build the roadmap or resume an unfinished one, print its description, and return the exit code."""
    from mobee_cli.roadmap.map_file import as_json, summary
    from mobee_cli.roadmap.tasks import task_named

    if not 0.0 <= arguments.longest < math.inf:
        raise UserError(f"--longest {arguments.longest:g}: must be finite and above 0, or 0 for no limit", BAD_INPUT)
    example = task_named(arguments.task, given_options(arguments), lambda: Model(robot_given(arguments), world_given(arguments)))
    path: Path = arguments.output or Path(f"{Path(arguments.task).stem}.npz")
    if not path.resolve().parent.is_dir():
        raise UserError(f"--output {path}: there is no folder {path.resolve().parent}: create it", BAD_INPUT)
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
            text = f"interrupted at {known}. {path} holds all but the last seconds of it; the same command resumes."
            raise UserError(text, INTERRUPTED) from None
