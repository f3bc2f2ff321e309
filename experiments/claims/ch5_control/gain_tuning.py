# SPDX-License-Identifier: Apache-2.0
"""Gain tuning: the search that tuned `Gains.default()`, a (1+1) evolution strategy over the logarithms of the gains.

Claim: no gains that a seeded search finds are clearly better than `Gains.default()` by the criteria of `Judged`: settling time and
overshoot; depths of solid contacts while the hands are commanded 5 to 25 cm below the table's top, while a client (another program) pushes,
and while the robot moves between random postures; depths of field contacts at the table; chatter of the hands at the table with commands
that take effect one, three and four ticks after they were computed, at 100 Hz; violated constraints; impacts at hard stops; and the longest
stable control period.
Source: this project's goals for MoBeE 2.0 (thesis 5.2).  Published number: none, the thesis has no criteria.  Run time: half an hour for
100 gain sets.

The first gain set that is judged is `Gains.default()` itself.  Each later set changes one to three values of the best set so far by random
factors; the spread of these factors grows after a success and shrinks after a failure.  The result is a table of the default and the best
set.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from fnmatch import fnmatchcase
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from experiments.kit.command_line import Progress, positive_whole
from experiments.kit.control.arm_commands import Command, random_command, try_commands
from experiments.kit.control.measures import deepest, motor_step, oscillation, postures, run_step, step_response
from experiments.kit.control.plant_runs import PUSHES, icub, icub_at_table, random_posture, run_plant
from experiments.kit.experiment import Experiment, Steps
from experiments.kit.plots import new_figure, saved
from experiments.kit.run_folder import Records, Row, read_records
from mobee import Controller, Gains
from mobee.arrays import Array
from mobee.errors import InvalidValue
from mobee.simulation import MotorParameters, OfflinePlant

STEPPED = ("torso_yaw", "torso_pitch", "l_shoulder_pitch", "l_shoulder_roll", "l_elbow", "l_wrist_prosup", "neck_yaw")
POSTURES, TARGETS, COMMANDS = 4, 10, 40
AGES = (1, 3, 4)  # ages of commands in ticks of 10 ms; the first two must be stable
CLIENT_PUSHES = ("table-left-hand", "table-both-hands", "table-edge", "chest", "face", "other-hand")
STRONG, PUSHED = 300.0, 3.0  # N/kg before the squash; s
WANDERS, WANDER, HOLD = 6, 60.0, 6.0  # number of runs; s per run; s per target, in the joint box
AT_ENDS = 0.5  # share of motor targets at an end of the range, where the springs of many motors push together
SPEEDS = (1.0, 0.2)  # speed scales of the runs in turn; the thesis used 0.1 and 0.2
WANDERING = ("torso", "head", "left_arm", "right_arm")  # without the fingers: the 23 motors of thesis 4.1.1
FINGERS = 7  # index of the first finger motor in an arm

PRESS_SEED = 7
PRESS, REST = 6.0, 2.0  # s, duration of a press; its end, in which chatter is measured
PRESSING = {"torso": 3, "left_arm": 4, "right_arm": 4}
WITHIN = (0.1, 0.9)  # shares of their ranges
BELOW_TOP = (-0.25, -0.05)  # m
ABOVE_BLOCK = (-0.6, -0.2)  # m, along x
TOP = -0.1  # m
PALMS = ("left_palm", "right_palm")


@dataclass(frozen=True, slots=True)
class Judged(Row):
    """The criteria by which a gain set is judged, measured at the true joint positions.

    `settling_s`: median settling time of steps [s].  `overshoot`: largest overshoot of a step of a single motor, as a share of the step.
    `solid_mm`: depth of the deepest solid contact while the robot moves between random postures, and while the hands press into the table
    with commands that act 1 or 3 ticks after they were computed; `field_mm`: depth of the deepest contact of fields (larger volumes that
    cause repulsive forces) while they press; `pushed_mm`: depth of the deepest solid contact while a client (another program) pushes.
    `chatter_mm`: oscillation of the palms at the table with commands 1 tick old, mean over the postures; `late_mm`: the same with commands
    3 ticks old; `later_mm`: the same with commands 4 ticks old.  `clause_deg`, `forced_deg`: largest violation of a constraint without and
    with a pushing client, negative inside.  `stop_deg_s`: fastest impact at a hard stop.  `longest_ms`: longest control period at which the
    control law is stable.
    """

    settling_s: float  # median of steps of motors and postures
    overshoot: float  # the largest of a motor's step; the deflection by a contact does not count
    solid_mm: float  # deepest, pressing, at the ages that must be stable, and wandering
    field_mm: float  # deepest, pressing
    pushed_mm: float  # deepest solid while a client pushes with the largest force
    chatter_mm: float  # pressing, mean over the postures, 1 tick of age
    late_mm: float  # the same, 3 ticks
    later_mm: float  # the same, 4 ticks
    clause_deg: float  # largest violation, negative inside
    forced_deg: float  # the same while a client pushes
    stop_deg_s: float  # fastest impact at a hard stop without a push
    longest_ms: float  # the longest control period at which the law is stable


# The required value, and the price of a unit beyond it; a second of settling time costs 1.
WANTED: Mapping[str, tuple[float, float]] = {
    "overshoot": (0.02, 20.0),
    "solid_mm": (1.0, 1.0),
    "field_mm": (45.0, 0.02),
    "pushed_mm": (0.0, 0.5),
    "chatter_mm": (1.0, 0.3),
    "late_mm": (1.5, 0.3),
    "later_mm": (3.0, 0.1),
    "clause_deg": (-1.0, 1.0),
    "forced_deg": (0.0, 0.5),
    "stop_deg_s": (0.0, 0.05),
}
MIN_LONGEST = 25.0  # ms; a period of 20 must be possible


def objective(judged: Judged) -> float:
    """Return the objective of the search: the settling time [s] plus a penalty for each unmet requirement (WANTED).  Smaller is better."""
    cost = judged.settling_s + 0.2 * max(0.0, MIN_LONGEST - judged.longest_ms)
    for name, (wanted, price) in WANTED.items():
        cost += price * max(0.0, getattr(judged, name) - wanted)
    return cost


def evaluate(gains: Gains) -> Judged:
    """Measure a gain set by all criteria.  The seeds are always the same, so that gain sets can be compared."""
    settling, overshoot = _steps(gains)
    pressed = {age: [press(gains, target, age) for target in _targets()] for age in AGES}
    must_hold = [p for age in AGES[:2] for p in pressed[age]]
    chatter = {age: 1e3 * float(np.mean([p.chatter for p in pressed[age]])) for age in AGES}
    clause, stop = _clauses(gains, forced=False)
    wandered = max(_wander(gains, seed) for seed in range(WANDERS))
    return Judged(
        settling,
        overshoot,
        solid_mm=1e3 * max(wandered, *(p.solid for p in must_hold)),
        field_mm=1e3 * max(p.field for p in must_hold),
        pushed_mm=1e3 * max(_pushed(gains, push) for push in CLIENT_PUSHES),
        chatter_mm=chatter[1],
        late_mm=chatter[3],
        later_mm=chatter[4],
        clause_deg=clause,
        forced_deg=_clauses(gains, forced=True)[0],
        stop_deg_s=stop,
        longest_ms=1e3 * OfflinePlant(icub_at_table(), gains=gains, dt=1e-3).controller.max_dt,
    )


@dataclass(frozen=True, slots=True)
class Pressed:
    """Measures in m while hands press into the table.

    `solid`, `field`: depth of the deepest contact of solids, and of fields (larger volumes that cause repulsive forces).  `chatter`:
    oscillation of the palms, the larger of the two.
    """

    solid: float
    field: float
    chatter: float


def press_targets(count: int) -> list[Array]:
    """Draw `count` postures (n,) rad in which a palm is 5 to 25 cm below the table's top.

    In a world without the table these postures have no contacts.
    """
    robot = icub_at_table().robot
    rng, free = np.random.default_rng(PRESS_SEED), icub()
    found: list[Array] = []
    while len(found) < count:
        q = random_posture(robot, rng, PRESSING, WITHIN)
        pose = free.evaluate(q)
        palms = [pose.position(marker) for marker in PALMS]
        low_enough = any(BELOW_TOP[0] < z - TOP < BELOW_TOP[1] and ABOVE_BLOCK[0] < x < ABOVE_BLOCK[1] for x, _, z in palms)
        if low_enough and not pose.count:
            found.append(q)
    return found


def press(gains: Gains, target: Array, age: int, dt: float = 0.01) -> Pressed:
    """Command all parts to a posture below the table's top, with commands that take effect `age` ticks after they were computed.

    `target`: the posture (n,) rad.  `dt`: duration of a tick [s].  Returns the depths of the deepest contacts in 6 s [m], and the
    oscillation of the palms in the last 2 s [m].
    """
    late = MotorParameters(delay=float(MotorParameters().of_motors("delay", 1)[0]) + (age - 1) * dt)
    plant = OfflinePlant(icub_at_table(), PRESS_SEED, gains, late, dt)
    plant.controller.attractor = target
    run = run_plant(plant, PRESS)
    depths, rest = deepest(icub_at_table(), run.q[::2]), run.last(REST)
    return Pressed(depths.solid, depths.field, max(oscillation(icub_at_table(), rest, palm) for palm in PALMS))


def _steps(gains: Gains) -> tuple[float, float]:
    robot, home = icub_at_table().robot, icub_at_table().robot.home
    steps = [motor_step(robot.motors.index(motor)) for motor in STEPPED] + [(home, target) for target in _postures()]
    responses = [step_response(run_step(gains, 10.0, *step, seed=i), *step) for i, step in enumerate(steps)]
    return float(np.median([r.settling for r in responses])), max(r.overshoot for r in responses[: len(STEPPED)])


def _wander(gains: Gains, seed: int) -> float:
    """Return the deepest solid contact [m] on motions between random postures."""
    robot, rng = icub_at_table().robot, np.random.default_rng(seed)
    plant = OfflinePlant(icub_at_table(), seed, gains, speed_scale=SPEEDS[seed % len(SPEEDS)])
    moving = np.concatenate([np.arange(len(robot.motors))[robot.parts[part].slice][:FINGERS] for part in WANDERING])
    found = 0.0
    for _ in range(round(WANDER / HOLD)):
        attractor = plant.controller.attractor
        levels = rng.uniform(0.0, 1.0, len(moving))
        levels = np.where(rng.random(len(moving)) < AT_ENDS, levels.round(), levels)
        low, high = robot.limits[moving].T
        attractor[moving] = low + levels * (high - low)
        plant.controller.attractor = attractor
        found = max(found, deepest(icub_at_table(), run_plant(plant, HOLD).q[::2]).solid)
    return found


def _pushed(gains: Gains, push: str) -> float:
    plant = OfflinePlant(icub_at_table(), 0, gains)
    PUSHES[push](plant.controller, STRONG)
    return deepest(icub_at_table(), run_plant(plant, PUSHED).q[::2]).solid


def _clauses(gains: Gains, forced: bool) -> tuple[float, float]:
    tried = [try_commands(gains, commands, np.zeros(3), seed) for seed, commands in enumerate(_commands(forced))]
    return float(np.rad2deg(max(t.violations.max() for t in tried))), float(np.rad2deg(max(t.stop.max() for t in tried)))


@lru_cache(maxsize=1)
def _targets() -> list[Array]:
    return press_targets(TARGETS)


@lru_cache(maxsize=1)
def _postures() -> list[Array]:
    return postures(POSTURES, 0)


@lru_cache(maxsize=2)
def _commands(forced: bool) -> list[tuple[Command, Command]]:
    rng = np.random.default_rng(0)
    return [(random_command(rng, forced), random_command(rng, forced)) for _ in range(COMMANDS)]


RECORDS = "tune.csv"
CLEARLY_BETTER = 0.8  # of the default's objective, below which a set is clearly better

# Motors with their own spring: torso motors move the hands farthest, shoulder motors press the elbows against the chest.
SPRINGS = {"max_spring of the torso": "torso_*", "max_spring of the shoulders": "?_shoulder_*"}
TUNED = (
    "damping",
    "stiffness",
    "max_spring",
    "max_limit",
    "max_constraint",
    "contact_gain",
    "max_contact",
    "max_client",
    *SPRINGS,
)
COLUMNS = (*TUNED, *Judged.columns())
CHANGED = (1, 3)  # least and largest number of values changed at a time
STEP, GROW, SHRINK = 0.3, 1.5, 0.9  # of the logarithms: initial standard deviation, its factors after a success and a failure
MIN_STABLE_PERIOD = 0.015  # s: sets that are not stable at this control period are not judged


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command-line options of this experiment to the parser."""
    parser.add_argument("--sets", type=positive_whole, default=100, metavar="N", help="gain sets to judge (default: 100)")


