# SPDX-License-Identifier: Apache-2.0
"""Constraint violations: a search for the arm command that violates most the constraints of shoulder cables and forearm.

Claim: with the default gains no attractors (poses to which the control law pulls the arm) carry an arm more than 2 degrees beyond a
constraint on several joints.  The attractors may be inside or far outside the motors' ranges, held or in any sequence.  A constraint holds
if at least one of its inequalities a.q + b > 0 holds; the distance beyond an inequality is measured along its normal, -(a.q + b)/|a|.  The
fastest impact of a motor at a hard stop is reported too.  Source: this project's goal; the constraints are those of thesis 5.2.5.
Published: no number; the thesis says of positional constraints that their forces may grow without bound, "but this never happens in
practice".  Run time: 10 000 tries for both gain sets and 2000 with forces of a client, a few minutes.

A try is one command of one arm: a start, three attractors, and the duration of each attractor.  A forced try has in addition, for each
attractor, a force in configuration space and one at the palm.  Both arms try at once while the torso moves to a random posture, with a
table in front of the robot; the motors have the parameters `MotorParameters()`.  The first 30 % of the tries are random; each of the others
varies and combines commands from the worst so far for a clause (constraint).  The forced tries are not part of the claim: there a client
pushes with the largest force.
"""

from __future__ import annotations

import argparse
import re
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from experiments.kit.command_line import positive_whole
from experiments.kit.control.arm_commands import ARMS, Command, Tried, as_numbers, from_numbers, random_command, try_commands, vary
from experiments.kit.control.measures import clause_label, clause_violations
from experiments.kit.control.plant_runs import COLORS, GAINS, icub_at_table
from experiments.kit.experiment import Experiment
from experiments.kit.plots import new_figure
from experiments.kit.sweep import Cells, Condition, Sweep
from mobee import Gains
from mobee.arrays import Array

ALLOWED = 2.0  # degrees along the normal, default gains, without forces of a client
KINDS = ("attractors", "forced")
QUICK_TRIES = 300

RANDOM_SHARE = 0.3  # of the tries
GENERATION = 100  # tries with one random generator
KEPT = 8  # worst commands kept for each clause
CLAUSES = 7  # of an arm

