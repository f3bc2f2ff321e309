"""Tune: the search that tuned `Gains.default()`, a (1+1) evolution strategy over the logarithms of the gains.

Claim: no gains that a seeded search finds are clearly better than `Gains.default()` by the criteria of `tune_criteria.py`: settling
time, overshoot, solids that touch while the hands press 5 to 25 cm into the table, while a client pushes and while the robot
wanders between random postures, chatter at the table with commands one, three and four ticks old at 100 Hz, violated constraints.
Source: this project's goals for MoBeE 2.0 (thesis 5.2).  Published number: none, the thesis has no criteria.  Run time: half an
hour for 100 gain sets.

The first set judged is `Gains.default()` itself.  Each of the others changes a few numbers of the best so far by random factors, which
grow after a success and shrink after a failure.  The result is a table of both, and the numbers of the best.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

import numpy as np

from experiments.claims.ch5_control.gain_tuning_criteria import WANTED, Judged, evaluate, objective
from experiments.kit.command_line import Progress, positive_whole
from experiments.kit.control.plant_runs import icub
from experiments.kit.experiment import Experiment, Steps
from experiments.kit.plots import new_figure
from experiments.kit.records import Records, read_records
from mobee import Controller, Gains
from mobee.errors import InvalidValue

RECORDS = "tune.csv"
CLEARLY = 0.8  # of the default's objective: what is less is clearly better

# Motors with a spring of their own: torso motors move the hands farthest, shoulder motors press the elbows against the chest.
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
CHANGED = (1, 3)  # numbers at a time, least and most
STEP, GROW, SHRINK = 0.3, 1.5, 0.9  # of the logarithms: standard deviation at first, after a success, after a failure
LEAST = 0.015  # s: sets that are not stable at such a control period are not judged


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options."""
    parser.add_argument("--sets", type=positive_whole, default=100, metavar="N", help="gain sets to judge (default: 100)")


def run(arguments: argparse.Namespace, folder: Path) -> dict[str, Any]:
    """Search, going on behind what is in the folder."""
    path = folder / RECORDS
    tried = read_tried(path)
    with Records(path, COLUMNS) as records, Progress() as progress:
        for new in search(tried, arguments.sets, arguments.seed):
            records.append(new.record())
            best = min(known.objective for known in tried)
            progress.show(len(tried) / arguments.sets, f"{len(tried)} gain sets, objective {tried[0].objective:.2f} -> {best:.2f}")
    return results(tried)


def read_tried(path: Path) -> list[Tried]:
    """What a run has so far."""
    return [Tried.of_record(row) for row in read_records(path, COLUMNS)]


@dataclass(frozen=True, slots=True)
class Tried:
    """A gain set and how it was judged."""

    numbers: dict[str, float]
    judged: Judged

    @property
    def objective(self) -> float:
        """Less is better."""
        return objective(self.judged)

    def record(self) -> dict[str, object]:
        """For the file."""
        return {**{name: round(value, 6) for name, value in self.numbers.items()}, **self.judged.record()}

    @classmethod
    def of_record(cls, row: Mapping[str, str]) -> Tried:
        """From the file."""
        return cls({name: float(row[name]) for name in TUNED}, Judged.of_record(row))


def search(tried: list[Tried], sets: int, seed: int) -> Iterator[Tried]:
    """Append gain sets to those that are known until there are so many; these and the seed decide the new ones."""
    while len(tried) < sets:
        numbers = _next(tried, seed) if tried else numbers_of(Gains.default())
        tried.append(Tried(numbers, evaluate(gains_with(numbers))))
        yield tried[-1]


def numbers_of(gains: Gains) -> dict[str, float]:
    """The values of TUNED."""
    motors = icub().robot.motors
    springs = gains.of_motors("max_spring", motors)
    numbers = {name: float(getattr(gains, name)) for name in TUNED if name not in SPRINGS}
    return numbers | {name: float(springs[[fnmatchcase(m, pattern) for m in motors]][0]) for name, pattern in SPRINGS.items()}


def gains_with(numbers: Mapping[str, float]) -> Gains:
    """`Gains.default()` but for these numbers."""
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
        if Controller(icub(), gains_with(numbers)).max_dt > LEAST:
            return numbers


def _changed(numbers: dict[str, float], step: float, rng: np.random.Generator) -> dict[str, float]:
    chosen = rng.choice(TUNED, rng.integers(*CHANGED, endpoint=True), replace=False)
    return {name: value * (float(np.exp(step * rng.standard_normal())) if name in chosen else 1.0) for name, value in numbers.items()}


def results(tried: list[Tried]) -> dict[str, Any]:
    """The default and the best, side by side."""
    before, best = tried[0], min(tried, key=lambda one: one.objective)
    criteria = {name: [round(value, 4), round(asdict(best.judged)[name], 4)] for name, value in asdict(before.judged).items()}
    return {
        "passed": best.objective >= CLEARLY * before.objective,
        "judged": len(tried),
        "objective": [round(before.objective, 3), round(best.objective, 3)],
        "each": "Gains.default() and the best",
        "criteria": criteria,
        "gains": {name: [round(value, 4), round(best.numbers[name], 4)] for name, value in before.numbers.items()},
    }


def figure(folder: Path) -> Path:
    """Draw the course of the search; raises InvalidValue if nothing was judged."""
    tried = read_tried(folder / RECORDS)
    if not tried:
        raise InvalidValue(f"{folder} has no gains in it: it was stopped before the first were judged.")
    path = folder / "figure.png"
    plot(tried).savefig(path, dpi=130)
    return path


def plot(tried: Sequence[Tried]) -> Any:
    """The objective with its parts, and the gains of the best so far."""
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
    course.set(
        xlabel="gain sets judged", ylabel="objective", title="Best so far: what its objective is made of", ylim=(0.0, 1.1 * objectives[0])
    )
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
    name="gain-tuning",
    claim="a seeded search finds no gains that are clearly better than the default ones",
    source="thesis 5.2; this project's criteria",
    notes=__doc__,
    method=Steps(add_arguments, run, figure),
)