def run(arguments: argparse.Namespace, folder: Path) -> dict[str, Any]:
    """Search for better gains until --sets gain sets are judged, continuing after those in `folder`, and return the results.

    The keys are those of `results`.
    """
    path = folder / RECORDS
    tried = read_tried(path)
    with Records(path, COLUMNS) as records, Progress() as progress:
        for new in search(tried, arguments.sets, arguments.seed):
            records.append(new.record())
            best = min(known.objective for known in tried)
            progress.show(len(tried) / arguments.sets, f"{len(tried)} gain sets, objective {tried[0].objective:.2f} -> {best:.2f}")
    return results(tried)


def read_tried(path: Path) -> list[Tried]:
    """Read the gain sets that a run has judged so far from its file, each with its criteria, in the order of the search."""
    return [Tried.of_record(row) for row in read_records(path, COLUMNS)]


@dataclass(frozen=True, slots=True)
class Tried:
    """A gain set that was judged.  `numbers`: its values by the names in TUNED.  `judged`: its criteria."""

    numbers: dict[str, float]
    judged: Judged

    @property
    def objective(self) -> float:
        """The settling time [s] plus penalties for unmet requirements, which the search minimises, as in the function `objective`."""
        return objective(self.judged)

    def record(self) -> dict[str, object]:
        """Return the values and criteria as a row of `tune.csv`, the run's file of gain sets."""
        return {**{name: round(value, 6) for name, value in self.numbers.items()}, **self.judged.record()}

    @classmethod
    def of_record(cls, row: Mapping[str, str]) -> Tried:
        """Return the gain set that a row of `tune.csv`, the run's file of gain sets, describes."""
        return cls({name: float(row[name]) for name in TUNED}, Judged.of_record(row))


