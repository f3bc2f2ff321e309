# SPDX-License-Identifier: Apache-2.0
"""Change one parameter of the plant at a time, and measure whether the findings about the shoulder's cables remain.

Claim: on the lattice of rank 4 (four levels of each joint) four states are never reached, and four others hardly ever; three actions whose
goals are among these others end one pitch level higher.  On rank 3 the actions 15->24, 42->51 and 69->78 fail and 21->24 succeeds.  The
parameters of the 2014 program reproduce these findings.  They depend on the cable forces and on the thresholds below which an action has
settled, and not on delay, lag, backlash or a little noise.
Source: thesis 7.2.5, 7.3 (the findings); the study is ours.  Published number: none.  Run time: 15 minutes on 2 cores.

The left arm explores with curiosity: 5000 actions on rank 4 (levels at 20-80 % of the ranges) and 3000 on rank 3 (25-75 %).  In each
variant one parameter is changed; the name of the variant has its published value in brackets.  The findings of rank 4 are reproduced if the
four states are never reached, the other four at most 4 times each on average, all other states are reached, and at least 90 % of the tries
of the three deflected actions end one pitch level higher.  The findings of rank 3 are reproduced if 15->24, 42->51 and 69->78 fail in at
least half of their tries, and 21->24 in at most 10 %.
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np

from experiments.claims.ch7_learning.constraint_discovery import FAILING
from experiments.claims.ch7_learning.unreachable_states import DEFLECTED_TO, HARDLY, NEVER
from experiments.kit.experiment import OUR_AIM, Experiment, Measured, claim, judged
from experiments.kit.learning.arm import DT, LEFT, RANK3, RANK4, arm_space, robot
from experiments.kit.learning.exploration import begin_anywhere, newest
from experiments.kit.learning.outcomes import ends_of, in_order, outcome_counts, visits_of
from experiments.kit.plots import new_figure
from experiments.kit.rules import all_hold, is_above, texts
from experiments.kit.sweep import Cells, Condition, Sweep, grouped
from mobee import CuriousAgent, Gains, Lattice, Model, MotorParameters, OfflinePlant
from mobee.arrays import Ints
from mobee.robot.robot import Robot

LEVELS = {"rank4": RANK4, "rank3": RANK3}
ACTIONS = {"rank4": 5_000, "rank3": 3_000}
QUICK = 0.1  # share of the transitions in the short version
ENTERING = (21, 24)
MAX_RARE_VISITS = 4.0  # mean visits of each of the hardly reached states in 5000 actions; the published 10 are of 14 597
MIN_DEFLECTED, MIN_FAILING = 0.9, 0.5  # shares of tries


@dataclass(frozen=True)
class Variant:
    """A plant of the left arm that differs from the published one in some parameters.

    `gains`, `settle`, `motors`: changed fields of the gains, of their settle test (it ends an action) and of the motor parameters, by name.
    `dt`: control period [s].  `gain_set`, `motor_set`, `robot`: functions that return the gains, the motor parameters and the robot before
    these changes.
    """

    gains: dict[str, Any] = field(default_factory=dict)
    settle: dict[str, float] = field(default_factory=dict)
    motors: dict[str, float] = field(default_factory=dict)
    dt: float = DT
    gain_set: Callable[[], Gains] = Gains.published_2014
    motor_set: Callable[[], MotorParameters] = MotorParameters
    robot: Callable[[], Robot] = robot

    def plant(self, seed: int) -> OfflinePlant:
        """Return an offline plant in which the four motors of the left arm move.

        `seed`: of the plant.
        """
        gains = self.gain_set()
        gains = replace(gains, **self.gains, settle=replace(gains.settle, **self.settle))
        motors = replace(self.motor_set(), **self.motors)
        return OfflinePlant(Model(self.robot()), seed, gains, motors, self.dt, active=LEFT)


def normalised() -> Robot:
    """Return the published robot with cable constraints scaled to unit normals, so that a.q + b is a distance in rad."""
    clauses = []
    for clause in robot().clauses:
        length = np.linalg.norm(clause.a, axis=1)
        clauses.append(replace(clause, a=clause.a / length[:, None], b=clause.b / length))
    return replace(robot(), clauses=tuple(clauses))


Changes = dict[str, dict[str, Any]]  # arguments of a Variant, by the text of the changed value


def _degrees(place: str, name: str, *values: float) -> Changes:
    return {f"{value:g}": {place: {name: float(np.deg2rad(value))}} for value in values}


def _plain(place: str, name: str, *values: float) -> Changes:
    return {f"{value:g}": {place: {name: value}} for value in values}


_OLDER = {"stiffness": 20.0, "max_spring": float(np.deg2rad(800.0)), "max_constraint": float(np.deg2rad(1600.0))}
_CHANGED: dict[str, Changes] = {
    "encoder noise, deg (0.1)": _degrees("motors", "encoder_noise", 0.0, 0.05, 0.2, 0.4),
    "motor delay, s (0.02)": _plain("motors", "delay", 0.0, 0.06),
    "motor lag, s (0.05)": _plain("motors", "lag", 0.0, 0.15),
    "backlash, deg (0.2)": _degrees("motors", "backlash", 0.0, 0.5),
    "friction, deg/s (0)": _degrees("motors", "friction", 0.5),
    "cable zone, row units (40)": _degrees("gains", "constraint_width", 10.0, 20.0, 30.0, 50.0),
    "cable force, deg/s^2 (1500)": _degrees("gains", "max_constraint", 1000.0, 1300.0, 1700.0, 2500.0),
    "damping, 1/s (50)": _plain("gains", "damping", 14.0, 20.0, 35.0),
    "spring stiffness, 1/s^2 (50)": _plain("gains", "stiffness", 25.0, 100.0),
    "spring maximum, deg/s^2 (1000)": _degrees("gains", "max_spring", 800.0, 1500.0),
    "settle speed, deg/s (1)": _degrees("settle", "speed", 0.2, 0.6, 1.2, 2.0),
    "settle acceleration, deg/s^2 (50)": _degrees("settle", "acceleration", 25.0, 100.0),
    "first settle test, s (1)": _plain("settle", "first_check", 0.2, 3.0),
    "limit ramp, deg (10)": _degrees("gains", "limit_width", 5.0),
    "control period, s (0.02)": {"0.01": {"dt": 0.01}, "0.005": {"dt": 0.005}},
    "cable zone, degrees along the normals": {
        f"{width:g}": {"robot": normalised, "gains": {"constraint_width": float(np.deg2rad(width))}} for width in (10.0, 20.0, 40.0)
    },
}
MOTORS = ("encoder noise, deg (0.1): 0.05", "encoder noise, deg (0.1): 0.2", "motor delay", "motor lag", "backlash")  # prefixes

PUBLISHED = "as published"
VARIANTS: dict[str, Variant] = {
    PUBLISHED: Variant(),
    **{f"{name}: {value}": Variant(**change) for name, changes in _CHANGED.items() for value, change in changes.items()},
    "older arm: spring 20 and 800, cable force 1600": Variant(gains=_OLDER),
    "motors without lag, delay, backlash, noise": Variant(motor_set=MotorParameters.ideal),
    "motors as identified on the simulated robot": Variant(motor_set=lambda: MotorParameters.identified("icub")),
    "our default gains": Variant(gain_set=Gains.default),
}


def conditions(arguments: argparse.Namespace) -> list[Condition]:
    """Return the settings of the runs: one for each variant of the plant.

    With --quick the runs have a tenth of the transitions.
    """
    share, name = (QUICK, "quick-") if arguments.quick else (1.0, "")
    return [Condition(f"{name}{number:02d}", {"variant": variant, "share": share}) for number, variant in enumerate(VARIANTS)]


def trial(settings: dict[str, Any], seed: int) -> dict[str, Any]:
    """Explore both lattices with the plant of one variant.

    Returns the transitions (T, 3) on each lattice, `rank4` and `rank3`; `timeouts`, the share of actions that timed out; and `seconds`, the
    mean plant time of an action [s].  `settings`: "variant", a key of VARIANTS; "share", the number of actions over the usual number.
    `seed`: of agent and plant.
    """
    values: dict[str, Any] = {}
    settled, durations = [], []
    for lattice, levels in LEVELS.items():
        space, plant = arm_space(levels), VARIANTS[settings["variant"]].plant(seed)
        begin_anywhere(space, plant, seed)
        agent, seen = CuriousAgent(space, plant, seed=seed), []
        for _ in range(round(settings["share"] * ACTIONS[lattice])):
            agent.step()
            last = newest(agent)
            seen.append((last.s, last.a, last.s_next))
            settled.append(last.settled)
            durations.append(last.duration)
        values[lattice] = np.array(seen, dtype=np.uint16)
    return values | {"timeouts": float(1.0 - np.mean(settled)), "seconds": float(np.mean(durations))}


def summary(values: dict[str, Any]) -> dict[str, Any]:
    """Reduce the values of `trial` for the raw record: the transitions are sorted, because only their counts are needed.

    The raw record is an archive of the run's files in the repository.
    """
    return values | {lattice: in_order(values[lattice]) for lattice in LEVELS}


@dataclass(frozen=True)
class Row:
    """The results of one variant, as means over its runs; "57->61" is the action from state 57 to state 61.

    On rank 4: `never`, how many of the states 60, 124, 188 and 252 were never reached; `hardly`, visits of each of 61, 125, 189 and 253;
    `others`, number of other states never reached; `deflected`, share of the tries of 57->61, 121->125 and 249->253 that ended one pitch
    level higher; `where`, state in which 57->61 ended most often; `uncertain`, number of actions that ended in more than one state.  On
    rank 3: `failing`, share of the tries of 15->24, 42->51 and 69->78 that failed; `entering`, the same of 21->24.  On both: `timeouts`,
    share of actions that timed out; `seconds`, plant time per action.
    """

    never: float
    hardly: float
    others: float
    deflected: float
    where: str
    failing: float
    entering: float
    uncertain: float
    timeouts: float
    seconds: float

    @property
    def rank4(self) -> bool:
        """Whether the published findings on the lattice of rank 4 (256 states) are reproduced (thesis 7.3).

        They are reproduced if `never` is 4 (the states 60, 124, 188 and 252 are never reached), `hardly` is at most 4 visits (of each of
        61, 125, 189 and 253, on average), `others` is 0 (all other states are reached), and `deflected` is at least 90 %.
        """
        rare, deflected = self.hardly <= MAX_RARE_VISITS, self.deflected >= MIN_DEFLECTED
        return self.never == len(NEVER) and rare and self.others == 0 and deflected

    @property
    def rank3(self) -> bool:
        """Whether the published findings on the lattice of rank 3 (81 states) are reproduced (thesis 7.2.5).

        They are reproduced if at least half of the tries of 15->24, 42->51 and 69->78 fail (`failing`), and at most 10 % of the tries of
        21->24 (`entering`).
        """
        return self.failing >= MIN_FAILING and self.entering <= 1.0 - MIN_DEFLECTED

    @property
    def both(self) -> bool:
        """Whether the published findings on both lattices are reproduced."""
        return self.rank4 and self.rank3

    def record(self) -> dict[str, Any]:
        """Return the row as JSON values by label, with the verdicts "reproduced" or "lost"; NaN becomes None."""
        labels = {"findings on 256 states": self.rank4, "findings on 81 states": self.rank3}
        verdicts = {label: "reproduced" if is_there else "lost" for label, is_there in labels.items()}
        values = dict(zip(COLUMNS, asdict(self).values(), strict=True))
        return {**verdicts, **{name: None if value != value else value for name, value in values.items()}}


COLUMNS = (  # labels of the fields of a Row
    "of 60, 124, 188, 252: never reached",
    "visits of each of 61, 125, 189, 253",
    "other states never reached",
    "share of 57->61, 121->125, 249->253 that ends one pitch level higher",
    "57->61 ends most often in",
    "share of 15->24, 42->51, 69->78 that fails",
    "share of 21->24 that fails",
    "actions with several outcomes",
    "share of timeouts",
    "robot time per action [s]",
)


def rows_of(found: Cells) -> dict[str, Row]:
    """Return a dict from each variant of the plant that has finished runs to its row of results."""
    return {variant: _row(runs) for variant, runs in grouped(found, "variant", (*VARIANTS,)).items()}


def _row(runs: Sequence[Mapping[str, Any]]) -> Row:
    rank4, rank3 = (arm_space(LEVELS[name]) for name in ("rank4", "rank3"))
    four, three = ([run[name].astype(np.intp) for run in runs] for name in ("rank4", "rank3"))
    visits = np.array([visits_of(rank4, seen) for seen in four])
    where: Counter[int] = Counter()
    for seen in four:
        where.update(ends_of(rank4, seen, 57, 61))
    return Row(
        never=float((visits[:, NEVER] == 0).sum(axis=1).mean()),
        hardly=float(visits[:, HARDLY].mean()),
        others=float((np.delete(visits, (*NEVER, *HARDLY), axis=1) == 0).sum(axis=1).mean()),
        deflected=_share(rank4, four, DEFLECTED_TO),
        where=" ".join(str(state) for state, _ in where.most_common(1)),
        failing=1.0 - _share(rank3, three, {pair: pair[1] for pair in FAILING}),
        entering=1.0 - _share(rank3, three, {ENTERING: ENTERING[1]}),
        uncertain=float(np.mean([(outcome_counts(rank4, seen) > 1).sum() for seen in four])),
        timeouts=float(np.mean([run["timeouts"] for run in runs])),
        seconds=float(np.mean([run["seconds"] for run in runs])),
    )


def _share(space: Lattice, runs: Sequence[Ints], ends: Mapping[tuple[int, int], int]) -> float:
    """Return the share of all tries of some actions, in all runs together, that ended where expected; NaN if there was no try.

    `runs`: transitions (T, 3) of each run.  `ends`: dict from each of these actions (source, goal) to the state in which a try should end.
    """
    hits = tries = 0
    for seen in runs:
        for (source, goal), end in ends.items():
            found = ends_of(space, seen, source, goal)
            tries += sum(found.values())
            hits += found.get(end, 0)
    return hits / tries if tries else float("nan")


def findings(found: Cells) -> dict[str, Any]:
    """Return the results as a dict with two keys, "variants" and "claims".

    "variants" is a dict from each variant of the plant to the dict of `Row.record`.  "claims" is a list with the claims, their measured
    values and their verdicts, as dicts (`Claim.record`).  If not all variants were run in full, all claims stay unmeasured and are not
    judged.
    """
    rows = rows_of(found)
    whole = set(rows) == set(VARIANTS) and all(len(result.values["rank4"]) == ACTIONS["rank4"] for result in found.values())
    return {
        "variants": {variant: row.record() for variant, row in rows.items()},
        "claims": judged(CLAIMS, each_run(found), whole),
    }


EachRun = Mapping[str, list[Row]]  # the row of every run, by variant


def each_run(found: Cells) -> EachRun:
    """Return one `Row` for each finished run, by variant."""
    return {variant: [_row([run]) for run in runs] for variant, runs in grouped(found, "variant", (*VARIANTS,)).items()}


def _changed(each: EachRun, parameter: str) -> dict[str, list[Row]]:
    """Return the runs of all variants that change one parameter, by the value of the parameter."""
    return {variant.rpartition(" ")[2]: rows for variant, rows in each.items() if variant.startswith(parameter)}


def _reproduce(each: EachRun) -> dict[str, str]:
    """Return a text for each variant, as "3 of 5": in how many of its runs the published findings on both lattices are reproduced."""
    return {variant: f"{sum(row.both for row in rows)} of {len(rows)}" for variant, rows in each.items()}


@claim(
    OUR_AIM,
    "the published parameters reproduce the findings about the shoulder's cables on 256 states (5000 actions) and on 81 states (3000)",
    "in every run",
)
def reproduced(each: EachRun) -> Measured:
    return f"both in {_reproduce(each)[PUBLISHED]} runs", all(row.both for row in each[PUBLISHED])


@claim(
    OUR_AIM,
    "the findings about the shoulder's cables depend on no parameter of the motors: delay, lag, backlash, noise from 0.05 to 0.2 deg",
    "no change loses one in a run",
)
def robust(each: EachRun) -> Measured:
    motors = {variant: rows for variant, rows in each.items() if variant.startswith(MOTORS)}
    lost = {variant: text for variant, text in _reproduce(motors).items() if not all(row.both for row in motors[variant])}
    text = f"{len(motors) - len(lost)} of {len(motors)} changes reproduce both in every run"
    return text + "".join(f"; {variant}: in {count}" for variant, count in lost.items()), not lost


@claim(
    "thesis 7.2.5",
    "the speed below which an action has settled decides whether the states that are hard to enter are entered: share of failures of "
    "15->24, 42->51 and 69->78",
    "suspected",
)
def momentum(each: EachRun) -> Measured:
    failing = {speed: [row.failing for row in rows] for speed, rows in _changed(each, "settle speed").items()}
    slowest, *_, fastest = failing.values()
    return texts(failing, form="{1} at {0} deg/s"), is_above(fastest, slowest)


@claim(
    "thesis 7.2.5",
    "outcomes are uncertain because of noise in sensors and motors: number of actions with several outcomes, by encoder noise",
    "suspected",
)
def noise(each: EachRun) -> Measured:
    levels = {"0.1": each[PUBLISHED]} | _changed(each, "encoder noise")
    counts = {level: [row.uncertain for row in levels[level]] for level in sorted(levels, key=float)}
    return texts(counts, 0, "{1} at {0} deg"), all_hold([is_above(counts["0.1"], counts["0"]), is_above(counts["0.4"], counts["0.1"])])


CLAIMS = (reproduced, robust, momentum, noise)


GOOD, BAD, PLAIN = "#d5f0d5", "#f6cccc", "white"
HEADER = (
    "",
    "60 124 188 252\nunreached",
    "visits of 61\n125 189 253",
    "other states\nunreached",
    "57->61 and like:\none level higher",
    "57->61\nends in",
    "15->24 and like\nfail",
    "21->24\nfails",
    "actions with\n2+ outcomes",
    "timeouts",
    "seconds per\naction",
)


def plot(found: Cells) -> Any:
    """Draw the rows of all variants as a table: numbers that reproduce the published findings are green, others red.

    Returns a matplotlib figure.
    """
    rows = rows_of(found)
    drawing = new_figure(13.0, 0.8 + 0.23 * len(rows))
    axes = drawing.subplots()
    axes.axis("off")
    body = [_drawn_row(variant, row) for variant, row in rows.items()]
    table = axes.table(
        cellText=[HEADER, *([text for text, _ in row] for row in body)],
        cellColours=[[PLAIN] * len(HEADER), *([color for _, color in row] for row in body)],
        colWidths=[0.3, *[0.078] * (len(HEADER) - 1)],
        cellLoc="center",
        loc="center",
        bbox=(0.0, 0.0, 1.0, 1.0),
    )
    table.auto_set_font_size(False)
    table.set_fontsize(7)
    for number in range(1, len(body) + 1):
        table[number, 0].set_text_props(ha="left")
    for column in range(len(HEADER)):
        table[0, column].set_height(2.2 * table[1, column].get_height())
    return drawing


def _drawn_row(variant: str, row: Row) -> list[tuple[str, str]]:
    """Return the cells of one row of the drawn table, (text, background colour), in the order of HEADER: the variant, then its numbers."""
    return [
        (variant, _color(row.both)),
        (f"{row.never:.1f} of {len(NEVER)}", _color(row.never == len(NEVER))),
        (f"{row.hardly:.1f}", _color(row.hardly <= MAX_RARE_VISITS)),
        (f"{row.others:.1f}", _color(row.others == 0)),
        (f"{row.deflected:.2f}", _color(row.deflected >= MIN_DEFLECTED)),
        (row.where, _color(row.where == "62")),
        (f"{row.failing:.2f}", _color(row.failing >= MIN_FAILING)),
        (f"{row.entering:.2f}", _color(row.entering <= 1.0 - MIN_DEFLECTED)),
        (f"{row.uncertain:.0f}", PLAIN),
        (f"{100.0 * row.timeouts:.1f} %", PLAIN),
        (f"{row.seconds:.1f}", PLAIN),
    ]


def _color(is_as_published: bool) -> str:
    return GOOD if is_as_published else BAD


EXPERIMENT = Experiment(
    claim="which states of the shoulder are hard to reach depends on cable forces and the settle threshold, not on delay, lag and backlash",
    source="thesis 7.2.5, 7.3",
    method=Sweep(conditions, trial, findings, plot, seeds=5, summary=summary),
    claims=CLAIMS,
)
