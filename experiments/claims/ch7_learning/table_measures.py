# SPDX-License-Identifier: Apache-2.0
"""Measures of runs at the table: contact of the arms, preferred actions, cycles of contact, and actions that depend on other parts.

A ghost of the table is an object at the same place that exerts no force.  Contact is computed from poses alone, in the same manner for the
table and its ghost.

In a graph in which each state has actions to 16 neighbours, some actions are tried more often than others even without a table.  So tries
are compared with those of an agent with the same seed at the ghost.

Contact is cyclic if the autocorrelation of the contact rate at the table has a second peak, whose lag is the period of the cycle, and the
autocorrelation at the ghost has no such peak.  High values at the first lags only mean that contacts occur in groups.

At a ghost no part (torso or arm) disturbs another, except that the hands can meet.  So an action that ends elsewhere at the table than at
the ghost depends on the poses of the other parts (section 4.4 of the paper in Frontiers in Neurorobotics 7:25).  For each judged run, these
actions are found in the runs of all other seeds.
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
    """Return a dict from the part ("torso", "left_arm", "right_arm") to its lattice; both arms have the same graph."""
    return {"torso": torso_space(), **{arm: arm_space(RANK3, ARM_NEIGHBOURS, joints=joints) for arm, joints in JOINTS.items()}}


@cache
def low() -> NDArray[np.bool_]:
    """Return which states (81,) bring the left or the right arm into contact with the table when the torso is bent forward."""
    either: NDArray[np.bool_] = low_goals(ARMS[0]) | low_goals(ARMS[1])
    return either


def world_around(margin: float) -> World:
    """Return a world with the table alone, made larger by `margin` [m] on every side."""
    table = table_world().objects["table"]
    larger = World()
    size = [edge + 2.0 * margin for edge in table.size]
    larger.add("table", box(*size), position=table.position, rotation=table.rotation)
    return larger


def near_table(q: Array, arm: str, margin: float = NEAR_DISTANCE) -> NDArray[np.bool_]:
    """Return in which poses a field (volume that causes repulsive forces) of the arm is nearer to the table than `margin` [m], (N,).

    `q`: (N, n) rad, poses of the robot.  `arm`: "left_arm" or "right_arm".
    """
    model, moved = Model(robot(), world_around(margin)), np.array(sorted(links_moved(robot())[arm]))
    near = np.zeros(len(q), dtype=bool)
    for first in range(0, len(q), BATCH):
        table = model.evaluate(q[first : first + BATCH]).table
        rows = (table.second_link < 0) & (table.kind == 1) & np.isin(table.first_link, moved)
        near[first + table.pose[rows]] = True
    return near


def low_goals(arm: str) -> NDArray[np.bool_]:
    """Return in which states (81,) the arm overlaps the table when the torso is bent forward (75 % of its pitch range).

    The arm overlaps the table if one of its fields does; a field is a volume around a link that causes repulsive forces.
    """
    space, pitch = arm_space(joints=JOINTS[arm]), robot().motor_index(TORSO[2])
    q = np.tile(robot().home, (len(space), 1))
    low, high = robot().limits[pitch]
    q[:, pitch] = low + RANK3[-1] * (high - low)
    q[:, robot().part(arm).slice] = [space.target(state) for state in range(len(space))]
    return near_table(q, arm, 0.0)


def is_forward(q: Array) -> NDArray[np.bool_]:
    """Return in which poses `q` (N, n) rad of the robot the torso is bent forward by more than 30 degrees, (N,)."""
    bent: NDArray[np.bool_] = q[:, robot().motor_index(TORSO[2])] > FORWARD
    return bent


def summary(values: dict[str, Any]) -> dict[str, Any]:
    """Reduce the values of a trial at the table to the numbers and counts from which claims and figure are computed.

    Returns for each part, with its name at the end of the key, how often each action ended in each state: `ends_at`, the flat indices of
    the non-zero entries of the table (S, A, S), and `ends`, these entries.  Also `late_tries` (S, A), tries in the second half, and
    `timeouts`, the share of actions that timed out.  For the arms together, `touch_rate`, the contact rate in windows of 50 transitions,
    and `touch`, `growth` and `low_and_forward` as in `Run`.  `hours`: plant time; `transitions`: of each part.
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
    """One run of the three agents of torso and arms; `result`: the stored result of the run, with the values of `summary`."""

    result: CellResult

    @property
    def seed(self) -> int:
        """The seed of the agents and of the encoder noise."""
        return self.result.cell.seed

    def number(self, name: str) -> float:
        """Return the number with this name in the values of `summary`."""
        return float(self.result.values[name])

    @cached_property
    def ends(self) -> dict[str, Ints]:
        """A dict from the part to how often each of its actions ended in each state, (S, A, S)."""
        found = {part: np.zeros((*spaces()[part].goals.shape, len(spaces()[part])), dtype=np.int32) for part in PARTS}
        for part, counts in found.items():
            counts.ravel()[self.result.values[f"ends_at_{part}"]] = self.result.values[f"ends_{part}"]
        return found

    @cached_property
    def tries(self) -> dict[str, Ints]:
        """A dict from the part to the number of tries of each of its actions, (S, A)."""
        return {part: ends.sum(axis=-1) for part, ends in self.ends.items()}

    @cached_property
    def late_tries(self) -> dict[str, Ints]:
        """A dict from the part to the number of tries of each of its actions in the second half of the run, (S, A)."""
        return {part: self.result.values[f"late_tries_{part}"].astype(np.intp) for part in PARTS}

    @cached_property
    def outcomes(self) -> dict[str, Ints]:
        """A dict from the part to the number of different states in which each of its actions ended, (S, A)."""
        return {part: (ends > 0).sum(axis=-1) for part, ends in self.ends.items()}

    @cached_property
    def outcome_numbers(self) -> Ints:
        """The number of different states in which an action ended, for every tried action of all parts, (E,)."""
        every = np.concatenate([self.outcomes[part].ravel() for part in PARTS])
        return every[every > 0]

    @property
    def touch(self) -> float:
        """The share of the arms' actions in the second half of the run that ended within 2 cm of the table (or ghost)."""
        return self.number("touch")

    @property
    def touch_rate(self) -> Array:
        """The share of the arms' actions that ended within 2 cm of the table, in windows of 50 transitions of each arm, (windows,)."""
        rate: Array = self.result.values["touch_rate"]
        return rate

    @property
    def growth(self) -> float:
        """The contact rate in the last third of the run minus that in the first third."""
        return self.number("growth")

    @property
    def torso_forward(self) -> float:
        """How often the torso leans forward, in the second half of the run.

        This is the mean number of tries of its actions with a goal state that leans forward, divided by that of its other actions.
        """
        tries, goals = self.late_tries["torso"], spaces()["torso"].goals
        forward = (goals >= FORWARD_STATES.start) & (goals < FORWARD_STATES.stop)
        return float(tries[forward].mean() / tries[~forward].mean())

    @property
    def low_and_forward(self) -> float:
        """The share of the arms' actions in the second half that had a low goal and ended while the torso was bent forward.

        A goal is low if it brings an arm into contact with the table when the torso is bent forward.
        """
        return self.number("low_and_forward")

    @property
    def arms_low(self) -> float:
        """How often the arms choose actions with a low goal, in the second half of the run.

        This is the mean number of tries of these actions, divided by that of the arms' other actions.  A goal is low if it brings an arm
        into contact with the table when the torso is bent forward.
        """
        tries = np.sum([self.late_tries[arm] for arm in ARMS], axis=0)
        aims_low = low()[spaces()[ARMS[0]].goals]
        return float(tries[aims_low].mean() / tries[~aims_low].mean())

    @property
    def half_failing(self) -> int:
        """The number of actions of both arms that did not reach their goals in 10 to 90 % of their tries."""
        return sum(self._uncertain(arm) for arm in ARMS)

    def _uncertain(self, arm: str) -> int:
        goals = np.maximum(spaces()[arm].goals, 0)
        reached = np.take_along_axis(self.ends[arm], goals[..., None], axis=-1)[..., 0]
        with np.errstate(invalid="ignore"):
            failed = 1.0 - reached / self.tries[arm]
        return int(((failed > UNCERTAIN[0]) & (failed < UNCERTAIN[1])).sum())

    @property
    def timeouts(self) -> dict[str, float]:
        """A dict from the part to the share of its actions that timed out."""
        return {part: self.number(f"timeouts_{part}") for part in PARTS}

    @property
    def hours(self) -> float:
        """The plant time in hours until every agent had made its transitions."""
        return self.number("hours")