def search(tried: list[Tried], sets: int, seed: int) -> Iterator[Tried]:
    """Judge new gain sets until `tried` has `sets` of them; append each new one to `tried`, and yield it.

    The sets in `tried` and the seed determine the next set.  The first one is `Gains.default()`.
    """
    while len(tried) < sets:
        numbers = _next(tried, seed) if tried else numbers_of(Gains.default())
        tried.append(Tried(numbers, evaluate(gains_with(numbers))))
        yield tried[-1]


def numbers_of(gains: Gains) -> dict[str, float]:
    """Return those values of `gains` that the search changes, as a dict with the names in TUNED as keys."""
    motors = icub().robot.motors
    springs = gains.of_motors("max_spring", motors)
    numbers = {name: float(getattr(gains, name)) for name in TUNED if name not in SPRINGS}
    return numbers | {name: float(springs[[fnmatchcase(m, pattern) for m in motors]][0]) for name, pattern in SPRINGS.items()}


def gains_with(numbers: Mapping[str, float]) -> Gains:
    """Return `Gains.default()` with the values `numbers`, given by the names in TUNED."""
    common: dict[str, Any] = {name: value for name, value in numbers.items() if name not in SPRINGS}
    gains = replace(Gains.default(), motors=(), groups=(), **common)
    for name, pattern in SPRINGS.items():
        gains = gains.with_motors(pattern, max_spring=numbers[name])
    return gains


