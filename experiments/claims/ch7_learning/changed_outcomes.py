"""Change: what does the curious agent do when its actions suddenly end elsewhere?

Claim: when actions that had always ended in one state suddenly end in another, they become very interesting, their value shoots up, the
agent tries them out a few times and so mends its model.  Ours: one that forgets old counts should mend it sooner.
Source: thesis 7.2.6 (there the simulator's instabilities were the cause, and few runs were examined).  Published number: none.
Run time: 3 minutes on 2 cores.

The left arm on the lattice of rank 3.  After 3000 transitions a ball of 6 cm enters where the hand is in the middle state, or the
friction of the elbow doubles, from 4 deg/s, with which it arrives, to 8, with which it sticks; 3000 more follow, from home.  With
friction no action ever seems settled, for the controller goes on asking the motor: actions end after 8 s.  Which actions changed is
measured by walks through both worlds.  The model's error is that of debiased counts, L1, where they changed; the remaining error, and
how long half of it takes, are relative to the error at the change itself, before the first transition after it.  Forgetting bounds an
action's counts, to 1 / (1 - forgetting), and so its reward from below: with 0.8 whatever has most outcomes stays the most interesting
indefinitely, and a curious agent tries little else.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from experiments.kit.cells import CellResult
from experiments.kit.experiment import Claim, Experiment
from experiments.kit.learning.arm import arm_plant, arm_space, robot
from experiments.kit.learning.exploration import explore
from experiments.kit.learning.truth import Truth, l1, truth_of, walk
from experiments.kit.plots import new_figure
from experiments.kit.statistics import estimate, interval, mean_over
from experiments.kit.sweep import Cells, Condition, Sweep, grouped_by
from mobee import CuriousAgent, Gains, Model, MotorParameters, OfflinePlant, World, sphere
from mobee.arrays import Array, Ints
from mobee.errors import InvalidValue

CHANGES = {"object": "a ball enters", "friction": "the elbow's friction doubles"}
AGENTS = (("curious", 1.0), ("curious", 0.95), ("curious", 0.8), ("least_tried", 1.0), ("least_tried", 0.8))  # explorer, forgetting
BEFORE = 3_000  # transitions, and as many after the change
QUICK = 0.3  # of the transitions
EVERY = 50  # transitions between two checks of the model
SOON = 500  # transitions after the change
RELEARNED = 0.5  # of the error at the change
RADIUS = 0.06  # m, of the ball that enters where the hand is in the middle of the lattice
MIDDLE = 40
STICKY = "l_elbow"
FRICTION = np.deg2rad(4.0)  # rad/s, before it doubles
PATIENCE = 8.0  # s, timeout where friction is: a controller that goes on asking a motor that sticks never seems settled
TRIES, WALK = 4, 9001  # of each action in a walk; its seed, which no run has
LONGEST_WALK = 3_000  # actions, where not every state can be reached any more
DIFFERENT, SAME = 1.0, 0.2  # L1 between an action's outcomes before and after

VALUE = Claim("thesis 7.2.6", "the value of actions that suddenly end elsewhere shoots up: over that before", "shot up")
TRIED = Claim("thesis 7.2.6", "the agent becomes interested in them: tries over the mean of all in the next 500", "a few times")
MENDED = Claim("thesis 7.2.6", "so it improves its model: error (L1) where they changed, at the end over that at the change", "qualitative")
SOONER = Claim(
    "aim of this reproduction", "a curious agent that forgets (0.95) relearns sooner: transitions until the error is halved", "sooner"
)
FORGETTER = Claim("aim of this reproduction", "so does a least-tried agent that forgets (0.8)", "sooner")
CLAIMS = (VALUE, TRIED, MENDED, SOONER, FORGETTER)


def plant_of(change: str, is_after: bool, seed: int) -> OfflinePlant:
    """The left arm before or after an "object" has entered its space, or the elbow's "friction" has doubled; at home."""
    if change == "object":
        return arm_plant(seed, world=_ball() if is_after else None)
    published = Gains.published_2014()
    friction = np.zeros(len(robot().motors))
    friction[robot().motor_index(STICKY)] = FRICTION * (2.0 if is_after else 1.0)
    gains = replace(published, settle=replace(published.settle, timeout=PATIENCE))
    return arm_plant(seed, gains=gains, motors=MotorParameters(friction=tuple(friction.tolist())))