Runs = Mapping[tuple[str, str], list[Run]]  # by explorer and world


def runs_of(found: Cells) -> dict[str, Runs]:
    """Return the finished runs: a dict from "tree" or "part" to a dict from (explorer, world) to a list of runs.

    "tree": a contact force acts on all motors from the link down to the base; "part": only on those of the link's part.  Each group is
    sorted by seed; groups without a finished run are absent.
    """
    grouped = runs_by(found, Run, "propagate", "explorer", "world")
    forces: dict[str, dict[tuple[str, str], list[Run]]] = {}
    for propagate, *key in product(PROPAGATIONS, EXPLORERS, WORLDS):
        if (propagate, *key) in grouped:
            forces.setdefault(propagate, {})[key[0], key[1]] = grouped[propagate, *key]
    return dict(forces)


def with_ghosts(runs: Runs, explorer: str) -> list[tuple[Run, Run]]:
    """Return pairs of runs of an explorer with the same seed: one at the table, and one at its ghost, which exerts no force."""
    ghosts = {run.seed: run for run in runs.get((explorer, "ghost"), [])}
    return [(run, ghosts[run.seed]) for run in runs.get((explorer, "table"), []) if run.seed in ghosts]


def log_ratios(run: Run, ghost: Run, part: str) -> Array:
    """Return the logarithm of (tries at the table + 1) / (tries at the ghost + 1) of each action of a part, (S, A).

    `run`: at the table.  `ghost`: the run of the same seed at the table's ghost, which exerts no force.
    """
    ratios: Array = np.log((run.tries[part] + 1.0) / (ghost.tries[part] + 1.0))
    return ratios