def _next(tried: list[Tried], seed: int) -> dict[str, float]:
    rng = np.random.default_rng([seed, len(tried)])
    step, best = STEP, tried[0]
    for one in tried[1:]:
        is_better = one.objective < best.objective
        step *= GROW if is_better else SHRINK
        best = one if is_better else best
    while True:
        numbers = _changed(best.numbers, step, rng)
        if Controller(icub(), gains_with(numbers)).max_dt > MIN_STABLE_PERIOD:
            return numbers


def _changed(numbers: dict[str, float], step: float, rng: np.random.Generator) -> dict[str, float]:
    chosen = rng.choice(TUNED, rng.integers(*CHANGED, endpoint=True), replace=False)
    return {name: value * (float(np.exp(step * rng.standard_normal())) if name in chosen else 1.0) for name, value in numbers.items()}


def results(tried: list[Tried]) -> dict[str, Any]:
    """Return the default and the best gain set side by side.

    "objective": a list of two values, of the default and of the best gain set.  "criteria" and "gains": dicts from a name to a list of two
    values, of the default and of the best.  "judged": number of gain sets.  "passed": whether the objective of the best set is at least 0.8
    times that of the default, so that no set is clearly better.
    """
    before, best = tried[0], min(tried, key=lambda one: one.objective)
    criteria = {name: [round(value, 4), round(asdict(best.judged)[name], 4)] for name, value in asdict(before.judged).items()}
    return {
        "passed": best.objective >= CLEARLY_BETTER * before.objective,
        "judged": len(tried),
        "objective": [round(before.objective, 3), round(best.objective, 3)],
        "each": "Gains.default() and the best",
        "criteria": criteria,
        "gains": {name: [round(value, 4), round(best.numbers[name], 4)] for name, value in before.numbers.items()},
    }


