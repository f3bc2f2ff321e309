"""How the search went, and what the worst try looked like."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np

from experiments.clauses.search import CLAUSES, Search, load
from experiments.control.arm_command import from_numbers
from experiments.control.arm_try import ARMS, try_commands
from experiments.control.colors import COLORS
from experiments.control.margins import clause_label, clause_violations
from experiments.control.models import icub_at_table
from experiments.control.ride import GAINS
from experiments.kit.plots import new_figure
from mobee import Gains
from mobee.errors import InvalidValue

TERMS = re.compile(r"(?<!or)(?<!>) (?=or |[+-][\d.]+ [a-z])")  # where a line of a clause ends
DASHES = {False: "-", True: ":"}


def draw(folder: Path) -> Path:
    """Three panels: worst so far against tries, worst of each clause, the worst tries over time."""
    kept = [folder / f"{gains}-{kind}.json" for gains in GAINS for kind in ("attractors", "forced")]
    states = [load(path) for path in kept if path.exists()]
    if not states:
        raise InvalidValue(f"{folder} has no search in it: it was stopped before the first hundred tries.")
    drawing = new_figure(14.0, 4.6)
    course, clauses, over_time = drawing.subplots(1, 3, width_ratios=(1.0, 1.35, 1.0))
    for number, state in enumerate(states):
        style: dict[str, Any] = {"color": COLORS[state.gains], "linestyle": DASHES[state.forced]}
        label = f"{state.gains}{', client pushes' if state.forced else ''}"
        course.plot(*np.transpose(state.course), label=label, **style)
        places = np.arange(CLAUSES) + 0.2 * (number - (len(states) - 1) / 2)
        face = "none" if state.forced else COLORS[state.gains]
        clauses.barh(places, np.array(state.by_clause) + 60.0, 0.18, left=-60.0, facecolor=face, edgecolor=COLORS[state.gains])
        times, violation = _replay(state)
        over_time.plot(times, violation, **style)
    for line in (course.axhline, clauses.axvline, over_time.axhline):
        line(0.0, color="0.3", linewidth=0.8)
        line(2.0, color="tab:red", linewidth=0.8, linestyle="--")
    course.set(xlabel="tries", ylabel="largest violation so far [deg along the normal]", title="The search")
    course.legend(fontsize=7)
    labels = [TERMS.sub("\n", clause_label(icub_at_table().robot, i)) for i in range(CLAUSES)]
    clauses.set_yticks(range(CLAUSES), labels, fontsize=6)
    farthest = max(12.0, *(state.worst + 2.0 for state in states))
    clauses.set(xlabel="largest violation [deg], red: allowed", title="By clause (open bars: client pushes)", xlim=(-60.0, farthest))
    over_time.set(xlabel="time [s]", ylabel="violation [deg]", title="The worst tries", ylim=(-40.0, None))
    for axes in (course, clauses, over_time):
        axes.grid(alpha=0.2)
    path = folder / "clauses.png"
    drawing.savefig(path, dpi=150)
    return path


def _replay(state: Search) -> tuple[Any, Any]:
    """The worst try again: times, and the violation of its clause [deg]."""
    known: dict[str, Any] = state.worst_try
    commands = [from_numbers(numbers) for numbers in known["commands"]]
    trial = try_commands(Gains.named(state.gains), commands, np.array(known["torso"]), known["seed"])
    column = known["arm"] * (len(icub_at_table().robot.clauses) // len(ARMS)) + known["clause"]
    return trial.ride.times, np.rad2deg(clause_violations(icub_at_table().robot, trial.ride.q)[:, column])
