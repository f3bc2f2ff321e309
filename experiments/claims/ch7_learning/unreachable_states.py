# SPDX-License-Identifier: Apache-2.0
"""Find the states of a large lattice that the arm never reaches, and the states in which actions towards them end.

Claim: of 256 states at 20, 40, 60 and 80 % of the joints' ranges the agent never reaches the states 60, 124, 188 and 252, and hardly ever
61, 125, 189 and 253, although it tries hundreds of times.  The reason is that the shoulder's cables deflect the arm: the action 57->61 ends
in 62, 121->125 in 126, and 249->253 in 254.  In a lattice stretched to 12.5 and 87.5 % far more states are unreachable.  The arm often
touches its own body, and reaches its goal nevertheless.
Source: thesis 7.3, figs. 7.8 and 7.9; one run each, 14 597 and 26 963 actions.  Run time: 3 minutes on 2 cores.

The left arm explores by curiosity from a random state, with prior 50-50 (one imagined failure and one success) and discount 0.9.  An action
touches the robot's own body if the fields of two links overlap at any time during it.  States are numbered with pitch varying fastest, then
roll, yaw and elbow; source->goal is the action between two states.
"""

from __future__ import annotations

import argparse
import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from experiments.kit.cells import CellResult
from experiments.kit.experiment import Envelope, Experiment, Measured, claim, judged
from experiments.kit.learning.arm import RANK4, STRETCHED, arm_plant, arm_space
from experiments.kit.learning.exploration import begin_anywhere, explore
from experiments.kit.learning.outcomes import ends_of, exists_in, goals_of, outcome_counts, tries_of, uncertain_in, visits_of
from experiments.kit.plants import WrappedPlant
from experiments.kit.plots import new_figure
from experiments.kit.rules import decides, of_each, rises, texts
from experiments.kit.statistics import estimate, interval, mean_over, ratio_interval
from experiments.kit.sweep import Cells, Condition, Sweep, runs_by
from mobee import CuriousAgent, Lattice, OfflinePlant, Outcome
from mobee.arrays import Array, Ints
from mobee.control.gains import SettleTest

LEVELS = {"small": RANK4, "stretched": STRETCHED}
ACTIONS = {"small": 14_597, "stretched": 26_963}
NEVER, HARDLY = (60, 124, 188, 252), (61, 125, 189, 253)
DEFLECTED_TO = {(57, 61): 62, (121, 125): 126, (249, 253): 254}  # (source, goal): where it ends
QUICK = 0.2  # share of the transitions in the short version
MAX_RARE_VISITS, MIN_DEFLECTED, HANDFUL = 10, 100, 10  # times in a run
MANY_CONTACTS = 0.01  # share of actions with self-contacts from which they are many
MANY_MORE = 2.0  # ratio


def conditions(arguments: argparse.Namespace) -> list[Condition]:
    """Return the settings of the runs: the lattices "small" (20 to 80 % of the ranges) and "stretched" (12.5 to 87.5 %).

    With --quick the runs have a fifth of the transitions.
    """
    share, name = (QUICK, "quick-") if arguments.quick else (1.0, "")
    return [
        Condition(f"{name}{lattice}", {"lattice": lattice, "transitions": round(share * actions)}, actions)
        for lattice, actions in ACTIONS.items()
    ]


def trial(settings: dict[str, Any], seed: int) -> dict[str, Any]:
    """Explore one lattice, and record the self-contacts during each action.

    Returns `seen` (T, 3), the transitions: state, action, state reached; `values` (256, 8) [nats] at the end; `pairs`, the names of the
    pairs of links that touched; and for each transition `touching` (T,), the index in `pairs` of the pair that touched (-1: none), and
    `depths` (T,), the depth [m] of the deepest self-contact (0: none).  `settings`: "lattice", a key of LEVELS; "transitions", their
    number.  `seed`: of agent and plant.
    """
    space, plant = arm_space(LEVELS[settings["lattice"]]), arm_plant(seed)
    begin_anywhere(space, plant, seed)
    recorder = SelfContactPlant(plant)
    agent = CuriousAgent(space, recorder, seed=seed)
    seen = explore(agent, settings["transitions"])
    pairs, touching = _numbered(recorder.contacts)
    return {
        "seen": seen.astype(np.uint16),
        "values": agent.plan()[1].astype(np.float32),
        "pairs": pairs,
        "touching": touching,
        "depths": np.array([0.0 if contact is None else contact.depth for contact in recorder.contacts], dtype=np.float32),
    }