def _ball() -> World:
    """A ball around the palm in the middle state."""
    space, q = arm_space(), robot().home.copy()
    q[robot().part(space.part).slice] = space.target(MIDDLE)
    world = World()
    world.add("ball", sphere(RADIUS), position=Model(robot()).evaluate(q).position("left_palm"))
    return world


@cache
def truths(change: str) -> tuple[Truth, Truth]:
    """Outcomes before and after, by a walk through each world; the same in every process, which measures them once."""
    before, after = (
        truth_of(arm_space(), walk(arm_space(), partial(plant_of, change, is_after), TRIES, LONGEST_WALK, WALK))
        for is_after in (False, True)
    )
    return before, after


def compare(before: Truth, after: Truth) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Which actions (S, A) end elsewhere since the change, and which where they did; neither where that is not known."""
    difference: Array = np.where(before.tries > 0, l1(before, after), np.nan)
    return np.nan_to_num(difference) >= DIFFERENT, np.nan_to_num(difference, nan=2.0) <= SAME


def conditions(arguments: argparse.Namespace) -> list[Condition]:
    """Every change with every agent; the short version makes a third of the transitions."""
    share, name = (QUICK, "quick-") if arguments.quick else (1.0, "")
    return [
        Condition(
            f"{name}{change}-{explorer}-f{forgetting:g}",
            {"change": change, "explorer": explorer, "forgetting": forgetting, "transitions": round(share * BEFORE)},
        )
        for change, (explorer, forgetting) in product(CHANGES, AGENTS)
    ]


def trial(settings: dict[str, Any], seed: int) -> dict[str, Any]:
    """Explore before and after the change.

    Transitions (T, 3); at every check of the model error and value of what changed and of what did not, (checks, 4); and the error of
    what changed at the change, before anything was tried after it.
    """
    change, known = settings["change"], truths(settings["change"])
    changed, same = compare(*known)
    if not changed.any():
        raise InvalidValue(f"the change {change!r}: no action that could be tried before and after ends elsewhere; make it larger.")
    agent = CuriousAgent(arm_space(), plant_of(change, False, seed), settings["explorer"], seed, forgetting=settings["forgetting"])
    seen, series = [], []
    for is_after in (False, True):
        if is_after:
            agent.plant = plant_of(change, True, seed + 1)
            agent.interrupt()
            at_change = float(np.mean(l1(agent.model.debiased(), known[True])[changed]))
        for _ in range(settings["transitions"] // EVERY):
            seen.append(explore(agent, EVERY))
            error, value = l1(agent.model.debiased(), known[is_after]), agent.plan()[1]
            series.append([float(np.mean(numbers[which])) for numbers in (error, value) for which in (changed, same)])
    return {
        "seen": np.concatenate(seen).astype(np.uint16),
        "series": np.array(series),
        "at_change": at_change,
        "changed": changed,
        "same": same,
    }


@dataclass(frozen=True, eq=False)
class Run:
    """One run, see `trial`."""

    seen: Ints
    series: Array  # (checks, 4): errors then values, each of what changed and of what did not
    at_change: float  # error of what changed, before the first transition after the change
    changed: NDArray[np.bool_]
    same: NDArray[np.bool_]

    @property
    def checks_before(self) -> int:
        """Checks of the model before the change, as many as after."""
        return len(self.series) // 2

    @property
    def tries(self) -> Array:
        """How often an action that changed was tried between two checks, over the mean of all actions, (checks,)."""
        tried = self.changed[self.seen[:, 0], self.seen[:, 1]].reshape(len(self.series), -1).mean(axis=1)
        relative: Array = tried * arm_space().state_actions / self.changed.sum()
        return relative

    @property
    def eagerness(self) -> float:
        """The mean of `tries` soon after the change."""
        return float(self.tries[self.checks_before : self.checks_before + SOON // EVERY].mean())

    @property
    def eagerness_before(self) -> float:
        """The mean of `tries` as long before the change."""
        return float(self.tries[self.checks_before - SOON // EVERY : self.checks_before].mean())

    @property
    def value_jump(self) -> float:
        """The highest value of what changed soon after, over that just before."""
        return self._jump(self.checks_before)

    @property
    def value_jump_before(self) -> float:
        """`value_jump` where nothing has changed: over the last transitions before."""
        return self._jump(self.checks_before - SOON // EVERY)

    def _jump(self, check: int) -> float:
        values = self.series[:, 2]
        return float(values[check : check + SOON // EVERY].max() / values[check - 1])

    @property
    def errors(self) -> Array:
        """L1 where actions changed, after the change, over that at the change; (checks,)."""
        relative: Array = self.series[self.checks_before :, 0] / self.at_change
        return relative

    @property
    def error_left(self) -> float:
        """The last of `errors`."""
        return float(self.errors[-1])

    @property
    def relearned(self) -> float:
        """Transitions after the change until half of that error is gone; infinite if it never is."""
        small = np.flatnonzero(self.errors <= RELEARNED)
        return float(EVERY * (small[0] + 1)) if len(small) else float("inf")

    @property
    def relearned_within(self) -> float:
        """`relearned`, or the transitions that were made after the change, whichever is less."""
        return float(min(self.relearned, EVERY * (len(self.series) - self.checks_before)))


Runs = Mapping[tuple[str, str, float], list[Run]]  # change, explorer, forgetting


def runs_of(found: Cells) -> Runs:
    """The finished runs of each condition."""
    return {key: [_run(result) for result in mine] for key, mine in grouped_by(found, "change", "explorer", "forgetting").items()}


def _run(result: CellResult) -> Run:
    values = result.values
    changed, same = (values[name].astype(bool) for name in ("changed", "same"))
    return Run(values["seen"].astype(np.intp), values["series"], values["at_change"], changed, same)


def findings(found: Cells) -> dict[str, Any]:
    """A row for each condition; the claims if all were run in full."""
    runs = runs_of(found)
    keys = [(change, *agent) for change, agent in product(CHANGES, AGENTS)]
    whole = all(runs.get(key) for key in keys) and len(runs[keys[0]][0].series) == 2 * BEFORE // EVERY
    rows = {"{}, {}, forgetting {:g}".format(*key): _row(runs[key]) for key in keys if key in runs}
    return {"agents": rows, "claims": [claim.record() for claim in (measured(runs) if whole else CLAIMS)]}


def _row(runs: Sequence[Run]) -> dict[str, float]:
    return {
        "seeds": len(runs),
        "changed_actions": mean_over(runs, lambda run: float(run.changed.sum())),
        "tries_before": mean_over(runs, lambda run: run.eagerness_before),
        "tries_after": mean_over(runs, lambda run: run.eagerness),
        "value_jump": mean_over(runs, lambda run: run.value_jump),
        "error_left": mean_over(runs, lambda run: run.error_left),
        "relearned_after": mean_over(runs, lambda run: run.relearned_within),
    }


def measured(runs: Runs) -> list[Claim]:
    """The claims with our numbers, of the runs of all conditions."""
    curious, least = ({change: runs[change, explorer, 1.0] for change in CHANGES} for explorer in ("curious", "least_tried"))
    left = {change: [run.error_left for run in mine] for change, mine in curious.items()}
    text = ", ".join(f"{change} {estimate(mine)}" for change, mine in left.items())
    return [
        _above(VALUE, curious, curious, lambda run: run.value_jump, lambda run: run.value_jump_before, "{} {}, as long before {}"),
        _above(TRIED, curious, least, lambda run: run.eagerness, lambda run: run.eagerness, "{}: {}, least tried {}"),
        MENDED.measured(text, all(interval(mine)[1] <= RELEARNED for mine in left.values())),
        _sooner(SOONER, runs, "curious", 0.95),
        _sooner(FORGETTER, runs, "least_tried", 0.8),
    ]


ByChange = Mapping[str, list[Run]]
Number = Callable[[Run], float]


def _above(claim: Claim, ours: ByChange, theirs: ByChange, number: Number, control: Number, text: str) -> Claim:
    """Whether our number is above 1 and above the control in theirs, by the intervals, with both changes."""
    parts, holds = [], True
    for change in CHANGES:
        here, there = [number(run) for run in ours[change]], [control(run) for run in theirs[change]]
        parts.append(text.format(change, estimate(here), estimate(there)))
        holds = holds and interval(here)[0] > max(1.0, interval(there)[1])
    return claim.measured("; ".join(parts), holds)


def _sooner(claim: Claim, runs: Runs, explorer: str, forgetting: float) -> Claim:
    parts, holds = [], True
    for change in CHANGES:
        forgot, kept = runs[change, explorer, forgetting], runs[change, explorer, 1.0]
        values = [[run.relearned_within for run in mine] for mine in (forgot, kept)]
        never = [sum(np.isinf(run.relearned) for run in mine) for mine in (forgot, kept)]
        forgetful, lasting = (f"{estimate(mine, 0)} (not within the run: {count})" for mine, count in zip(values, never, strict=True))
        parts.append(f"{change}: {forgetful}, without forgetting {lasting}")
        holds = holds and interval(values[0])[1] < interval(values[1])[0]
    return claim.measured("; ".join(parts), holds)


STYLES = dict(zip(AGENTS, (("C3", "-"), ("C1", "--"), ("C3", ":"), ("C0", "-"), ("C0", ":")), strict=True))
COLUMNS = ("tries of what changed, over the mean of all", "value of what changed [nats]", "L1 error where it changed")


def plot(found: Cells) -> Any:
    """Tries, value and error of what changed, over time: a row a change."""
    runs = runs_of(found)
    changes = [change for change in CHANGES if any(key[0] == change for key in runs)]
    drawing = new_figure(16.0, 4.0 * len(changes))
    for row, change in zip(drawing.subplots(len(changes), 3, squeeze=False), changes, strict=True):
        for (explorer, forgetting), style in STYLES.items():
            if mine := runs.get((change, explorer, forgetting)):
                _curves(row, mine, style, f"{explorer.replace('_', ' ')}, forgetting {forgetting:g}")
        before = next(mine[0].checks_before for key, mine in runs.items() if key[0] == change)
        for axes, title in zip(row, COLUMNS, strict=True):
            axes.axvline(EVERY * before, color="k", linewidth=0.6)
            axes.set_title(f"{CHANGES[change]}: {title}", fontsize=9)
            axes.set(xlabel="transitions", ylim=(0.0, None))
        row[0].legend(fontsize=7)
    return drawing


def _curves(row: Any, runs: list[Run], style: tuple[str, str], label: str) -> None:
    tries = np.mean([_smooth(run.tries) for run in runs], axis=0)
    errors, values = (np.mean([run.series[:, column] for run in runs], axis=0) for column in (0, 2))
    for axes, curve in zip(row, (tries, values, errors), strict=True):
        axes.plot(EVERY * (np.arange(len(curve)) + 1), curve, style[1], color=style[0], label=label, linewidth=1.0)


def _smooth(rate: Array) -> Array:
    """Means over the last four checks."""
    padded = np.concatenate([np.full(3, rate[0]), rate])
    return np.convolve(padded, np.full(4, 0.25), mode="valid")


EXPERIMENT = Experiment(
    name="changed-outcomes",
    claim="actions that suddenly end elsewhere become interesting, and are tried until the model is right again; sooner with forgetting",
    source="thesis 7.2.6",
    notes=__doc__,
    method=Sweep(conditions, trial, findings, plot),
    claims=CLAIMS,
)