TERMS = re.compile(r"(?<!or)(?<!>) (?=or |[+-][\d.]+ [a-z])")  # line breaks in the text of a clause
DASHES = {False: "-", True: ":"}


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the options --gains, --tries and --forced-tries to the parser."""
    parser.add_argument("--gains", nargs="+", choices=GAINS, default=list(GAINS), metavar="SET", help=f"of {', '.join(GAINS)}")
    parser.add_argument("--tries", type=positive_whole, default=10_000, metavar="N", help="tries per gain set (default: 10000)")
    parser.add_argument("--forced-tries", type=positive_whole, default=2_000, metavar="N", help="with forces of a client (default: 2000)")


def conditions(arguments: argparse.Namespace) -> list[Condition]:
    """Return the conditions of the sweep: each gain set, without and with forces of a client."""
    found = []
    for gains in arguments.gains:
        for kind, given in zip(KINDS, (arguments.tries, arguments.forced_tries), strict=True):
            tries = min(given, QUICK_TRIES) if arguments.quick else given
            found.append(Condition(f"{gains}-{kind}", {"gains": gains, "forced": kind == "forced", "tries": tries}, float(tries)))
    return found


@dataclass
class Search:
    """The state of a search for the largest violation of a constraint, a clause on several joints of an arm.

    A violation is the distance beyond the constraint in degrees, along its normal, negative inside; the attributes have the largest
    violations so far.  A generation is a group of up to 100 tries that are drawn in the same manner.  `gains`: name of the gain set.
    `forced`: whether a client of the controller also applies forces to the arms.  `seed`: of the tries.  `tries`: number so far.  `worst`:
    largest violation.  `by_clause`: largest violation of each clause of an arm.  `stop`: fastest impact of a joint at a hard stop [deg/s].
    `course`: pairs of the number of tries and the largest violation so far.  `inside`: largest violation in each generation, only from
    tries whose attractors (the commanded postures) are all within the motors' ranges; -360 if the generation has no such try.  `random`:
    largest violation in each generation of random tries.  Both lists begin with an additional -360.  `elite`: for each clause, a list of
    the worst commands (at most 8), worst first, as pairs of the violation and the command as numbers.  `worst_try`: commands, torso
    posture, seed, arm and clause of the worst try, to repeat it.
    """

    gains: str
    forced: bool
    seed: int
    tries: int = 0
    worst: float = -360.0
    stop: float = 0.0
    by_clause: list[float] = field(default_factory=lambda: [-360.0] * CLAUSES)
    course: list[tuple[int, float]] = field(default_factory=list)
    inside: list[float] = field(default_factory=lambda: [-360.0])
    random: list[float] = field(default_factory=lambda: [-360.0])
    elite: list[list[tuple[float, list[float]]]] = field(default_factory=lambda: [[] for _ in range(CLAUSES)])
    worst_try: dict[str, list[float] | list[list[float]] | int] = field(default_factory=dict)


def trial(settings: dict[str, Any], seed: int) -> dict[str, Any]:
    """Run one search, and return its final state as a dict with the fields of `Search`.

    `settings`: "gains", "forced" and "tries", the arguments of `search`.  `seed`: of the random commands.
    """
    return asdict(search(settings["gains"], settings["forced"], settings["tries"], seed))


def search(gains: str, forced: bool, tries: int, seed: int) -> Search:
    """Search for large violations: first by random tries, then by variations of the worst commands of each clause.

    `gains`: name of the gain set.  `forced`: whether a client of the controller also applies forces to the arms.  `tries`: number of tries
    to make.  A simulated run makes two tries, one with each arm; if the number is odd, the last run counts only for the left arm.  `seed`:
    of the random commands.  Returns the final state.
    """
    state, numbers = Search(gains, forced, seed), Gains.named(gains)
    while state.tries < tries:
        rng = np.random.default_rng([seed, forced, state.tries])
        is_random = state.tries < RANDOM_SHARE * tries
        state.inside.append(-360.0)
        if is_random:
            state.random.append(-360.0)
        for _ in range(min(GENERATION, tries - state.tries + 1) // len(ARMS)):
            commands = [random_command(rng, forced) if is_random else _next(rng, state) for _ in ARMS]
            torso, noise = rng.uniform(-1.0, 1.0, 3), int(rng.integers(2**31))
            counted = min(len(ARMS), tries - state.tries)
            _record(state, try_commands(numbers, commands, torso, noise), commands, torso.tolist(), noise, is_random, counted)
        state.course.append((state.tries, state.worst))
    return state


def _next(rng: np.random.Generator, state: Search) -> Command:
    """Return a new command: a random variation of one of the commands (at most 8) with the largest violations of a clause so far.

    The clause is, with probability 1/2, the one with the largest violation, and else a random one.
    """
    clause = int(np.argmax(state.by_clause)) if rng.random() < 0.5 else int(rng.integers(CLAUSES))
    known = state.elite[clause]
    one, other = (known[int(rng.integers(len(known)))][1] for _ in range(2))
    return vary(rng, from_numbers(one), from_numbers(other))


def _record(state: Search, tried: Tried, commands: list[Command], torso: list[float], seed: int, is_random: bool, counted: int) -> None:
    """Add the tries of one run, which are those of the first `counted` arms, to the state of the search."""
    violations = np.rad2deg(tried.violations)
    for arm, command in enumerate(commands[:counted]):
        state.tries += 1
        numbers = as_numbers(command)
        for clause, value in enumerate(violations[arm].tolist()):
            state.by_clause[clause] = max(state.by_clause[clause], value)
            known = state.elite[clause]
            if len(known) < KEPT or value > known[-1][0]:
                known.append((value, numbers))
                known.sort(key=lambda entry: -entry[0])
                del known[KEPT:]
        worst = float(violations[arm].max())
        if worst > state.worst:
            state.worst = worst
            both = [as_numbers(each) for each in commands]
            state.worst_try = {"commands": both, "torso": torso, "seed": seed, "arm": arm, "clause": int(violations[arm].argmax())}
        if command.is_inside:
            state.inside[-1] = max(state.inside[-1], worst)
        if is_random:
            state.random[-1] = max(state.random[-1], worst)
    state.stop = max(state.stop, float(np.rad2deg(tried.stop[:counted].max())))


def findings(found: Cells) -> dict[str, Any]:
    """Return the results as a dict from the gain set to a dict with "attractors" (no forces of a client) and "forced", and "passed".

    "attractors" and "forced" are dicts with the largest violations of a search, in degrees along the normal of a constraint, negative
    inside; of the searches with several seeds the worst is taken.  "allowed_deg": the bound, 2 degrees.  "passed": whether the largest
    violation with the default gains and without forces is below the bound; None if this search was not run.
    """
    table: dict[str, Any] = {}
    for state in sorted(_searches(found), key=lambda state: state.worst):
        table.setdefault(state.gains, {})[KINDS[state.forced]] = _summary(state)
    judged = [table["default"]["attractors"]] if "attractors" in table.get("default", {}) else []
    passed = all(part["largest_violation_deg"] < ALLOWED for part in judged) if judged else None  # the claim is about the default gains
    return {"passed": passed, "allowed_deg": ALLOWED, **table}


def _summary(state: Search) -> dict[str, Any]:
    robot = icub_at_table().robot
    return {
        "tries": state.tries,
        "largest_violation_deg": round(state.worst, 3),
        "largest_with_attractors_inside_the_joint_box_deg": round(max(state.inside), 3),
        "largest_of_random_tries_deg": round(max(state.random), 3),
        "fastest_into_a_stop_deg_s": round(state.stop, 2),
        "by_clause_deg": {clause_label(robot, i): round(value, 3) for i, value in enumerate(state.by_clause)},
    }


def _searches(found: Cells) -> list[Search]:
    """Return the finished searches (each for the motion that violates a clause most), sorted by their set of gains.

    Of one set, the searches without forces of a client program come first.
    """
    states = [Search(**result.values) for result in found.values()]
    return sorted(states, key=lambda state: (GAINS.index(state.gains), state.forced, state.seed))


def plot(found: Cells) -> Any:
    """Return a figure with three panels: the largest violation over the tries and by clause, and the violation during the worst tries."""
    states = _searches(found)
    drawing = new_figure(14.0, 4.6)
    course, clauses, over_time = drawing.subplots(1, 3, width_ratios=(1.0, 1.35, 1.0))
    for number, state in enumerate(states):
        style: dict[str, Any] = {"color": COLORS[state.gains], "linestyle": DASHES[state.forced]}
        label = f"{state.gains}{', client pushes' if state.forced else ''}"
        course.plot(*np.transpose(state.course), label=label, **style)
        places = np.arange(CLAUSES) + 0.2 * (number - (len(states) - 1) / 2)
        face = "none" if state.forced else COLORS[state.gains]
        clauses.barh(places, np.array(state.by_clause) + 60.0, 0.18, left=-60.0, facecolor=face, edgecolor=COLORS[state.gains])
        over_time.plot(*_repeat(state), **style)
    for line in (course.axhline, clauses.axvline, over_time.axhline):
        line(0.0, color="0.3", linewidth=0.8)
        line(ALLOWED, color="tab:red", linewidth=0.8, linestyle="--")
    course.set(xlabel="tries", ylabel="largest violation so far [deg along the normal]", title="The search")
    course.legend(fontsize=7)
    labels = [TERMS.sub("\n", clause_label(icub_at_table().robot, i)) for i in range(CLAUSES)]
    clauses.set_yticks(range(CLAUSES), labels, fontsize=6)
    farthest = max(12.0, *(state.worst + 2.0 for state in states))
    clauses.set(xlabel="largest violation [deg], red: allowed", title="By clause (open bars: client pushes)", xlim=(-60.0, farthest))
    over_time.set(xlabel="time [s]", ylabel="violation [deg]", title="The worst tries", ylim=(-40.0, None))
    for axes in (course, clauses, over_time):
        axes.grid(alpha=0.2)
    return drawing


def _repeat(state: Search) -> tuple[Array, Array]:
    """Repeat the worst try; returns times [s], and the violation of its clause [deg]."""
    known: dict[str, Any] = state.worst_try
    commands = [from_numbers(numbers) for numbers in known["commands"]]
    tried = try_commands(Gains.named(state.gains), commands, np.array(known["torso"]), known["seed"])
    column = known["arm"] * (len(icub_at_table().robot.clauses) // len(ARMS)) + known["clause"]
    return tried.run.times, np.rad2deg(clause_violations(icub_at_table().robot, tried.run.q)[:, column])


EXPERIMENT = Experiment(
    claim="no command carries an arm more than 2 degrees beyond its cable rows and forearm clauses",
    source="thesis 5.2.5, eqs. 5.14-5.17",
    method=Sweep(conditions, trial, findings, plot, seeds=1, add_options=add_options),
)
