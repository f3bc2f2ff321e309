"""Do the cable rows and the forearm clauses hold, whatever is commanded?  A search for the worst command.

Claim: with the default gains no attractors, inside or far outside the joint box, held or in any sequence, carry an arm more than
2 degrees beyond a constraint (-s/|a|, along the normal).  How fast a motor meets its hard stop, if one does, is told beside it.
Source: this project's goal; the constraints are those of thesis 5.2.5.  Published: no number; the thesis says of positional constraints
that their forces may grow without bound, "but this never happens in practice".  Run time: 10 000 tries for both gain sets
and 2000 with forces of a client, a few minutes.

A try is one arm's command: a start, three attractors, how long each is in force, and, in the part called "forced", a force in
configuration space and one at the palm with each.  Both arms try at once, the torso is sent somewhere, a table stands in front,
the motors are those of the published findings.  The first part of the tries is random; the rest varies and crosses the worst so
far of every clause.  The forced tries are no part of the claim: there the client pushes with all that it may.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np

from experiments.clauses.figure import draw
from experiments.clauses.search import Search, keep, load, search
from experiments.control.margins import clause_label
from experiments.control.ride import GAINS
from experiments.kit.options import positive_whole
from experiments.kit.progress import Progress
from mobee import load_robot

NAME = "clauses"
CLAIM = "no command carries an arm more than 2 degrees beyond its cable rows and forearm clauses"
SOURCE = "thesis 5.2.5, eqs. 5.14-5.17"

ALLOWED = 2.0  # degrees along the normal, default gains, without forces of a client


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options."""
    parser.add_argument("--gains", nargs="+", choices=GAINS, default=list(GAINS), metavar="SET", help=f"of {', '.join(GAINS)}")
    parser.add_argument("--tries", type=positive_whole, default=10_000, metavar="N", help="a gain set (default: 10000)")
    parser.add_argument("--forced-tries", type=positive_whole, default=2_000, metavar="N", help="with forces of a client (default: 2000)")


def run(arguments: argparse.Namespace, folder: Path) -> dict[str, Any]:
    """Search for the worst command of each gain set, without and with forces of a client."""
    found: dict[str, Any] = {}
    with Progress() as progress:
        for gains in arguments.gains:
            for kind, tries in (("attractors", arguments.tries), ("forced", arguments.forced_tries)):
                path = folder / f"{gains}-{kind}.json"
                state = load(path) if path.exists() else Search(gains, kind == "forced", arguments.seed)
                for _ in search(state, tries):
                    keep(path, state)
                    progress.show(state.tries / tries, f"{gains}, {kind}: worst {state.worst:.2f} degrees after {state.tries} tries")
                found.setdefault(gains, {})[kind] = results(state)
    held = [found[gains]["attractors"] for gains in found if gains == "default"]
    passed = all(part["largest_violation_deg"] < ALLOWED for part in held) if held else None  # the claim is about the default gains
    return {"passed": passed, "allowed_deg": ALLOWED, **found}


def results(state: Search) -> dict[str, Any]:
    """What a search has come to; violations in degrees along the normal, negative inside."""
    robot = load_robot("icub")
    return {
        "tries": state.tries,
        "largest_violation_deg": round(state.worst, 3),
        "largest_with_attractors_inside_the_joint_box_deg": round(max(state.inside), 3),
        "largest_of_random_tries_deg": round(max(state.random), 3),
        "fastest_into_a_stop_deg_s": round(state.stop, 2),
        "by_clause_deg": {clause_label(robot, i): round(float(v), 3) for i, v in enumerate(np.array(state.by_clause))},
    }


def figure(folder: Path) -> Path:
    """The course of the searches and the worst tries."""
    return draw(folder)
