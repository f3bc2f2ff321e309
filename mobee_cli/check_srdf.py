"""`mobee check FILE --write-srdf`: what was written, pair by pair."""

from __future__ import annotations

import argparse
from dataclasses import asdict
from pathlib import Path
from typing import Any

from mobee.check.finding import count, length
from mobee.check.touching import POSES, LeftOut, TouchingPair, leave_out_touching, touching_pairs
from mobee.robot.load import ROBOTS, find_file, load_robot
from mobee_cli.robot_options import urdf_options

FEW = 0.5  # of the random poses: a pair that touches in less may collide in earnest
_HEADS = ("link1", "link2", "reason", "at home", "random poses")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The option."""
    parser.add_argument(
        "--write-srdf",
        nargs="?",
        const="",
        metavar="OUT",
        help="first write the pairs of links whose solids touch at home, or in all of many random poses, into the SRDF of a URDF: OUT, "
        "the one it is read with, or a new one beside it; what is in an SRDF stays. Of an XML file: print the lines for it",
    )


def write(arguments: argparse.Namespace) -> tuple[list[str], dict[str, Any], Path | None]:
    """Do it; the lines that say so, the same for JSON, and the SRDF to read the robot with."""
    path = find_file(arguments.file, ROBOTS, "robot")
    if path.suffix.lower() != ".urdf":
        pairs = touching_pairs(load_robot(path))
        return _ignores(pairs), {"pairs": [asdict(pair) for pair in pairs]}, None
    out = Path(arguments.write_srdf) if arguments.write_srdf else None
    done = leave_out_touching(path, out, **urdf_options(arguments))
    told = asdict(done) | {"path": str(done.path)}
    return _written(path, done), told, done.path


def _written(path: Path, done: LeftOut) -> list[str]:
    lines = [_title(done), *_table(done.pairs)]
    for pair in done.enabled:
        lines.append(f"Not written: {pair.first} - {pair.second}, for <enable_collisions> of that file asks for its test.")
    few = [pair for pair in done.pairs if pair.share < FEW]
    if few:
        lines.append(
            f"Look at the {count(few, 'pair')} that {'touches' if len(few) == 1 else 'touch'} in less than half of the random poses: "
            "from now on nothing notices when these links collide. Where home is wrong, correct home and remove the line."
        )
    found = f"load_robot finds {done.path.name} by itself" if done.found else f'read it with srdf="{done.path}", or --srdf {done.path}'
    at_home = "does not touch itself" if not done.touching else f"still touches itself at {count(range(done.touching), 'place')}"
    return [*lines, f"With it {path.name} {at_home} at home; {found}.", ""]


def _title(done: LeftOut) -> str:
    if not done.pairs:
        return f"{done.path}: nothing to add; no other links touch at home or in all of {POSES} random poses."
    kept = ", which keeps what it had" if done.merged else ""
    return f"{done.path}: wrote {count(done.pairs, 'pair')} of links that touch at home or in all of {POSES} random poses{kept}."


def _ignores(pairs: tuple[TouchingPair, ...]) -> list[str]:
    """What to write into a zero-position file."""
    if not pairs:
        return [f"No links touch at home or in all of {POSES} random poses.", ""]
    lines = [f' <ignore first="{pair.first}" second="{pair.second}"/>' for pair in pairs]
    return ["A zero-position file has no SRDF. To leave these pairs out, put these lines below its root:", *lines, "", *_table(pairs), ""]


def _table(pairs: tuple[TouchingPair, ...]) -> list[str]:
    if not pairs:
        return []
    rows = [_HEADS, *((p.first, p.second, p.reason, length(p.depth) if p.depth else "-", f"{100.0 * p.share:.4g} %") for p in pairs)]
    widths = [max(len(row[column]) for row in rows) for column in range(len(_HEADS))]
    return ["  " + "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows]