def _numbered(contacts: list[SelfContact | None]) -> tuple[list[str], NDArray[np.int16]]:
    """Return the names of all pairs of links that touched, and for each action the index of its pair in this list, (T,).

    The index is -1 for an action without self-contact.  `contacts`: deepest self-contact of each action, or None.
    """
    pairs = sorted({contact.pair for contact in contacts if contact})
    touching = [-1 if contact is None else pairs.index(contact.pair) for contact in contacts]
    return [" and ".join(pair) for pair in pairs], np.array(touching, dtype=np.int16)


@dataclass(frozen=True, slots=True)
class SelfContact:
    """The deepest overlap of two fields during an action: the names of both links, and the depth [m]."""

    pair: tuple[str, str]
    depth: float


class SelfContactPlant(WrappedPlant[OfflinePlant]):
    """A plant that performs exactly the same actions as the plant inside, and records the self-contact of each action.

    `contacts`: for each action so far the deepest self-contact, or None without one.
    """

    def __init__(self, plant: OfflinePlant) -> None:
        super().__init__(plant)
        self.contacts: list[SelfContact | None] = []

    def act(self, part: str, target: Array) -> Outcome:
        """Perform an action as `mobee.plant.Plant.act` does, and record its deepest self-contact in `contacts`.

        The outcome does not name touched objects.  `part`, `target`: as in `Plant.act`.
        """
        plant, settle = self.inner, self.inner.controller.gains.settle
        where, start = self.robot.part(part).slice, plant.time - plant.dt
        test, ticks = SettleTest(settle, start), _ticks(settle.first_check, plant.dt)
        deepest, pose = 0.0, None
        plant.begin(part, target)
        while True:
            trace = plant.run(ticks)
            at = int(trace.field.argmax())
            if trace.field[at] > deepest:
                deepest, pose = float(trace.field[at]), trace.encoders[at]
            velocity = trace.velocity[-2:, where]
            verdict = test.update(plant.time - plant.dt, velocity[1], (velocity[1] - velocity[0]) / plant.dt)
            if verdict != "moving":
                break
            ticks = _ticks(settle.interval, plant.dt)
        self.contacts.append(None if pose is None else SelfContact(self._pair(pose), deepest))
        return Outcome(plant.measure(part), verdict == "settled", plant.time - plant.dt - start, ())

    def _pair(self, q: Array) -> tuple[str, str]:
        """Return the links of the deepest overlap of fields in the pose q (n,) rad."""
        table = self.inner.model.evaluate(q).table
        row = int(np.where(table.kind == 1, table.depth, -1.0).argmax())
        first, second = sorted(self.robot.links[int(link[row])] for link in (table.first_link, table.second_link))
        return first, second


def _ticks(time: float, dt: float) -> int:
    return math.ceil(time / dt - 1e-9)


@dataclass(frozen=True, eq=False)
class Run:
    """The results of one exploration of the lattice `space`.

    `seen` (T, 3): transitions; state, action, state reached.  `values` (256, 8): values of the actions at the end [nats].  `pairs`: names
    of the pairs of links that touched.  `touching` (T,): index in `pairs` for each transition, -1 without contact.  `depths` (T,): depth
    [m] of the deepest self-contact, 0 without contact.
    """

    space: Lattice
    seen: Ints
    values: Array
    pairs: list[str]
    touching: Ints
    depths: Array

    @cached_property
    def visits(self) -> Ints:
        """The number of times each state was reached, (256,)."""
        return visits_of(self.space, self.seen)

    @property
    def unreached(self) -> tuple[int, ...]:
        """The states that were never reached."""
        return tuple(np.flatnonzero(self.visits == 0).tolist())

    @property
    def succeeded(self) -> NDArray[np.bool_]:
        """Whether each transition ended in its goal state, (T,)."""
        return np.asarray(self.seen[:, 2] == goals_of(self.space, self.seen))

    @property
    def touched(self) -> NDArray[np.bool_]:
        """Whether fields of two links overlapped during each transition, (T,)."""
        return np.asarray(self.touching >= 0)

    @property
    def uncertain(self) -> int:
        """The number of actions that failed in 10 to 90 % of their tries."""
        return uncertain_in(self.space, self.seen)


Runs = Mapping[str, list[Run]]  # by lattice


def runs_of(found: Cells) -> Runs:
    """Group the finished runs by lattice, "small" or "stretched"; each group is sorted by seed."""

    def of(result: CellResult) -> Run:
        values = result.values
        kept = (values[name] for name in ("values", "pairs", "touching", "depths"))
        return Run(arm_space(LEVELS[result.cell.settings["lattice"]]), values["seen"].astype(np.intp), *kept)

    by_lattice = runs_by(found, of, "lattice")
    return {lattice: by_lattice[lattice,] for lattice in LEVELS if (lattice,) in by_lattice}