def of_arms(run: Run, ghost: Run) -> Array:
    """Return the `log_ratios` of the actions of both arms, (2, S, A)."""
    return np.array([log_ratios(run, ghost, arm) for arm in ARMS])


def by_goal(ratios: Array) -> Array:
    """Average the ratios (2 arms, S, A) over all actions with the same goal state; returns (2, S), indexed by the goal state.

    `ratios`: the `log_ratios` of tries at table and ghost, as `of_arms` returns them.  The result is 0 for a state that is the goal of no
    action.
    """
    goals = spaces()[ARMS[0]].goals
    count = np.bincount(goals.ravel(), minlength=len(goals))
    return np.array([np.bincount(goals.ravel(), weights=ratio.ravel(), minlength=len(goals)) / np.maximum(count, 1) for ratio in ratios])


def agreement(pair: Array) -> float:
    """Return the Spearman rank correlation, -1 to 1, between the numbers of the left arm, `pair[0]`, and of the right arm, `pair[1]`."""
    from scipy.stats import spearmanr  # a second

    return float(spearmanr(pair[0].ravel(), pair[1].ravel()).statistic)


def autocorrelation(rate: Array, most: int) -> Array:
    """Return the autocorrelation of the series `rate` at the lags 0 to `most`, (most + 1,), after its linear trend is removed."""
    steps = np.arange(len(rate))
    residuals = rate - np.polyval(np.polyfit(steps, rate, 1), steps)
    products = [float((residuals[lag:] * residuals[: len(residuals) - lag]).sum()) for lag in range(most + 1)]
    return np.array(products) / products[0]


def share_of_top(ratios: Array, chosen: NDArray[np.bool_]) -> float:
    """Return the share of chosen actions among the 5 % of actions with the highest ratios, as a mean over both arms.

    `ratios`: (2, S, A), the `log_ratios` of tries at table and ghost, as `of_arms` returns them.  `chosen`: (S, A).
    """
    count = max(1, round(TOP_SHARE * ratios[0].size))
    return float(np.mean([chosen.ravel()[np.argsort(-ratio, axis=None)[:count]].mean() for ratio in ratios]))


