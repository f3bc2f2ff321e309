# SPDX-License-Identifier: Apache-2.0
"""Change the outcomes of some actions suddenly, and observe how agents with and without forgetting learn the new ones.

Claim: when actions that had always ended in one state suddenly end in another, their value rises sharply; the agent tries them a few times
and so corrects its model.  Our own claim: an agent that forgets old counts corrects its model sooner.
Source: thesis 7.2.6 (where instabilities of the simulator were the cause, and few runs were examined).  Published number: none.
Run time: 3 minutes on 2 cores.

The left arm explores the lattice of rank 3 (81 states).  After 3000 transitions its world changes: either a ball with a radius of 6 cm
appears where the hand is in the middle state, or the friction of the elbow doubles from 4 deg/s, with which the joint still reaches its
goals, to 8 deg/s, with which it sticks.  3000 more transitions follow, from home.  In the runs with friction no action settles, because the
controller continues to drive the elbow; the actions end at the time limit of 8 s.  Walks through both worlds, before and after the change,
measure which actions changed.  The error of the model is the mean L1 error of its debiased counts (observed counts without the imagined
outcomes of the prior) over the changed actions, divided by the error at the change.  Forgetting limits the sum of an action's counts to 1 /
(1 - forgetting), so that its reward does not decrease to 0.  With the factor 0.8, the action with the largest number of different outcomes
always has the highest reward, and a curious agent seldom tries others.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cache, partial
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from experiments.kit.cells import CellResult
from experiments.kit.experiment import OUR_AIM, Claim, Experiment, Measured, Rule, claim, judged
from experiments.kit.learning.arm import arm_plant, arm_space, robot
from experiments.kit.learning.exploration import explore
from experiments.kit.learning.outcomes import Truth, l1, truth_of, walk
from experiments.kit.plots import new_figure
from experiments.kit.rules import all_hold, decides, is_above, of_each, row, texts
from experiments.kit.statistics import estimate, interval
from experiments.kit.sweep import Cells, Condition, Sweep, runs_by
from mobee import CuriousAgent, Gains, Model, MotorParameters, OfflinePlant, World, sphere
from mobee.arrays import Array, Ints
from mobee.errors import InvalidValue

CHANGES = {"object": "a ball enters", "friction": "the elbow's friction doubles"}
AGENTS = (("curious", 1.0), ("curious", 0.95), ("curious", 0.8), ("least_tried", 1.0), ("least_tried", 0.8))  # explorer, forgetting
TRANSITIONS = 3_000  # before the change, and as many after it
QUICK = 0.3  # of the transitions
CHECK_PERIOD = 50  # transitions between two checks of the model
WINDOW = 500  # transitions after the change, in which tries and values are measured
RELEARNED = 0.5  # share of the error at the change, below which the change is relearned
RADIUS = 0.06  # m, of the ball that enters where the hand is in the middle of the lattice
MIDDLE = 40
STICKY = "l_elbow"
FRICTION = np.deg2rad(4.0)  # rad/s, before it doubles
TIMEOUT = 8.0  # s, of an action with friction: the controller continues to drive a motor that sticks, which never settles
TRIES, WALK = 4, 9001  # tries of each action in a walk; its seed, which no run has
MAX_WALK = 3_000  # actions of a walk where not every state can be reached any more
DIFFERENT, SAME = 1.0, 0.2  # L1 distance between an action's outcomes before and after, from which or up to which it counts as such


def plant_of(change: str, is_after: bool, seed: int) -> OfflinePlant:
    """Return an offline plant of the left arm at home, before or after a change of its world.

    `change` "object": after the change, a ball of 6 cm radius is in the space of the arm.  "friction": the elbow has friction, after the
    change twice as much, and actions time out after 8 s.  `seed`: of the plant.
    """
    if change == "object":
        return arm_plant(seed, world=_ball() if is_after else None)
    published = Gains.published_2014()
    friction = np.zeros(len(robot().motors))
    friction[robot().motor_index(STICKY)] = FRICTION * (2.0 if is_after else 1.0)
    gains = replace(published, settle=replace(published.settle, timeout=TIMEOUT))
    return arm_plant(seed, gains=gains, motors=MotorParameters(friction=tuple(friction.tolist())))


def _ball() -> World:
    """Return a world with a ball around the palm in the middle state."""
    space, q = arm_space(), robot().home.copy()
    q[robot().part(space.part).slice] = space.target(MIDDLE)
    world = World()
    world.add("ball", sphere(RADIUS), position=Model(robot()).evaluate(q).position("left_palm"))
    return world


@cache
def truths(change: str) -> tuple[Truth, Truth]:
    """Measure the frequencies of the outcomes of all actions, by a walk before and a walk after a change of the world.

    `change`: "object" or "friction", as in `plant_of`.  A walk tries every action 4 times, in at most 3000 transitions.  The walks have a
    fixed seed, so they are the same in every process.  Returns the frequencies before and after.
    """
    before, after = (
        truth_of(arm_space(), walk(arm_space(), partial(plant_of, change, is_after), TRIES, MAX_WALK, WALK)) for is_after in (False, True)
    )
    return before, after


def compare(before: Truth, after: Truth) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Compare the outcomes of each action before and after the change; returns two masks (S, A): the changed and the unchanged actions.

    An action is changed if the L1 distance of its outcomes is at least DIFFERENT (1.0), and unchanged if it is at most SAME (0.2).  An
    action with a distance between these bounds, or with an unknown outcome, is in neither mask.
    """
    difference: Array = np.where(before.tries > 0, l1(before, after), np.nan)
    return np.nan_to_num(difference) >= DIFFERENT, np.nan_to_num(difference, nan=2.0) <= SAME