def findings(found: Cells) -> dict[str, Any]:
    """Return the results as a dict with five keys.

    Three of them contain a dict from the lattice ("small", "stretched") to results.  "lattices": a row of numbers, such as
    "states_never_reached" and "share_of_failed_actions".  "states never reached": a dict from a text like "in 3 of 5 runs" to the states
    that were never reached in so many runs, as text.  "self-contacts": the result of `contacts_by_pair`.

    "end states of deflected actions, times per run" is a dict from an action of the small lattice, "source->goal", to the states in which
    it ended, with the mean number of times per run.  "claims" is a list of the claims with their verdicts, as dicts (`Claim.record`).  If
    not both lattices were run in full, all claims stay unmeasured and are not judged.
    """
    runs = runs_of(found)
    whole = all(lattice in runs and len(runs[lattice][0].seen) == actions for lattice, actions in ACTIONS.items())
    return {
        "lattices": {lattice: _row(group) for lattice, group in runs.items()},
        "states never reached": {lattice: _shares(group) for lattice, group in runs.items()},
        "end states of deflected actions, times per run": (
            {f"{s}->{g}": _ends(runs["small"], s, g) for s, g in DEFLECTED_TO} if "small" in runs else {}
        ),
        "self-contacts": {lattice: contacts_by_pair(group) for lattice, group in runs.items()},
        "claims": judged(CLAIMS, runs, whole),
    }


def _row(runs: list[Run]) -> dict[str, Any]:
    return {
        "seeds": len(runs),
        "actions": len(runs[0].seen),
        "states_never_reached": mean_over(runs, lambda run: len(run.unreached)),
        "share_of_failed_actions": mean_over(runs, lambda run: float(1.0 - run.succeeded.mean())),
        "actions_that_sometimes_fail": mean_over(runs, lambda run: run.uncertain),
        "largest_number_of_outcomes": max(int(outcome_counts(run.space, run.seen).max()) for run in runs),
        "share_of_actions_with_self_contact": mean_over(runs, lambda run: float(run.touched.mean())),
        "deepest_self_contact_mm": 1e3 * max(float(run.depths.max()) for run in runs),
    }


def _shares(runs: list[Run]) -> dict[str, str]:
    """Return the states that were never reached in some run, grouped by the number of such runs."""
    by_count: dict[int, list[int]] = {}
    for state, count in sorted(_unreached(runs).items()):
        by_count.setdefault(count, []).append(state)
    return {f"in {count} of {len(runs)} runs": " ".join(map(str, states)) for count, states in sorted(by_count.items(), reverse=True)}


def _unreached(runs: list[Run]) -> Counter[int]:
    """Count the runs in which each state was never reached."""
    return Counter(state for run in runs for state in run.unreached)


def _ends(runs: Sequence[Run], source: int, goal: int) -> dict[str, float]:
    """Return the states in which an action ended, and how often in a run, on average."""
    counted: Counter[int] = Counter()
    for run in runs:
        counted.update(ends_of(run.space, run.seen, source, goal))
    return {str(state): count / len(runs) for state, count in counted.most_common()}


def contacts_by_pair(runs: Sequence[Run]) -> dict[str, dict[str, float]]:
    """Return, for each pair of links that touched in some run, a dict of numbers about the actions in which it touched.

    The numbers are "actions_per_run", "deepest_mm", the deepest overlap, and "share_that_succeeds", the share that ended in their goals.
    The pairs with most actions come first.
    """
    table: dict[str, dict[str, float]] = {}
    for pair in sorted({pair for run in runs for pair in run.pairs}):
        group = [(run, run.touching == run.pairs.index(pair)) for run in runs if pair in run.pairs]
        actions = sum(int(touched.sum()) for _, touched in group)
        table[pair] = {
            "actions_per_run": actions / len(runs),
            "deepest_mm": 1e3 * max(float(run.depths[touched].max(initial=0.0)) for run, touched in group),
            "share_that_succeeds": sum(int(run.succeeded[touched].sum()) for run, touched in group) / actions,
        }
    return dict(sorted(table.items(), key=lambda item: -item[1]["actions_per_run"]))


_SMALL, _WIDE = "lattice of 256 states, 20-80 % of the ranges", "lattice of 256 states stretched to 12.5-87.5 %"


