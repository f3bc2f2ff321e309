# SPDX-License-Identifier: Apache-2.0
"""Let the curious agent discover the shoulder's cable constraints on a lattice of 81 states, with different discounts and priors.

Claim: on 81 states and 432 actions every state-action is tried 5 times after 2987 actions (prior 50-50: before any try, one imagined
failure and one success) or after 2651 (prior 60-40: one failure and two successes).  The states 24, 51 and 78 are hard to enter, because
some actions towards them fail.  Actions from these states are tried less often; the difference is smaller for agents that plan farther
ahead (larger discount).  An agent that expects success (60-40) tries the failing actions most often.  Source: thesis 7.2.2 to 7.2.5, figs.
7.4, 7.6 and 7.7; 5 runs per setting.  Run time: 2 minutes on 2 cores.

The agent moves the left arm, with its cable constraints and self-contacts, from a random state until every state-action was tried 5 times;
discounts are 0.5, 0.9 and 0.99, with both priors.  A state-action fails when it does not end in its goal state.  Actions are written as
source->goal, because the thesis numbers the state-actions without stating their order.  The thesis and the paper do not state below which
speed an action has settled (ended), nor how strong the forces of the cable constraints are.  So all runs are repeated with the extreme
values that the original programs suggest: settle speeds of 0.6 and 1.2 deg/s, and a largest force of 1300 deg/s^2.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from experiments.kit.cells import CellResult
from experiments.kit.experiment import Claim, Envelope, Experiment, Measured, judged
from experiments.kit.learning.arm import arm_plant, arm_space
from experiments.kit.learning.exploration import LeastTries, begin_anywhere, explore
from experiments.kit.learning.outcomes import exists_in, failures_of, uncertain_of, visits_of
from experiments.kit.plots import draw_stacked_bars, new_figure
from experiments.kit.rules import all_hold, decides, is_above, of_each, rises, row, texts, within
from experiments.kit.statistics import estimate, interquartile_mean, interval, ratio_estimate, relative_spread
from experiments.kit.sweep import Cells, Condition, Sweep, runs_by
from mobee import CuriousAgent, Gains, Lattice
from mobee.arrays import Array, Ints

DISCOUNTS = (0.5, 0.9, 0.99)
INITIAL = ("50-50", "60-40")
MIN_TRIES = 5  # of each action, after which a run ends
MAX_TRANSITIONS = 20_000  # of a run in which an action is never possible
LAWS: dict[str, Callable[[Gains], Gains]] = {  # within what the texts leave open; the first is used elsewhere
    "as published": lambda gains: gains,
    "settle speed 0.6 deg/s": lambda gains: replace(gains, settle=replace(gains.settle, speed=np.deg2rad(0.6))),
    "settle speed 1.2 deg/s": lambda gains: replace(gains, settle=replace(gains.settle, speed=np.deg2rad(1.2))),
    "cable force 1300 deg/s^2": lambda gains: replace(gains, max_constraint=np.deg2rad(1300.0)),
}
PUBLISHED_LAW = next(iter(LAWS))
PUBLISHED = {"50-50": 2987, "60-40": 2651}  # actions until each was tried 5 times
TOLERANCE = 0.1  # of a published number of actions
MIN_FAILING, MAX_ENTERING_FAIL = 0.5, 0.1  # shares of tries, of actions that fail and of actions that succeed
MIN_CORRELATION = 0.5
HARD = (24, 51, 78)  # the thesis' states that are hard to enter: pitch low, roll and yaw high, any elbow
FAILING = ((15, 24), (42, 51), (69, 78))  # (source, goal), in red in fig. 7.4
ENTERING = ((21, 24), (48, 51), (75, 78))  # actions into the same states that succeed

Action = tuple[int, int]  # source and goal state


def conditions(arguments: argparse.Namespace) -> list[Condition]:
    """Return the settings of the runs: one for each law, prior ("50-50", "60-40") and discount (0.5, 0.9, 0.99).

    A law is the published control law, or the same law with another settle speed (below which an action has settled) or cable force.  With
    --quick, only the published law is run, and a run ends when each action was tried once instead of 5 times.
    """
    least, name = (1, "quick-") if arguments.quick else (MIN_TRIES, "")
    return [
        Condition(f"{name}{number}-{initial}-g{discount:g}", {"law": law, "initial": initial, "discount": discount, "least": least})
        for number, law in enumerate([*LAWS][: 1 if arguments.quick else None])
        for initial, discount in product(INITIAL, DISCOUNTS)
    ]


def trial(settings: dict[str, Any], seed: int) -> dict[str, Any]:
    """Explore until every action was tried 5 times (or as often as the setting `least` says), at most 20 000 transitions.

    Returns `seen` (T, 3), the transitions: state, action, state reached; and for each of the (81, 8) actions its `tries` and its `values`
    [nats] at the end.  `settings`: "law", a key of LAWS; "discount" and "initial", as for `CuriousAgent`; "least".  `seed`: of agent and
    plant.
    """
    space, plant = arm_space(), arm_plant(seed, gains=LAWS[settings["law"]](Gains.published_2014()))
    begin_anywhere(space, plant, seed)
    agent = CuriousAgent(space, plant, seed=seed, discount=settings["discount"], initial=settings["initial"])
    seen = explore(agent, MAX_TRANSITIONS, LeastTries(settings["least"], space.state_actions))
    return {
        "seen": seen.astype(np.uint16),
        "tries": agent.model.tries.astype(np.uint16),
        "values": agent.plan()[1].astype(np.float32),
    }


def summary(values: dict[str, Any]) -> dict[str, Any]:
    """Reduce the values of `trial` for the raw record (files that are kept in the repository): counts replace the transitions `seen`.

    Returns `visits` (81,) of the states, `failures` and `tries` (81, 8) of the actions, and the `values` (81, 8) [nats] at the end.
    """
    space, seen = arm_space(), values["seen"]
    counts = {"visits": visits_of(space, seen), "failures": failures_of(space, seen), "tries": values["tries"]}
    return {name: count.astype(np.uint16) for name, count in counts.items()} | {"values": values["values"].astype(np.float16)}


@dataclass(frozen=True, eq=False)
class Run:
    """The results of one exploration of the lattice `space`, which has 81 states with at most 8 actions.

    `visits` (81,): how often each state was reached.  `tries`, `failures` (81, 8): how often each action was tried, and how often it did
    not end in its goal state.  `values` (81, 8): values of the actions at the end [nats].
    """

    space: Lattice
    visits: Ints
    failures: Ints
    tries: Ints
    values: Array

    @property
    def transitions(self) -> float:
        """The number of transitions of the run."""
        return float(self.visits.sum())

    @property
    def uncertain(self) -> float:
        """The number of actions that failed in 10 to 90 % of their tries."""
        return float(uncertain_of(self.failures, self.tries))

    @property
    def exists(self) -> NDArray[np.bool_]:
        """The mask (81, 8) of the actions that exist: states at the border of the lattice have fewer than 8."""
        return exists_in(self.space)

    @property
    def hard_visits(self) -> float:
        """The mean visits of the states 24, 51 and 78, divided by the mean visits of all states.

        These states are hard to enter, because constraints make actions into them fail (thesis 7.2.5).
        """
        return float(self.visits[list(HARD)].mean() / self.visits.mean())

    def share_failed(self, actions: Sequence[Action]) -> float:
        """Return the share of failures in all tries of these actions, given as pairs of source and goal state."""
        at = tuple(np.array([self.index(action) for action in actions]).T)
        return float(self.failures[at].sum() / self.tries[at].sum())

    def relative_tries(self, actions: Sequence[Action]) -> float:
        """Return the mean tries of these actions (source, goal), divided by the mean tries of all actions."""
        return float(np.mean([self.tries[self.index(action)] for action in actions]) / self.tries[self.exists].mean())

    def index(self, action: Action) -> tuple[int, int]:
        """Return the row and column of an action (source, goal) in the arrays (81, 8)."""
        return action[0], int(np.flatnonzero(self.space.actions(action[0]) == action[1])[0])

    @property
    def out_of_hard(self) -> list[Action]:
        """All actions that start in the states 24, 51 and 78, which are hard to enter, as pairs of source and goal state."""
        return [(state, int(goal)) for state in HARD for goal in self.space.actions(state)]


Groups = Mapping[tuple[str, float], list[Run]]  # by prior and discount
Laws = Mapping[str, Groups]


def groups(found: Cells) -> Laws:
    """Return a dict from the control law, one of `LAWS`, to a dict from (prior, discount) to the finished runs, sorted by seed."""

    def of(result: CellResult) -> Run:
        visits, failures, tries = (result.values[name].astype(np.intp) for name in ("visits", "failures", "tries"))
        return Run(arm_space(), visits, failures, tries, result.values["values"].astype(float))

    every = runs_by(found, of, "law", "initial", "discount")
    each = {law: {key[1:]: runs for key, runs in sorted(every.items()) if key[0] == law} for law in LAWS}
    return {law: grouped for law, grouped in each.items() if grouped}


COLUMNS: dict[str, Callable[[Run], float]] = {
    "relative_visits_of_24_51_78": lambda run: run.hard_visits,
    "relative_tries_from_24_51_78": lambda run: run.relative_tries(run.out_of_hard),
    "relative_tries_of_failing_actions": lambda run: run.relative_tries(FAILING),
    "relative_tries_of_entering_actions": lambda run: run.relative_tries(ENTERING),
    "failing_actions_fail": lambda run: run.share_failed(FAILING),
    "entering_actions_fail": lambda run: run.share_failed(ENTERING),
    "mean_value": lambda run: float(run.values[run.exists].mean()),
}


def findings(found: Cells) -> dict[str, Any]:
    """Return the results as a dict with two keys, "runs" and "claims".

    "runs" is a dict from each combination of control law, prior and discount to a row: "seeds", "actions" with its interval "low" to
    "high", and means of the numbers in COLUMNS; the laws are the published one and its variants in `LAWS`.  "claims" is a list with the
    claims, their measured values and their verdicts, as dicts (`Claim.record`).  If runs of the published law are missing for some prior or
    discount, all claims stay unmeasured and are not judged.
    """
    laws, rows = groups(found), {}
    for law, grouped in laws.items():
        for (initial, discount), runs in grouped.items():
            actions = [run.transitions for run in runs]
            low, high = interval(actions)
            made = {"seeds": len(runs), "actions": interquartile_mean(actions), "low": low, "high": high}
            rows[f"{law}, {initial}, discount {discount:g}"] = made | row(runs, COLUMNS)
    whole = set(product(INITIAL, DISCOUNTS)) <= set(laws.get(PUBLISHED_LAW, {}))
    return {"runs": rows, "claims": judged(CLAIMS, laws, whole)}


def _with_prior(grouped: Groups, initial: str, number: Callable[[Run], float]) -> dict[float, list[float]]:
    """Return a number of each run that started with the prior `initial`, as a list for each discount.

    `initial`: the imagined outcomes before any try, "50-50" or "60-40".  `number`: function that computes the number from a run.
    """
    return of_each({discount: grouped[initial, discount] for discount in DISCOUNTS}, number)


def _every(grouped: Groups) -> list[Run]:
    return [run for runs in grouped.values() for run in runs]


def _law_claim(source: str, text: str, published: str, rule: Callable[[Groups], Measured]) -> Claim:
    """Return a claim that is judged separately under each control law in `LAWS` (variants of settle speed and cable force)."""
    return Claim(source, text, published, rule=rule, varies="law")


def _number(initial: str, grouped: Groups) -> Measured:
    actions = _with_prior(grouped, initial, lambda run: run.transitions)
    text = "; ".join(f"{estimate(counts, 0)} at discount {discount:g}" for discount, counts in actions.items())
    bounds = PUBLISHED[initial] * (1.0 - TOLERANCE), PUBLISHED[initial] * (1.0 + TOLERANCE)
    return text, Envelope("discount", {f"{discount:g}": decides(interval(counts), *bounds) for discount, counts in actions.items()})


numbers = [
    _law_claim(
        f"thesis 7.2.2, fig. {figure}",
        f"prior {initial}: number of actions until every state-action was tried 5 times, within 10 %",
        f"{actions}, for three discounts",
        partial(_number, initial),
    )
    for (initial, actions), figure in zip(PUBLISHED.items(), ("7.6", "7.7"), strict=True)
]


def _sooner(grouped: Groups) -> Measured:
    optimistic, even = (_with_prior(grouped, prior, lambda run: run.transitions) for prior in ("60-40", "50-50"))
    text = ", ".join(f"{ratio_estimate(optimistic[discount], even[discount])} at discount {discount:g}" for discount in DISCOUNTS)
    return text, Envelope("discount", {f"{d:g}": is_above(even[d], optimistic[d]) for d in DISCOUNTS})


sooner = _law_claim(
    "thesis 7.2.2, figs. 7.6, 7.7",
    "with the prior 60-40 fewer actions are needed until each was tried 5 times than with 50-50: their ratio",
    "0.89 (2651 / 2987)",
    _sooner,
)


def _least_visited(grouped: Groups) -> Measured:
    every = _every(grouped)
    others = [float(np.sort(np.delete(run.visits, HARD))[: len(HARD)].mean() / run.visits.mean()) for run in every]
    hard = [run.hard_visits for run in every]
    together = np.argsort(sum(run.visits for run in every), kind="stable")[: len(HARD)].tolist()
    text = (
        f"{', '.join(map(str, sorted(together)))} in all runs together; visits over the mean of all states: {estimate(hard)},"
        f" the three least visited others {estimate(others)}"
    )
    return text, rises(np.array(others) - np.array(hard))


least_visited = _law_claim("thesis 7.2.5", "the least visited of the 81 states are 24, 51 and 78", "those three", _least_visited)


def _share(actions: Sequence[Action], least: float, most: float, grouped: Groups) -> Measured:
    """Judge whether the share of failures of each action lies within bounds."""
    shares = {f"{s}->{g}": [run.share_failed([(s, g)]) for run in _every(grouped)] for s, g in actions}
    return texts(shares, form="{}: {}"), all_hold(decides(interval(values), least, most) for values in shares.values())


fail = _law_claim(
    "thesis 7.2.5, fig. 7.4",
    "the actions 15->24, 42->51 and 69->78 (from state -> to state) fail in more than half of their tries: share of failures",
    "infeasible",
    partial(_share, FAILING, MIN_FAILING, np.inf),
)
enter = _law_claim(
    "thesis 7.2.5",
    "other actions into the states 24, 51 and 78 succeed in at least 90 %: share of failures",
    "succeed",
    partial(_share, ENTERING, -np.inf, MAX_ENTERING_FAIL),
)
_TRIES = "tries over the mean of all actions: "


def _by_discount(number: Callable[[Run], float], least: float, most: float, grouped: Groups) -> Measured:
    """Judge how often some actions are tried, relative to the mean of all actions, in the runs with the prior 50-50.

    Two conditions must hold: at the smallest discount this number is between `least` and `most`, and at the largest discount it is larger
    than at the smallest.  `number`: function that computes it from a run.
    """
    values = _with_prior(grouped, "50-50", number)
    first, *_, last = values.values()
    return _TRIES + texts(values, form="{1} at discount {0}"), all_hold([decides(interval(first), least, most), is_above(last, first)])


spikes = _law_claim(
    "thesis 7.2.5, fig. 7.6",
    "prior 50-50: the actions that succeed in entering 24, 51 and 78 are tried more often than the average action, and more so with a "
    "larger discount",
    "spikes",
    partial(_by_discount, lambda run: run.relative_tries(ENTERING), 1.0, np.inf),
)
dips = _law_claim(
    "thesis 7.2.5, fig. 7.6",
    "prior 50-50: actions from 24, 51 and 78 are tried less often than the average action, and less so with a larger discount",
    "dips",
    partial(_by_discount, lambda run: run.relative_tries(run.out_of_hard), -np.inf, 1.0),
)


def _peaks(grouped: Groups) -> Measured:
    values, even = (_with_prior(grouped, prior, lambda run: run.relative_tries(FAILING)) for prior in ("60-40", "50-50"))
    text = f"{_TRIES}{texts(values, form='{1} at discount {0}')}; prior 50-50: {estimate(sum(even.values(), []))}"
    return text, all_hold(decides(interval(numbers), least=1.0) for numbers in values.values())


peaks = _law_claim(
    "thesis 7.2.5, fig. 7.7",
    "prior 60-40: the failing actions into 24, 51 and 78 are tried more often than the average action, at every discount",
    "peaks at 80, 230, 378",
    _peaks,
)


def _degree(grouped: Groups) -> Measured:
    from scipy.stats import spearmanr  # a second

    goals = arm_space().goals
    actions = np.bincount(goals[goals >= 0], minlength=len(goals))
    correlations = [float(spearmanr(actions, run.visits).statistic) for run in _every(grouped)]
    return within(correlations, least=MIN_CORRELATION, text="rank correlation {}")


degree = _law_claim(
    "thesis 7.2.3",
    "states into which more actions lead are visited more often: correlation of visits and number of actions, at least 0.5",
    "qualitative",
    _degree,
)


def _uniform(grouped: Groups) -> Measured:
    every = _every(grouped)
    tries, visits = [relative_spread(run.tries[run.exists]) for run in every], [relative_spread(run.visits) for run in every]
    return f"standard deviation over mean: tries {estimate(tries)}, visits {estimate(visits)}", is_above(visits, tries)


uniform = _law_claim("thesis 7.2.4", "tries of state-actions are more uniform than visits of states", "qualitative", _uniform)


def _stochastic(grouped: Groups) -> Measured:
    return within(
        [run.uncertain for run in _every(grouped)], 1, least=1.0, text="{} of 432 actions per run fail in 10 to 90 % of their tries"
    )


stochastic = _law_claim(
    "thesis 7.2.5",
    "static constraints make outcomes uncertain: in a run at least one action sometimes fails and sometimes succeeds",
    "qualitative",
    _stochastic,
)


CLAIMS = (*numbers, sooner, least_visited, fail, enter, spikes, dips, peaks, degree, uniform, stochastic)


def plot(found: Cells) -> Any:
    """Draw tries and values of every state-action under the published law, as in figs. 7.6 and 7.7.

    The figure has a row of panels for each prior and discount, and a colour for each run.  Returns a matplotlib figure.  Raises
    InvalidValue if no run of the published law is finished.
    """
    grouped = groups(found).get(PUBLISHED_LAW, {})
    drawing = new_figure(15.0, 2.3 * len(grouped))
    for panels, ((initial, discount), runs) in zip(drawing.subplots(len(grouped), 2, squeeze=False), grouped.items(), strict=True):
        mean = np.mean([run.transitions for run in runs])
        _bars(panels[0], runs, [run.tries for run in runs])
        panels[0].set_title(f"tries, {initial}, discount {discount:g}: {len(runs)} runs of {mean:.0f} actions on average", fontsize=9)
        _bars(panels[1], runs, [np.maximum(run.values, 0.0) for run in runs])
        panels[1].set_title(f"values, {initial}, discount {discount:g}", fontsize=9)
    for axes in panels:
        axes.set_xlabel("state-action; grey: from states 24, 51, 78; triangles: the failing 15->24, 42->51, 69->78")
    return drawing


def _bars(axes: Any, runs: list[Run], given: Sequence[Any]) -> None:
    """Draw a bar for each state-action, in the order of the source states; the values of the runs are stacked in it.

    The actions from the states 24, 51 and 78 (HARD) have a grey background, and the actions in FAILING a mark.  `given`: for each run an
    array (81, 8) of tries or values.
    """
    exists = runs[0].exists
    number = np.cumsum(exists.ravel()).reshape(exists.shape) - 1
    heights = draw_stacked_bars(axes, [values[exists].astype(float) for values in given])
    for state in HARD:
        actions = number[state][exists[state]]
        axes.axvspan(actions[0] - 0.5, actions[-1] + 0.5, color="0.8", zorder=0)
    at = [number[runs[0].index(action)] for action in FAILING]
    axes.plot(at, heights[at] + 0.04 * heights.max(), "kv", markersize=4)
    axes.set_xlim(-0.5, len(heights) - 0.5)


EXPERIMENT = Experiment(
    claim="three of 81 states are hard to enter, because actions into them fail; agents that plan farther ahead or expect success "
    "try more there",
    source="thesis 7.2.2-7.2.5",
    method=Sweep(conditions, trial, findings, plot, summary=summary),
    claims=CLAIMS,
)