def conditions(arguments: argparse.Namespace) -> list[Condition]:
    """Return the settings of the runs: both changes ("object", "friction") with each of five agents.

    An agent has an explorer ("curious" or "least_tried") and a factor by which it forgets old counts.  With --quick the runs have 30 % of
    the transitions.
    """
    share, name = (QUICK, "quick-") if arguments.quick else (1.0, "")
    return [
        Condition(
            f"{name}{change}-{explorer}-f{forgetting:g}",
            {"change": change, "explorer": explorer, "forgetting": forgetting, "transitions": round(share * TRANSITIONS)},
        )
        for change, (explorer, forgetting) in product(CHANGES, AGENTS)
    ]


def trial(settings: dict[str, Any], seed: int) -> dict[str, Any]:
    """Let one agent explore before and after the change, and measure its model after every 50 transitions.

    Returns `seen` (T, 3), the transitions: state, action, state reached.  `series` (checks, 4): the mean L1 error of the changed and of the
    unchanged actions, then the mean value (discounted sum of expected information gains) of the changed and of the unchanged actions
    [nats].  `at_change`: the mean L1 error of the changed actions against their new outcomes, before any transition in the changed world.
    `changed`, `same`: the masks (S, A) of `compare`.  Raises InvalidValue if no action is changed.  `settings`: "change", a key of CHANGES;
    "explorer", the rule by which the agent chooses actions, "curious" or "least_tried"; "forgetting", the factor with which the agent
    forgets; "transitions", their number before the change, and after it.  `seed`: of agent and plant.
    """
    change, known = settings["change"], truths(settings["change"])
    changed, same = compare(*known)
    if not changed.any():
        raise InvalidValue(
            f"the change {change!r}: no action that could be tried before and after has another outcome; make the change larger."
        )
    agent = CuriousAgent(arm_space(), plant_of(change, False, seed), settings["explorer"], seed, forgetting=settings["forgetting"])
    seen, series = [], []
    for is_after in (False, True):
        if is_after:
            agent.plant = plant_of(change, True, seed + 1)
            agent.interrupt()
            at_change = float(np.mean(l1(agent.model.debiased(), known[True])[changed]))
        for _ in range(settings["transitions"] // CHECK_PERIOD):
            seen.append(explore(agent, CHECK_PERIOD))
            error, value = l1(agent.model.debiased(), known[is_after]), agent.plan()[1]
            series.append([float(np.mean(numbers[which])) for numbers in (error, value) for which in (changed, same)])
    return {
        "seen": np.concatenate(seen).astype(np.uint16),
        "series": np.array(series),
        "at_change": at_change,
        "changed": changed,
        "same": same,
    }


def summary(values: dict[str, Any]) -> dict[str, Any]:
    """Reduce the values of `trial` for the raw record: `tried` replaces the transitions `seen`.

    `tried` (checks,) is the number of transitions with a changed action among the 50 transitions before each check.
    """
    kept = {name: value for name, value in values.items() if name != "seen"}
    states, actions, _ = values["seen"].T
    tried = values["changed"].astype(bool)[states, actions].reshape(len(values["series"]), CHECK_PERIOD).sum(axis=1)
    return kept | {"tried": tried.astype(np.uint16)}


@dataclass(frozen=True, eq=False)
class Run:
    """The results of one run: its model was checked after every 50 transitions, and the world changed in the middle.

    `tried` (checks,): number of transitions with a changed action since the previous check.  `series` (checks, 4): mean L1 error of the
    changed and of the unchanged actions, then mean value (discounted sum of expected information gains) of the changed and of the unchanged
    actions [nats].  `at_change`: mean L1 error of the changed actions against their new outcomes, before any transition in the changed
    world.  `changed`, `same`: masks (S, A) of the changed and the unchanged actions.
    """

    tried: Ints
    series: Array
    at_change: float
    changed: NDArray[np.bool_]
    same: NDArray[np.bool_]

    @property
    def checks_before(self) -> int:
        """The number of checks before the change: half of all checks."""
        return len(self.series) // 2

    @property
    def tries(self) -> Array:
        """Relative number of tries of a changed action between two checks, one number for each check, (checks,).

        This is the mean number of tries of the changed actions since the previous check, divided by the mean of all actions.
        """
        relative: Array = self.tried / CHECK_PERIOD * arm_space().state_actions / self.changed.sum()
        return relative

    @property
    def tries_after(self) -> float:
        """The mean of `tries`, the relative number of tries of a changed action, in the first 500 transitions after the change."""
        return float(self.tries[self.checks_before : self.checks_before + WINDOW // CHECK_PERIOD].mean())

    @property
    def tries_before(self) -> float:
        """The mean of `tries`, the relative number of tries of a changed action, in the last 500 transitions before the change."""
        return float(self.tries[self.checks_before - WINDOW // CHECK_PERIOD : self.checks_before].mean())

    @property
    def value_jump(self) -> float:
        """The largest value of the changed actions in the first 500 transitions after the change, divided by their last value before it.

        The values are recorded at the checks, after every 50 transitions; each is the mean over all changed actions.
        """
        return self._jump(self.checks_before)

    @property
    def value_jump_before(self) -> float:
        """The same ratio as `value_jump`, but for the last 500 transitions before the change; it serves for comparison.

        It is the largest value of the changed actions in these transitions, divided by their value just before these transitions.
        """
        return self._jump(self.checks_before - WINDOW // CHECK_PERIOD)

    def _jump(self, check: int) -> float:
        values = self.series[:, 2]
        return float(values[check : check + WINDOW // CHECK_PERIOD].max() / values[check - 1])

    @property
    def errors(self) -> Array:
        """The mean L1 error of the changed actions after the change, divided by the error at the change, (checks_after,).

        The model is checked after every 50 transitions; `checks_after` is the number of these checks after the change.
        """
        relative: Array = self.series[self.checks_before :, 0] / self.at_change
        return relative

    @property
    def error_left(self) -> float:
        """The L1 error of the changed actions at the end of the run, divided by the error at the change."""
        return float(self.errors[-1])

    @property
    def relearned(self) -> float:
        """The number of transitions after the change until the error of the changed actions is halved; inf if it never is."""
        small = np.flatnonzero(self.errors <= RELEARNED)
        return float(CHECK_PERIOD * (small[0] + 1)) if len(small) else float("inf")

    @property
    def relearned_within(self) -> float:
        """The same number as `relearned`; if the error is never halved, the number of all transitions after the change."""
        return float(min(self.relearned, CHECK_PERIOD * (len(self.series) - self.checks_before)))


Runs = Mapping[tuple[str, str, float], list[Run]]  # by change, explorer and forgetting
Number = Callable[[Run], float]


def runs_of(found: Cells) -> Runs:
    """Group the finished runs by (change, explorer, forgetting); each group is sorted by seed."""

    def of(result: CellResult) -> Run:
        values = result.values
        changed, same = (values[name].astype(bool) for name in ("changed", "same"))
        return Run(values["tried"].astype(np.intp), values["series"], values["at_change"], changed, same)

    return runs_by(found, of, "change", "explorer", "forgetting")


COLUMNS: dict[str, Number] = {
    "number_of_changed_actions": lambda run: float(run.changed.sum()),
    "relative_tries_before": lambda run: run.tries_before,
    "relative_tries_after": lambda run: run.tries_after,
    "value_after_over_before": lambda run: run.value_jump,
    "relative_error_at_end": lambda run: run.error_left,
    "transitions_until_error_is_halved": lambda run: run.relearned_within,
}


def findings(found: Cells) -> dict[str, Any]:
    """Return the results as a dict with two keys, "agents" and "claims".

    "agents" is a dict from "change; agent" to a row: the number of runs ("seeds"), and means of the numbers in COLUMNS.  "claims" is a list
    with the claims, their measured values and their verdicts, as dicts (`Claim.record`).  If not every agent was run in full with both
    changes, all claims stay unmeasured and are not judged.
    """
    runs = runs_of(found)
    keys = [(change, *agent) for change, agent in product(CHANGES, AGENTS)]
    whole = all(runs.get(key) for key in keys) and len(runs[keys[0]][0].series) == 2 * TRANSITIONS // CHECK_PERIOD
    rows = {f"{CHANGES[key[0]]}; {_agent(*key[1:])}": row(runs[key], COLUMNS) for key in keys if key in runs}
    return {"agents": rows, "claims": judged(CLAIMS, runs, whole)}


def _above(number: Number, control: Number, rival: str, text: str) -> Rule:
    """Return a rule: a number of the curious agent's runs is above 1 and above a number of the rival's runs, for both changes of the world.

    Neither agent forgets.  `number`, `control`: functions that compute the number from a run of the curious agent and of the rival.
    `rival`: explorer of the rival; if it is "curious", two numbers of the same runs are compared.  `text`: format for the change and both
    numbers.
    """

    def of_runs(runs: Runs) -> Measured:
        parts, holds = list[str](), list[bool | None]()
        for change in CHANGES:
            here, there = [number(run) for run in runs[change, "curious", 1.0]], [control(run) for run in runs[change, rival, 1.0]]
            parts.append(text.format(CHANGES[change], estimate(here), estimate(there)))
            holds += [decides(interval(here), least=1.0), is_above(here, there)]
        return "; ".join(parts), all_hold(holds)

    return of_runs


def _sooner(explorer: str, forgetting: float) -> Rule:
    """Return the rule that an agent that forgets relearns sooner than one that does not, with both changes."""

    def of_runs(runs: Runs) -> Measured:
        parts, holds = list[str](), list[bool | None]()
        for change in CHANGES:
            groups = [runs[change, explorer, factor] for factor in (forgetting, 1.0)]
            values = [[run.relearned_within for run in group] for group in groups]
            never = [sum(np.isinf(run.relearned) for run in group) for group in groups]
            with_, without = (f"{estimate(group, 0)} ({count} runs not relearned)" for group, count in zip(values, never, strict=True))
            parts.append(f"{CHANGES[change]}: {with_}, without forgetting {without}")
            holds.append(is_above(values[1], values[0]))
        return "; ".join(parts), all_hold(holds)

    return of_runs


value = Claim(
    "thesis 7.2.6",
    "the value of actions whose outcome suddenly changes shoots up: highest value soon after over the value before",
    "shot up",
    rule=_above(lambda run: run.value_jump, lambda run: run.value_jump_before, "curious", "{}: {}, without a change {}"),
)
tried = Claim(
    "thesis 7.2.6",
    f"the curious agent tries actions with changed outcomes more often: tries over the mean of all in the next {WINDOW} transitions",
    "a few times",
    rule=_above(lambda run: run.tries_after, lambda run: run.tries_after, "least_tried", "{}: curious {}, least tried {}"),
)


@claim(
    "thesis 7.2.6",
    "the curious agent corrects its model of changed outcomes: L1 error at the end over that at the change",
    "qualitative",
)
def corrected(runs: Runs) -> Measured:
    left = of_each({name: runs[change, "curious", 1.0] for change, name in CHANGES.items()}, lambda run: run.error_left)
    return texts(left, form="{}: {}"), all_hold(decides(interval(errors), most=RELEARNED) for errors in left.values())


CLAIMS = (
    value,
    tried,
    corrected,
    *(
        Claim(
            OUR_AIM,
            f"a {agent} agent that forgets old counts (factor {factor:g}) relearns sooner: "
            "transitions until the error of changed outcomes is halved",
            "sooner",
            rule=_sooner(agent.replace("-", "_"), factor),
        )
        for agent, factor in (("curious", 0.95), ("least-tried", 0.8))
    ),
)


STYLES = dict(zip(AGENTS, (("C3", "-"), ("C1", "--"), ("C3", ":"), ("C0", "-"), ("C0", ":")), strict=True))
TITLES = ("relative tries of changed actions", "value of changed actions [nats]", "L1 error of changed actions")


def _agent(explorer: str, forgetting: float) -> str:
    return explorer.replace("_", " ") + ("" if forgetting == 1.0 else f", forgetting {forgetting:g}")


def plot(found: Cells) -> Any:
    """Draw tries, value and L1 error of the changed actions over the transitions, a row of panels for each change.

    Returns a matplotlib figure.
    """
    runs = runs_of(found)
    changes = [change for change in CHANGES if any(key[0] == change for key in runs)]
    drawing = new_figure(16.0, 4.0 * len(changes))
    for panels, change in zip(drawing.subplots(len(changes), 3, squeeze=False), changes, strict=True):
        for (explorer, forgetting), style in STYLES.items():
            if group := runs.get((change, explorer, forgetting)):
                _curves(panels, group, style, _agent(explorer, forgetting))
        before = next(group[0].checks_before for key, group in runs.items() if key[0] == change)
        for axes, title in zip(panels, TITLES, strict=True):
            axes.axvline(CHECK_PERIOD * before, color="k", linewidth=0.6)
            axes.set_title(f"{CHANGES[change]}: {title}", fontsize=9)
            axes.set(xlabel="transitions", ylim=(0.0, None))
        panels[0].legend(fontsize=7)
    return drawing


def _curves(panels: Any, runs: list[Run], style: tuple[str, str], label: str) -> None:
    tries = np.mean([_smooth(run.tries) for run in runs], axis=0)
    errors, values = (np.mean([run.series[:, column] for run in runs], axis=0) for column in (0, 2))
    for axes, curve in zip(panels, (tries, values, errors), strict=True):
        axes.plot(CHECK_PERIOD * (np.arange(len(curve)) + 1), curve, style[1], color=style[0], label=label, linewidth=1.0)


def _smooth(rate: Array) -> Array:
    """Return the moving mean of `rate` (checks,) over each check of the model and the three before it, (checks,).

    Before the first check, the first value is repeated.
    """
    padded = np.concatenate([np.full(3, rate[0]), rate])
    return np.convolve(padded, np.full(4, 0.25), mode="valid")


EXPERIMENT = Experiment(
    claim="actions whose outcome suddenly changes are tried until the model is correct again; sooner with forgetting",
    source="thesis 7.2.6",
    method=Sweep(conditions, trial, findings, plot, summary=summary),
    claims=CLAIMS,
)