@claim("thesis 7.3, fig. 7.8", f"{_SMALL}: the states 60, 124, 188 and 252 are never reached", "never; 189 neither")
def never(runs: Runs) -> Measured:
    small = runs["small"]
    count = sum(set(NEVER) <= set(run.unreached) for run in small)
    too = sorted(_unreached(small).keys() - set(NEVER))
    also = f"; in some also {', '.join(map(str, too))}" if too else ""
    return f"all four unreached in {count} of {len(small)} runs{also}", count == len(small)


@claim(
    "thesis 7.3", f"{_SMALL}: the states 61, 125, 189 and 253 are reached at most 10 times each in 14 597 actions", "2, 3, 0 and 2 times"
)
def rare(runs: Runs) -> Measured:
    visits = np.array([run.visits[list(HARDLY)] for run in runs["small"]])
    others = min(int(np.delete(run.visits, (*NEVER, *HARDLY)).min()) for run in runs["small"])
    text = f"{estimate(visits.ravel(), 1)} times each, at most {visits.max()}; every other state at least {others} times"
    return text, bool(visits.max() <= MAX_RARE_VISITS)


@claim(
    "thesis 7.3",
    f"{_SMALL}: action 57->61 ends in 62, 121->125 in 126, 249->253 in 254, at least 100 times each with a handful of exceptions",
    "225 of 228, 238 of 244, 208 of 213",
)
def deflected(runs: Runs) -> Measured:
    parts, holds = [], True
    for (source, goal), end in DEFLECTED_TO.items():
        ends = [ends_of(run.space, run.seen, source, goal) for run in runs["small"]]
        aside = [found.get(end, 0) for found in ends]
        others = [sum(found.values()) - found.get(end, 0) for found in ends]
        parts.append(f"{source}->{goal}: {estimate(aside, 0)} times in {end}, and {np.mean(others):.1f} (at most {max(others)}) elsewhere")
        holds = holds and min(aside) >= MIN_DEFLECTED and max(others) <= HANDFUL
    return "; ".join(parts), holds


@claim("thesis 7.3", f"{_SMALL}: in spite of static constraints some actions sometimes fail and sometimes succeed", "qualitative")
def random(runs: Runs) -> Measured:
    small, wide = of_each(runs, lambda run: run.uncertain).values()
    text = f"{estimate(small, 0)} actions (stretched lattice {estimate(wide, 0)}) fail in 10 to 90 % of their tries"
    return text, decides(interval(small), least=1.0)


@claim("thesis 7.3, fig. 7.9", f"{_WIDE}: many more (twice as many) states are never reached", "far too many to discuss")
def stretched(runs: Runs) -> Measured:
    few, many = of_each(runs, lambda run: len(run.unreached)).values()
    always = sorted(set.intersection(*(set(run.unreached) for run in runs["stretched"])))
    text = f"{estimate(many, 0)} states, on the other lattice {estimate(few, 0)}; in every run {' '.join(map(str, always))}"
    return text, decides(ratio_interval(many, few), least=MANY_MORE)


def _contacts(runs: Runs) -> dict[str, list[float]]:
    """Return the shares of actions with self-contacts [%] on both lattices."""
    return of_each({"20-80 %": runs["small"], "stretched": runs["stretched"]}, lambda run: 100.0 * float(run.touched.mean()))


_SHARE = "{}: {} % of the actions"


@claim("thesis 7.3", "arm and body touch each other often on both lattices of 256 states (in more than 1 % of the actions)", "qualitative")
def contacts(runs: Runs) -> Measured:
    shares = _contacts(runs)
    each = {lattice: decides(interval(share), least=100.0 * MANY_CONTACTS) for lattice, share in shares.items()}
    return texts(shares, 1, _SHARE), Envelope("lattice", each)


@claim("thesis 7.3", f"{_WIDE}: arm and body touch each other much more often (twice as often)", "qualitative")
def more_contacts(runs: Runs) -> Measured:
    few, many = _contacts(runs).values()
    return texts(_contacts(runs), 1, _SHARE), decides(ratio_interval(many, few), least=MANY_MORE)


@claim("thesis 7.3", f"{_WIDE}: some contacts of arm and body do not change the outcome, and the arm reaches its goal", "qualitative")
def despite(runs: Runs) -> Measured:
    reached = [100.0 * float(run.succeeded[run.touched].mean()) for run in runs["stretched"] if run.touched.any()]
    text = f"{estimate(reached, 0)} % of the actions with a contact reach their goal" if reached else "no contact"
    return text, rises(np.array(reached)) if reached else False


CLAIMS = (never, rare, deflected, random, stretched, contacts, more_contacts, despite)


SIDE = 16  # states along an edge of the map


