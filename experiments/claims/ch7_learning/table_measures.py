# SPDX-License-Identifier: Apache-2.0
"""Measures of runs at the table: contact of the arms with it, interest in it, cycles of contact, and actions that depend on other parts.

Contact is computed from poses alone, in the same way for tables that exert forces and for ghosts.

A graph of 16 neighbours has preferred actions of its own, so tries are compared with those of the same agent at a ghost of the table.

Contact is cyclic if the autocorrelation of the contact rate has a second peak, at a period, and that of a ghost has none.  High values at
the first lags only mean that contacts come in bouts.

At a ghost no part disturbs another, except for hands that meet.  So an action that ends elsewhere at the table than at the ghost depends on
the poses of the other parts (paper 4.4).  Which actions do is taken from the runs of other seeds than the judged one.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from experiments.kit.cells import CellResult
from experiments.kit.learning.arm import ARM_NEIGHBOURS, LEFT, RANK3, RIGHT, TORSO, arm_space, robot, table_world, torso_space
from experiments.kit.learning.outcomes import UNCERTAIN, goals_of, tries_of
from experiments.kit.statistics import interval
from experiments.kit.sweep import Cells, runs_by
from mobee import Lattice, Model, World, box
from mobee.arrays import Array, Ints
from mobee.model.contact import links_moved

PROPAGATIONS = ("tree", "part")  # contact forces act on the whole kinematic tree, or only up to the root of a part
EXPLORERS, WORLDS = ("curious", "least_tried", "random"), ("table", "ghost")
JOINTS = {"left_arm": LEFT, "right_arm": RIGHT}
ARMS = tuple(JOINTS)
PARTS = ("torso", *ARMS)
FORWARD_STATES = slice(18, 27)  # of the torso: pitch at its third level
WINDOW = 50  # transitions of an arm over which the contact rate is the mean
NEAR_DISTANCE = 0.02  # m between a field and the table's surface (paper, fig. 8: hand or elbow "within 2 cm of the table")
FORWARD = np.deg2rad(30.0)  # rad, torso pitch from which the torso is bent forward
BATCH = 2000  # poses that are evaluated at once
TOP_SHARE = 0.05  # share of the actions
BOUT = 2  # lags at which slow changes and bouts explain high values
PERIODS = 3  # least number of periods in a run: the longest period is a third of it
DIFFERENT = 0.1  # total variation between the outcomes at the table and at the ghost, from which an action depends on other parts
LEARNERS = {"torso": ("torso",), "arms": ARMS}  # both arms have the same graph


@cache
def spaces() -> dict[str, Lattice]:
    """Return the lattice of each part; both arms have the same graph."""
    return {"torso": torso_space(), **{arm: arm_space(RANK3, ARM_NEIGHBOURS, joints=joints) for arm, joints in JOINTS.items()}}


@cache
def low() -> NDArray[np.bool_]:
    """Return which of the arms' states (81,) lie below the table's top when the torso is bent, for one arm or the other."""
    either: NDArray[np.bool_] = low_goals(ARMS[0]) | low_goals(ARMS[1])
    return either


def world_around(margin: float) -> World:
    """Return a world with a table that is larger by a margin [m] on every side."""
    table = table_world().objects["table"]
    larger = World()
    size = [edge + 2.0 * margin for edge in table.size]
    larger.add("table", box(*size), position=table.position, rotation=table.rotation)
    return larger


def near_table(q: Array, arm: str, margin: float = NEAR_DISTANCE) -> NDArray[np.bool_]:
    """Return in which poses q (N, n) rad a field of the arm is nearer to the table than the margin [m], (N,)."""
    model, moved = Model(robot(), world_around(margin)), np.array(sorted(links_moved(robot())[arm]))
    near = np.zeros(len(q), dtype=bool)
    for first in range(0, len(q), BATCH):
        table = model.evaluate(q[first : first + BATCH]).table
        rows = (table.second_link < 0) & (table.kind == 1) & np.isin(table.first_link, moved)
        near[first + table.pose[rows]] = True
    return near


def low_goals(arm: str) -> NDArray[np.bool_]:
    """Return which states (81,) of an arm lie below the table's top when the torso is bent forward (75 % of its range)."""
    space, pitch = arm_space(joints=JOINTS[arm]), robot().motor_index(TORSO[2])
    q = np.tile(robot().home, (len(space), 1))
    low, high = robot().limits[pitch]
    q[:, pitch] = low + RANK3[-1] * (high - low)
    q[:, robot().part(arm).slice] = [space.target(state) for state in range(len(space))]
    return near_table(q, arm, 0.0)