def correlations(runs: Sequence[Run]) -> Array:
    """Return the autocorrelation of the contact rate of each run, (runs, lags).

    The largest lag is a third of the run, so that the run contains at least three periods of any cycle that is found.
    """
    return np.array([autocorrelation(run.touch_rate, len(run.touch_rate) // PERIODS) for run in runs])


def second_peak(curves: Array) -> int:
    """Return the lag, in windows of 50 transitions, of the second peak of an autocorrelation; the first peak is the one at the lag 0.

    This is the lag at which the mean of `curves` (runs, lags) is largest, among the lags from 3 windows on.  If the mean is negative at any
    of these lags, those before its first negative value are left out, because they belong to the first peak.
    """
    mean = curves.mean(axis=0)
    fallen = np.flatnonzero(mean[BOUT + 1 :] < 0.0)
    first = BOUT + 1 + (int(fallen[0]) if len(fallen) else 0)
    return first + int(np.argmax(mean[first:]))


def at_second_peak(ours: Array, theirs: Array) -> tuple[list[float], list[float]]:
    """Return the autocorrelation of each run, and of its ghost, at one lag: that of the second peak in the mean of all other runs.

    `ours`, `theirs`: autocorrelations (runs, lags) at the table and at its ghost, which exerts no force; at least two runs.
    """
    lags = [second_peak(np.delete(ours, run, axis=0)) for run in range(len(ours))]
    here, there = ([float(curve[lag]) for curve, lag in zip(curves, lags, strict=True)] for curves in (ours, theirs))
    return here, there


def is_cyclic(ours: Array, theirs: Array) -> bool | None:
    """Return whether contact with the table is cyclic: whether the autocorrelation of the contact rate has a second peak.

    `ours`, `theirs`: autocorrelations (runs, lags) at the table and at its ghost (a table without forces); at least two runs.  A lag is a
    window of 50 transitions.

    Two measures are compared by their confidence intervals over the runs.  The first is the value at the second peak (`at_second_peak`).
    Returns True if its interval at the table is above 0 and above its interval at the ghost.  The second measure is the largest value at
    lags of at least 3 windows.  If only its interval is above that at the ghost, returns None (undecided).  Otherwise returns False.
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
    """The actions of a learner in one run, sorted by a score, the highest first: which of them depend on other parts.

    `hits`: (parts, actions) bool, whether the action at this rank depends on other parts.  The properties are means over the parts, because
    the two arms of a run are not independent runs.
    """

    hits: NDArray[np.bool_]

    @property
    def chance(self) -> float:
        """The precision of a random choice: the number of actions that depend on other parts over the number of all actions."""
        return float(self.hits.mean())

    @property
    def at_all(self) -> float:
        """The precision if the first k actions are called dependent, where k actions really depend on other parts; equals the recall."""
        return float(self.hits[:, : int(self.hits[0].sum())].mean())

    @property
    def precision(self) -> Array:
        """The precision if the first k actions are called dependent, for k = 1 to all, (actions,)."""
        found: Array = (np.cumsum(self.hits, axis=1) / np.arange(1, self.hits.shape[1] + 1)).mean(axis=0)
        return found

    @property
    def recall(self) -> Array:
        """The recall if the first k actions are called dependent, for k = 1 to all, (actions,)."""
        found: Array = (np.cumsum(self.hits, axis=1) / self.hits.sum(axis=1, keepdims=True)).mean(axis=0)
        return found


def dependent(runs: Runs, parts: Sequence[str]) -> dict[int, NDArray[np.bool_]]:
    """Return a dict from each seed to the actions (S, A) of these parts that depend on other parts, according to all other seeds.

    These actions have different outcomes at the table and at its ghost, which exerts no force.  Outcomes differ if they were seen in both
    worlds, and their total variation is more than 0.1.  The outcomes are counted in the runs of all explorers.  `parts`: parts with the
    same graph, counted together.
    """
    shape = (*spaces()[parts[0]].goals.shape, len(spaces()[parts[0]]))
    counts: dict[str, dict[int, Array]] = {}  # (S, A, S), by world and seed
    for world in ("table", "ghost"):
        for run in (run for explorer in EXPLORERS for run in runs.get((explorer, world), [])):
            of_seed = counts.setdefault(world, {})
            of_seed[run.seed] = of_seed.get(run.seed, np.zeros(shape)) + sum(run.ends[part] for part in parts)
    totals = {world: sum(of_seed.values(), start=np.zeros(shape)) for world, of_seed in counts.items()}

    def depend(seed: int) -> NDArray[np.bool_]:
        table, ghost = (totals[world] - counts[world].get(seed, 0) for world in ("table", "ghost"))
        tried = table.sum(axis=-1), ghost.sum(axis=-1)
        shares = (found / np.maximum(number, 1.0)[..., None] for found, number in zip((table, ghost), tried, strict=True))
        variation = 0.5 * np.abs(np.subtract(*shares)).sum(axis=-1)
        found: NDArray[np.bool_] = (variation > DIFFERENT) & (tried[0] > 0) & (tried[1] > 0)
        return found

    return {seed: depend(seed) for seed in sorted(set().union(*counts.values()))}


def judged_of(runs: Runs, explorer: str, learner: str, score: str) -> list[Judged]:
    """Sort the actions of a learner in each run of an explorer by a score, and mark which depend on other parts.

    `learner`: "torso" or "arms".  `score`: "tries", or "beside_ghost" for tries over those at the ghost.  Which actions depend on other
    parts is found in the runs of all other seeds (`dependent`).  A run is left out if no such action is found, if there are no other seeds,
    or if there is no run at the ghost with the same seed.
    """
    found, pairs = [], with_ghosts(runs, explorer)
    depends = dependent(runs, LEARNERS[learner]) if pairs else {}
    for run, ghost in pairs:
        truth = depends[run.seed]
        if truth.any():
            ranked = (SCORES[score](run, ghost, part) for part in LEARNERS[learner])
            found.append(Judged(np.array([truth.ravel()[np.argsort(-values, axis=None, kind="stable")] for values in ranked])))
    return found