def plot(found: Cells) -> Any:
    """Draw outcomes, visits, tries and values as in figs. 7.8 and 7.9, and a map of unreached states, in a row for each lattice.

    Returns a matplotlib figure.
    """
    runs = runs_of(found)
    drawing = new_figure(17.0, 5.8 * len(runs))
    grid = drawing.add_gridspec(3 * len(runs), 3, width_ratios=(1.0, 1.0, 1.3))
    for row, (lattice, group) in enumerate(runs.items()):
        rows = slice(3 * row, 3 * row + 3)
        levels = ", ".join(f"{100 * level:g}" for level in LEVELS[lattice])
        _outcomes(drawing.add_subplot(grid[rows, 0]), group[0], f"levels {levels} %: outcomes of one run")
        _map(drawing, drawing.add_subplot(grid[rows, 1]), group, f"visits in {ACTIONS[lattice]} actions, mean of {len(group)} runs")
        _visits(drawing.add_subplot(grid[3 * row, 2]), group)
        exists = exists_in(group[0].space)
        _actions(drawing.add_subplot(grid[3 * row + 1, 2]), "tries", np.array([tries_of(run.space, run.seen)[exists] for run in group]))
        _actions(drawing.add_subplot(grid[3 * row + 2, 2]), "values", np.array([run.values[exists] for run in group]))
    return drawing


def _outcomes(axes: Any, run: Run, title: str) -> None:
    seen, counts = np.unique(run.seen, axis=0, return_counts=True)
    elsewhere = seen[:, 2] != goals_of(run.space, seen)
    states, actions = np.nonzero(exists_in(run.space))
    axes.plot(run.space.goals[states, actions], states, "s", color="0.8", markersize=1.2, label="goal")
    axes.scatter(
        seen[elsewhere, 2], seen[elsewhere, 0], 1.0 + 0.3 * counts[elsewhere], "C3", linewidths=0, label="another state (area: how often)"
    )
    for state in run.unreached:
        axes.axhline(state, color="0.3", linewidth=0.4)
    axes.set(
        title=title, xlabel="state reached", ylabel="from state (lines: never reached)", xlim=(-2, 257), ylim=(257, -2), aspect="equal"
    )
    axes.legend(loc="lower left", fontsize=7, markerscale=2.0)


def _map(drawing: Any, axes: Any, runs: list[Run], title: str) -> None:
    visits = np.mean([run.visits for run in runs], axis=0).reshape(SIDE, SIDE)
    shown = axes.imshow(np.log10(np.maximum(visits, 0.05)), cmap="viridis", origin="lower")
    for state, count in _unreached(runs).items():
        color = "white" if count == len(runs) else "C1"
        axes.text(state % SIDE, state // SIDE, str(state), color=color, fontsize=6, ha="center", va="center")
    for edge in range(4, SIDE, 4):
        axes.axvline(edge - 0.5, color="white", linewidth=0.6)
        axes.axhline(edge - 0.5, color="white", linewidth=0.6)
    axes.set(title=title, xlabel="pitch (4 levels) within roll (4)", ylabel="yaw (4 levels) within elbow (4)", xticks=[], yticks=[])
    drawing.colorbar(shown, ax=axes, shrink=0.5, label="log10 of visits; numbered: never (orange: in some)")


def _visits(axes: Any, runs: list[Run]) -> None:
    visits = np.array([run.visits for run in runs])
    axes.bar(np.arange(visits.shape[1]), visits.mean(axis=0), width=1.0)
    axes.fill_between(np.arange(visits.shape[1]), visits.min(axis=0), visits.max(axis=0), color="k", alpha=0.25, step="mid", linewidth=0)
    axes.set(title="visits (mean, and range over the runs)", xlabel="state", xlim=(-0.5, visits.shape[1] - 0.5))


def _actions(axes: Any, name: str, values: Array) -> None:
    """Draw numbers of every state-action, (runs, state-actions)."""
    numbers = np.arange(values.shape[1])
    axes.fill_between(numbers, values.min(axis=0), values.max(axis=0), color="0.75", step="mid", linewidth=0)
    axes.plot(numbers, values.mean(axis=0), linewidth=0.6)
    axes.set(title=f"{name} (mean, and range over the runs)", xlabel="state-action", xlim=(0, values.shape[1]), ylim=(0, None))


EXPERIMENT = Experiment(
    claim="some of 256 states are never reached, others hardly ever, because the cables deflect the arm, "
    "and more so when the lattice is stretched",
    source="thesis 7.3",
    method=Sweep(conditions, trial, findings, plot),
    claims=CLAIMS,
)