def is_forward(q: Array) -> NDArray[np.bool_]:
    """Return in which poses q (N, n) rad the torso is bent forward, (N,)."""
    bent: NDArray[np.bool_] = q[:, robot().motor_index(TORSO[2])] > FORWARD
    return bent


def summary(values: dict[str, Any]) -> dict[str, Any]:
    """Reduce the values of a trial to the numbers and counts from which the claims and the figure are computed.

    Returns of each part: how often each action ended in each state, as indices in (S, A, S) and counts, its tries in the second half, and
    the share of timeouts; of the arms the contact rate in windows, and in parts of the run; and hours of plant time.
    """
    seen = {part: values[f"seen_{part}"].astype(np.intp) for part in PARTS}
    touch, forward = (np.array([values[f"{name}_{arm}"] for arm in ARMS], dtype=bool) for name in ("touch", "forward"))
    count = touch.shape[1]
    late, third, windows = slice(count // 2, None), count // 3, count // WINDOW
    goals = np.array([goals_of(spaces()[arm], seen[arm]) for arm in ARMS])
    found: dict[str, Any] = {
        "transitions": count,
        "touch_rate": touch[:, : windows * WINDOW].reshape(2, windows, WINDOW).mean(axis=(0, 2)),
        "touch": float(touch[:, late].mean()),
        "growth": float(touch[:, -third:].mean() - touch[:, :third].mean()),
        "low_and_forward": float((low()[goals] & forward)[:, late].mean()),
        "hours": float(max(values[f"ends_{part}"][-1] for part in PARTS)) / 3600.0,
    }
    for part, transitions in seen.items():
        space = spaces()[part]
        ends = np.zeros((*space.goals.shape, len(space)), dtype=np.uint16)
        np.add.at(ends, tuple(transitions.T), 1)
        at = np.flatnonzero(ends)
        found |= {f"ends_at_{part}": at.astype(np.uint32), f"ends_{part}": ends.ravel()[at]}
        found[f"late_tries_{part}"] = tries_of(space, transitions[late]).astype(np.uint16)
        found[f"timeouts_{part}"] = float(1.0 - values[f"settled_{part}"].mean())
    return found


@dataclass(frozen=True, eq=False)
class Run:
    """One run of three agents, from its `summary`."""

    result: CellResult

    @property
    def seed(self) -> int:
        """The seed of agents and encoders."""
        return self.result.cell.seed

    def number(self, name: str) -> float:
        """Return a number of the summary."""
        return float(self.result.values[name])

    @cached_property
    def ends(self) -> dict[str, Ints]:
        """How often each action of a part ended in each state, (S, A, S)."""
        found = {part: np.zeros((*spaces()[part].goals.shape, len(spaces()[part])), dtype=np.int32) for part in PARTS}
        for part, counts in found.items():
            counts.ravel()[self.result.values[f"ends_at_{part}"]] = self.result.values[f"ends_{part}"]
        return found

    @cached_property
    def tries(self) -> dict[str, Ints]:
        """Tries of each part's actions, (S, A)."""
        return {part: ends.sum(axis=-1) for part, ends in self.ends.items()}

    @cached_property
    def late_tries(self) -> dict[str, Ints]:
        """Tries of each part's actions in the second half, (S, A)."""
        return {part: self.result.values[f"late_tries_{part}"].astype(np.intp) for part in PARTS}

    @cached_property
    def outcomes(self) -> dict[str, Ints]:
        """The number of states in which each action of a part ended, (S, A)."""
        return {part: (ends > 0).sum(axis=-1) for part, ends in self.ends.items()}

    @cached_property
    def outcome_numbers(self) -> Ints:
        """The number of states in which each action ended, of all tried actions of all parts."""
        every = np.concatenate([self.outcomes[part].ravel() for part in PARTS])
        return every[every > 0]

    @property
    def touch(self) -> float:
        """The share of the arms' actions that ended in contact with the table, in the second half."""
        return self.number("touch")

    @property
    def touch_rate(self) -> Array:
        """The share of actions that ended in contact, in windows of WINDOW transitions of each arm."""
        rate: Array = self.result.values["touch_rate"]
        return rate

    @property
    def growth(self) -> float:
        """The contact rate of the last third minus that of the first."""
        return self.number("growth")

    @property
    def torso_forward(self) -> float:
        """Mean tries of the torso's actions that lean forward over those of its other actions, in the second half."""
        tries, goals = self.late_tries["torso"], spaces()["torso"].goals
        forward = (goals >= FORWARD_STATES.start) & (goals < FORWARD_STATES.stop)
        return float(tries[forward].mean() / tries[~forward].mean())

    @property
    def low_and_forward(self) -> float:
        """The share of the arms' actions with a low goal that ended while the torso was bent, in the second half."""
        return self.number("low_and_forward")

    @property
    def arms_low(self) -> float:
        """Mean tries of the arms' actions with a low goal over those of the other actions, in the second half."""
        tries = np.sum([self.late_tries[arm] for arm in ARMS], axis=0)
        aims_low = low()[spaces()[ARMS[0]].goals]
        return float(tries[aims_low].mean() / tries[~aims_low].mean())

    @property
    def half_failing(self) -> int:
        """The number of actions of both arms that failed in 10 to 90 % of their tries."""
        return sum(self._uncertain(arm) for arm in ARMS)

    def _uncertain(self, arm: str) -> int:
        goals = np.maximum(spaces()[arm].goals, 0)
        reached = np.take_along_axis(self.ends[arm], goals[..., None], axis=-1)[..., 0]
        with np.errstate(invalid="ignore"):
            failed = 1.0 - reached / self.tries[arm]
        return int(((failed > UNCERTAIN[0]) & (failed < UNCERTAIN[1])).sum())

    @property
    def timeouts(self) -> dict[str, float]:
        """The share of a part's actions that timed out."""
        return {part: self.number(f"timeouts_{part}") for part in PARTS}

    @property
    def hours(self) -> float:
        """Hours of plant time until the slowest agent was finished."""
        return self.number("hours")


Runs = Mapping[tuple[str, str], list[Run]]  # by explorer and world


def runs_of(found: Cells) -> dict[str, Runs]:
    """Return the finished runs by propagation of the forces, of each condition by seed, in the order of the conditions."""
    grouped = runs_by(found, Run, "propagate", "explorer", "world")
    forces: dict[str, dict[tuple[str, str], list[Run]]] = {}
    for propagate, *key in product(PROPAGATIONS, EXPLORERS, WORLDS):
        if (propagate, *key) in grouped:
            forces.setdefault(propagate, {})[key[0], key[1]] = grouped[propagate, *key]
    return dict(forces)


def with_ghosts(runs: Runs, explorer: str) -> list[tuple[Run, Run]]:
    """Return each run at the table with the run of the same seed at the ghost."""
    ghosts = {run.seed: run for run in runs.get((explorer, "ghost"), [])}
    return [(run, ghosts[run.seed]) for run in runs.get((explorer, "table"), []) if run.seed in ghosts]


def log_ratios(run: Run, ghost: Run, part: str) -> Array:
    """Return the logarithm of each action's tries at the table over those at the ghost, (S, A)."""
    ratios: Array = np.log((run.tries[part] + 1.0) / (ghost.tries[part] + 1.0))
    return ratios


def of_arms(run: Run, ghost: Run) -> Array:
    """Return the log ratios of both arms, (2, S, A)."""
    return np.array([log_ratios(run, ghost, arm) for arm in ARMS])


def by_goal(ratios: Array) -> Array:
    """Return the ratios (2 arms, S, A) averaged over all actions with the same goal state: (2, S) by goal, 0 where no action leads."""
    goals = spaces()[ARMS[0]].goals
    count = np.bincount(goals.ravel(), minlength=len(goals))
    return np.array([np.bincount(goals.ravel(), weights=ratio.ravel(), minlength=len(goals)) / np.maximum(count, 1) for ratio in ratios])


def agreement(pair: Array) -> float:
    """Return the rank correlation of the two arms."""
    from scipy.stats import spearmanr  # a second

    return float(spearmanr(pair[0].ravel(), pair[1].ravel()).statistic)


def autocorrelation(rate: Array, most: int) -> Array:
    """Return the autocorrelation of a series without its linear trend, at the lags 0 to `most`, (most + 1,)."""
    steps = np.arange(len(rate))
    residuals = rate - np.polyval(np.polyfit(steps, rate, 1), steps)
    products = [float((residuals[lag:] * residuals[: len(residuals) - lag]).sum()) for lag in range(most + 1)]
    return np.array(products) / products[0]


def share_of_top(ratios: Array, chosen: NDArray[np.bool_]) -> float:
    """Return the share of chosen actions (S, A) among those with the highest ratios, mean of both arms."""
    count = max(1, round(TOP_SHARE * ratios[0].size))
    return float(np.mean([chosen.ravel()[np.argsort(-ratio, axis=None)[:count]].mean() for ratio in ratios]))


def correlations(runs: Sequence[Run]) -> Array:
    """Return the autocorrelation of each run's contact rate up to the longest period, (runs, lags)."""
    return np.array([autocorrelation(run.touch_rate, len(run.touch_rate) // PERIODS) for run in runs])


def second_peak(curves: Array) -> int:
    """Return the lag at which the mean of autocorrelations (runs, lags) is highest after it first fell below 0, or after BOUT."""
    mean = curves.mean(axis=0)
    fallen = np.flatnonzero(mean[BOUT + 1 :] < 0.0)
    first = BOUT + 1 + (int(fallen[0]) if len(fallen) else 0)
    return first + int(np.argmax(mean[first:]))


def at_second_peak(ours: Array, theirs: Array) -> tuple[list[float], list[float]]:
    """Return the autocorrelation of each run, and of its ghost, at the second peak of the other runs; at least two runs."""
    lags = [second_peak(np.delete(ours, run, axis=0)) for run in range(len(ours))]
    here, there = ([float(curve[lag]) for curve, lag in zip(curves, lags, strict=True)] for curves in (ours, theirs))
    return here, there


def is_cyclic(ours: Array, theirs: Array) -> bool | None:
    """Return whether there is a second peak, above 0 and above the ghosts' by the intervals over two or more runs.

    False if, in addition, the highest values of the runs beyond the lag BOUT are not above those of the ghosts; None if they are, but
    without a common peak.
    """
    here, there = at_second_peak(ours, theirs)
    if interval(here)[0] > max(0.0, interval(there)[1]):
        return True
    highest, ghosts = (curves[:, BOUT + 1 :].max(axis=1) for curves in (ours, theirs))
    return None if interval(highest)[0] > interval(ghosts)[1] else False


SCORES: dict[str, Callable[[Run, Run, str], Array]] = {
    "tries": lambda run, ghost, part: run.tries[part].astype(float),
    "beside_ghost": log_ratios,
}


@dataclass(frozen=True, eq=False)
class Judged:
    """Which of a learner's actions in one run depend on other parts, (parts, actions), those with the highest scores first.

    Its numbers are means over the parts, because the two arms of a run are not independent runs.
    """

    hits: NDArray[np.bool_]

    @property
    def chance(self) -> float:
        """The share of actions that depend on other parts."""
        return float(self.hits.mean())

    @property
    def at_all(self) -> float:
        """The precision (equal to the recall) if as many actions are called dependent as really depend on other parts."""
        return float(self.hits[:, : int(self.hits[0].sum())].mean())

    @property
    def precision(self) -> Array:
        """The precision when the first k actions are called dependent, for every k."""
        found: Array = (np.cumsum(self.hits, axis=1) / np.arange(1, self.hits.shape[1] + 1)).mean(axis=0)
        return found

    @property
    def recall(self) -> Array:
        """The recall when the first k actions are called dependent, for every k."""
        found: Array = (np.cumsum(self.hits, axis=1) / self.hits.sum(axis=1, keepdims=True)).mean(axis=0)
        return found


def dependent(runs: Runs, parts: Sequence[str], but: int) -> NDArray[np.bool_]:
    """Return which actions (S, A) of these parts end differently at the table than at the ghost, by the runs of all seeds except `but`."""
    shares = []
    for world in ("table", "ghost"):
        others = [run for explorer in EXPLORERS for run in runs.get((explorer, world), []) if run.seed != but]
        empty = np.zeros((*spaces()[parts[0]].goals.shape, len(spaces()[parts[0]])))
        counts = sum((run.ends[part] for run in others for part in parts), start=empty)
        shares.append(counts / np.maximum(counts.sum(axis=-1, keepdims=True), 1.0))
    different: NDArray[np.bool_] = 0.5 * np.abs(shares[0] - shares[1]).sum(axis=-1) > DIFFERENT
    return different


def judged_of(runs: Runs, explorer: str, learner: str, score: str) -> list[Judged]:
    """Judge every run of an explorer; empty if there is no other seed, or no action depends on other parts in the other seeds' runs."""
    found = []
    for run, ghost in with_ghosts(runs, explorer):
        truth = dependent(runs, LEARNERS[learner], run.seed)
        if truth.any():
            ranked = (SCORES[score](run, ghost, part) for part in LEARNERS[learner])
            found.append(Judged(np.array([truth.ravel()[np.argsort(-values, axis=None, kind="stable")] for values in ranked])))
    return found