def figure(folder: Path) -> Path:
    """Draw the course of the search in `folder` to a file.  Returns its path; raises InvalidValue if no gain set was judged."""
    tried = read_tried(folder / RECORDS)
    if not tried:
        raise InvalidValue(f"{folder} has no gains in it: the run was stopped before the first were judged.")
    return saved(plot(tried), folder, 130)


def plot(tried: Sequence[Tried]) -> Any:
    """Return a figure of the objective with its parts, and of the values of the best gain set so far, over the number of sets."""
    drawing = new_figure(12.0, 4.5)
    course, numbers = drawing.subplots(1, 2)
    objectives = [one.objective for one in tried]
    best = [min(range(i + 1), key=objectives.__getitem__) for i in range(len(tried))]
    places = range(1, len(tried) + 1)
    course.plot(places, objectives, ".", color="0.7", label="objective of every set")
    parts = {"settling time [s]": [tried[i].judged.settling_s for i in best]}
    for name, (wanted, price) in WANTED.items():
        costs = [price * max(0.0, getattr(tried[i].judged, name) - wanted) for i in best]
        if any(costs):
            parts[f"{name} beyond {wanted:g}"] = costs
    course.stackplot(places, *parts.values(), labels=parts, alpha=0.8)
    course.set(xlabel="gain sets judged", ylabel="objective", title="Best so far: parts of its objective", ylim=(0.0, 1.1 * objectives[0]))
    course.legend(fontsize=6)
    for name in TUNED:
        numbers.plot(places, [tried[i].numbers[name] / tried[0].numbers[name] for i in best], label=name)
    numbers.set(xlabel="gain sets judged", ylabel="best so far, over Gains.default()", yscale="log", title="The gains")
    numbers.set_yticks(ticks := np.array([0.25, 0.5, 1.0, 2.0, 4.0]), [f"{tick:g}" for tick in ticks])
    numbers.minorticks_off()
    numbers.legend(fontsize=6)
    for axes in (course, numbers):
        axes.xaxis.get_major_locator().set_params(integer=True)
        axes.grid(alpha=0.2)
    return drawing


EXPERIMENT = Experiment(
    claim="a seeded search finds no gains that are clearly better than the default gains",
    source="thesis 5.2; this project's criteria",
    method=Steps(add_arguments, run, figure),
)
