# SPDX-License-Identifier: Apache-2.0
"""Change the world after a reach learner has learned in it, and measure what it loses and how soon it is back.

Claim: a learner that detects changes and sees its hand is back at .95 of the score of an oracle that knows the new world within 60
problem-tries, with at most 2 failed transitions per evaluation, and loses nothing in a world that does not change.
Source: aim of this reproduction, to thesis 7.2.6, where actions "suddenly brought the robot somewhere else".  Published: no numbers.
Run time: 20 minutes on 2 cores.

The arm, targets, law and recommended learner of the experiment reach-predictors, at a table.  After 200 problem-tries a ball of 10 cm
appears, the table is raised by 8 cm, or each joint is miscalibrated by 5 degrees; or nothing changes.  The 20 balls were drawn uniformly
in the workspace, at least 12 cm from each target and away from the robot at home: the first that cost a learner without a detector 15 %
of its score or more, and leave at least three quarters of an oracle's.  Each ball has one of the seeds.

The oracle of the new world plans as the learners do, but with the rewards of one reach from each state for each target, and with the
transitions that failed in two tries without a target; failures due to targets it has learned in three tries of each.  As its rewards are
single samples, a learner can exceed it.  With the ball number 12 it is far too low (.83, while learners have 4.6): the oracle gets into
states from which it knows no failures, because the robot entered them in no measurement, and stays there.  The interquartile mean leaves
this ball out.  The oracle's encoders are as wrong as the learners'.  The learners have no detector; a fixed rate, by
which a change is assumed after every 100 outcomes; a generalised likelihood ratio of two windows; or the posterior over run lengths.  A
fifth one has that detector, too, and sees where its hand is after each action.  What it sees has an error of 5 mm along each axis (standard
deviation).  Its plant corrects the encoders by it (`mobee.vision.calibration.self_calibration`).  During evaluations the hand is not seen,
because they measure what was known before.  All are judged by the true place of the hand.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache, partial
from typing import Any

import numpy as np

from experiments.kit.experiment import OUR_AIM, Claim, Experiment, Measured, judged
from experiments.kit.learning.arm import RIGHT, robot, table_world
from experiments.kit.learning.exploration import begin_anywhere, explore
from experiments.kit.plots import draw_curve, finish, new_figure, ticks_at
from experiments.kit.reaching.arm import MARKER, TRANSITIONS, Errors, JudgedPlant, laws, reach_space
from experiments.kit.reaching.targets import grid, targets_at
from experiments.kit.reaching.truth import BLOCKED, Known, Truth
from experiments.kit.rules import decides, equivalent, row
from experiments.kit.statistics import estimate, interval
from experiments.kit.sweep import Cells, Condition, Sweep, grouped_by
from experiments.kit.wrapped_plant import WrappedPlant
from mobee import CuriousAgent, Model, OfflinePlant, TransitionModel, sphere
from mobee.arrays import Array
from mobee.learning.neighbours import NO_ACTION
from mobee.learning.reaching.changes import HAZARDS, SHARES, DetectorOf
from mobee.learning.reaching.evaluation import move, reach
from mobee.learning.reaching.reach_agent import ReachAgent
from mobee.plant import Plant
from mobee.reach import ReachOutcome, ReachPlant, ReachTarget
from mobee.vision.calibration.self_calibration import NOISE, JointOffsets, SelfCalibratingPlant

LAW = "published"
TRIES = 200  # before the change
CHECKPOINTS = (0, 10, 30, 60)  # problem-tries after it
REPETITIONS = 3  # evaluations at each checkpoint
BACK, MAX_FAILURES, MARGIN = 0.95, 2.0, 0.01  # of the new oracle's score; failed transitions per evaluation; of the unchanged score

RADIUS = 0.10  # m, of the balls
BALLS = (  # m, root frame
    (-0.231, 0.266, 0.302), (-0.036, 0.297, 0.055), (-0.009, 0.288, 0.202), (-0.179, 0.298, 0.316), (-0.172, 0.299, 0.129),
    (-0.058, 0.292, 0.328), (-0.262, 0.093, 0.279), (-0.003, 0.337, 0.234), (-0.047, 0.294, 0.312), (-0.018, 0.296, 0.052),
    (-0.200, 0.301, 0.103), (-0.057, 0.342, 0.297), (-0.128, 0.274, 0.297), (-0.155, 0.307, 0.129), (-0.011, 0.234, 0.307),
    (-0.041, 0.307, 0.127), (-0.062, 0.336, 0.297), (-0.088, 0.286, 0.287), (-0.238, 0.290, 0.283), (-0.074, 0.304, 0.311),
)  # fmt: skip
RAISED = 0.08  # m
TURN = np.deg2rad(5.0)
SEEDS = 10
CHANGES = {"nothing": "nothing changes", "ball": "a ball appears", "table": "the table is raised", "turn": "joints are miscalibrated"}
TRUTH_SEED = 9001  # of the plants on which an oracle's knowledge is measured


class FixedRate:
    """A detector that reports a change after every 100 outcomes: forgetting at a rate that is set by hand."""

    def __init__(self) -> None:
        self._outcomes = 0

    def add(self, learned: float, unknown: float) -> int | None:
        """See mobee.learning.reaching.changes.Detector."""
        self._outcomes += 1
        return None if self._outcomes % 100 else 100


class LikelihoodRatio:
    """A detector by the generalised likelihood ratio of two windows with different shares of contradicting outcomes.

    The outcomes since the last change are divided into two windows where their likelihood is largest.  A change is reported if its
    logarithm exceeds that of a single window by more than two terms: the Bayesian information criterion of two further parameters, and the
    logarithm of the largest probability of a change that `RunLength` considers.
    """

    def __init__(self) -> None:
        self._logs: list[Array] = []

    def add(self, learned: float, unknown: float) -> int | None:
        """See mobee.learning.reaching.changes.Detector."""
        self._logs.append(np.log((1.0 - SHARES) * learned + SHARES * unknown))
        if len(self._logs) < 2:
            return None
        sums = np.cumsum(self._logs, axis=0)
        earlier, later = sums[:-1], sums[-1] - sums[:-1]
        ratio = earlier.max(axis=1) + later.max(axis=1) - sums[-1].max()
        best = int(ratio.argmax())
        if ratio[best] <= np.log(len(sums)) - np.log(HAZARDS[0]):
            return None
        is_larger = later[best].argmax() > earlier[best].argmax()
        self._logs = self._logs[best + 1 :]
        return len(self._logs) if is_larger else None


LEARNERS: dict[str, tuple[str | DetectorOf, bool]] = {  # the detector, and whether the hand is seen
    "no detector": ("none", False),
    "fixed rate": (FixedRate, False),
    "likelihood ratio": (LikelihoodRatio, False),
    "run length": ("run_length", False),
    "run length, sees its hand": ("run_length", True),
}
OURS, WITHOUT = "run length, sees its hand", "no detector"


class Hand:
    """The offsets of the encoders that were found by seeing the hand; they are kept when the world changes.

    `is_seen`: whether the hand is seen at present.
    """

    def __init__(self, seed: int) -> None:
        self.offsets, self.is_seen = JointOffsets(Model(robot()), MARKER, RIGHT), True
        self._rng = np.random.default_rng(seed)

    def see(self, plant: JudgedPlant) -> Array | None:
        """Return where the hand is seen, (3,) m."""
        error = self._rng.normal(0.0, NOISE, 3)
        return plant.marker_at(MARKER) + error if self.is_seen else None

    def correct(self, plant: JudgedPlant) -> SeenPlant:
        """Return a plant whose encoders are corrected by where the hand is seen."""
        return SeenPlant(SelfCalibratingPlant(plant, self.offsets, lambda: self.see(plant)), plant)


class SeenPlant(WrappedPlant[SelfCalibratingPlant]):
    """A self-calibrating plant whose reaches are judged by the true place of the hand, as those of the other learners."""

    def __init__(self, inner: SelfCalibratingPlant, judge: JudgedPlant) -> None:
        super().__init__(inner)
        self.model, self._judge, self._target = judge.model, judge, ReachTarget(np.zeros(3))

    def present(self, target: ReachTarget | None) -> None:
        """See ReachPlant."""
        self._target = target or self._target
        super().present(target)

    def reach(self, part: str, marker: str, stay: bool = False) -> ReachOutcome:
        """See ReachPlant; the outcome has the true position of the marker and the true remaining error."""
        found, where = super().reach(part, marker, stay), self._judge.reached
        return replace(found, marker=where, missing=self._target.missing(where))


def conditions(arguments: argparse.Namespace) -> list[Condition]:
    """Return every change, one ball a condition; the short version has one ball and a quarter of the tries.

    The world that does not change has ten times as many seeds: its claim is an equality to 1 %, and single scores have a standard
    deviation of 1.8 %.
    """
    quick = arguments.quick
    share, name = (4, "quick-") if quick else (1, "")
    seeds = range(arguments.seed, arguments.seed + arguments.seeds)
    settings = {"tries": TRIES // share, "checkpoints": [n // share for n in CHECKPOINTS]}
    found = [Condition(f"{name}{change}", settings | {"change": change, "ball": -1}) for change in CHANGES if change in ("table", "turn")]
    unchanged = range(arguments.seed, arguments.seed + (1 if quick else 10) * arguments.seeds)
    found.append(Condition(f"{name}nothing", settings | {"change": "nothing", "ball": -1}, seeds=tuple(unchanged)))
    for ball in range(1 if quick else len(BALLS)):
        found.append(Condition(f"{name}ball{ball}", settings | {"change": "ball", "ball": ball}, 1.1, seeds=(seeds[ball % len(seeds)],)))
    return found


def plant_of(change: str, ball: int, seed: int) -> JudgedPlant:
    """Return the arm at the table, after a change or, with "nothing", before."""
    world = table_world()
    if change == "table":
        world.move("table", position=world.objects["table"].position + np.array([0.0, 0.0, RAISED]))
    if change == "ball":
        world.add("ball", sphere(RADIUS), position=BALLS[ball])
    plant = OfflinePlant(Model(robot(), world), seed, laws()[LAW].gains, dt=laws()[LAW].dt, active=RIGHT)
    turns = np.zeros(len(robot().motors))
    if change == "turn":
        turns[[robot().motor_index(name) for name in RIGHT]] = TURN * np.array([1.0, -1.0, 1.0, -1.0])
    return JudgedPlant(plant, Errors(turns, np.zeros(3)))


@cache
def targets() -> list[ReachTarget]:
    """Return the 27 targets of the thesis."""
    return targets_at(grid(), laws()[LAW].aim)


@cache
def model_of(seed: int) -> TransitionModel:
    """Return the transition model of a curious agent at the table."""
    plant = plant_of("nothing", -1, seed + 300).inner
    begin_anywhere(reach_space(), plant, seed)
    agent = CuriousAgent(reach_space(), plant, seed=seed)
    explore(agent, TRANSITIONS)
    return agent.model


def trial(settings: dict[str, Any], seed: int) -> dict[str, Any]:
    """Make every learner learn, change the world, and let it learn again; the oracle of the new world is measured, too.

    Returns for the D learners and L checkpoints `score` (D, L), the sum of the rewards, `failures` (D, L), failed transitions, and
    `without` (D, L), targets without a reach, each the mean of the evaluations; `false` (D,), the number of changes that were detected
    before there was one; `detected` (D,), problem-tries after the change until one was detected, inf if none was; and `oracle`, its score.
    """
    found = [_learned(*learner, settings, seed) for learner in LEARNERS.values()]
    names = ("score", "failures", "without", "false", "detected")
    oracle = oracle_score(settings["change"], settings["ball"])
    return {name: np.array([one[name] for one in found]) for name in names} | {"oracle": oracle}


def _learned(detector: str | DetectorOf, sees: bool, settings: dict[str, Any], seed: int) -> dict[str, Any]:
    """Return the results of one learner, see `trial`."""
    hand = Hand(seed)
    correct = hand.correct if sees else lambda plant: plant
    agent = ReachAgent(
        reach_space(), correct(plant_of("nothing", -1, seed + 500)), model_of(seed).debiased(), marker=MARKER,
        predictor="gp", strategy="ucb", failures="alike", detector=detector, seed=seed,
    )  # fmt: skip
    agent.learn(targets(), settings["tries"])
    false = _detected(agent) + len(hand.offsets.changes)
    agent.plant = correct(plant_of(settings["change"], settings["ball"], seed + 600))
    _begin(agent.plant, seed)
    agent._state = None
    rows, first = list[tuple[float, float, float]](), np.inf
    for checkpoint in settings["checkpoints"]:
        while agent.tries < settings["tries"] + checkpoint:
            agent.learn(targets(), 1)
            if _detected(agent) + len(hand.offsets.changes) > false:
                first = min(first, agent.tries - settings["tries"])
        hand.is_seen = False
        found = agent.evaluate(targets(), REPETITIONS)
        hand.is_seen = True
        without = float(np.isnan(found.missing).sum(axis=1).mean())
        rows.append((float(found.scores.mean()), float(found.failures.sum(axis=1).mean()), without))
    columns = dict(zip(("score", "failures", "without"), zip(*rows, strict=True), strict=True))
    return columns | {"false": false, "detected": first}


def _detected(agent: ReachAgent) -> int:
    return 0 if agent.changes is None else len(agent.changes.detected)


def _begin(plant: Plant, seed: int) -> None:
    space = reach_space()
    plant.act(space.part, space.target(int(np.random.default_rng(seed).integers(len(space)))))


@cache
def oracle_score(change: str, ball: int) -> float:
    """Return the score of the oracle of a world, mean of ten evaluations."""
    places, space = np.array([target.position for target in targets()]), reach_space()
    truth = Truth(places, rewards_missing(change, ball)[:, :, None], np.zeros((len(places), *space.goals.shape)))
    oracle = ReachAgent(
        space, plant_of(change, ball, TRUTH_SEED + 1), model_of(0).debiased(), marker=MARKER,
        predictor=Known(truth, 0.01), strategy="greedy", failures="local",
    )  # fmt: skip
    for state, action in np.argwhere(blocked(change, ball) >= BLOCKED).tolist():
        for place in places:
            oracle.failures.add(state, action, place, oracle.penalty)
    oracle.learn(targets(), 3 * len(places))
    return float(oracle.evaluate(targets(), 10).scores.mean())


def rewards_missing(change: str, ball: int) -> Array:
    """Measure the remaining error of one reach from each state for each target, (T, S) m; NaN where the state was not entered."""
    plant, space = plant_of(change, ball, TRUTH_SEED), reach_space()
    missing = np.full((len(targets()), len(space)), np.nan)
    for state in range(len(space)):
        inside = _entered(plant, state)
        for number, target in enumerate(targets()):
            if not inside and not (inside := _entered(plant, state)):
                break
            plant.present(target)
            outcome, following = reach(plant, space, MARKER)
            missing[number, state], inside = outcome.missing, following == state
    return missing


def blocked(change: str, ball: int) -> Array:
    """Measure the share of two tries of each transition, without a target, that do not end in its goal, (S, A)."""
    plant, space, rng = plant_of(change, ball, TRUTH_SEED), reach_space(), np.random.default_rng(0)
    left, failed = 2 * (space.goals != NO_ACTION), np.zeros(space.goals.shape)
    plant.present(None)
    _begin(plant, 0)
    while left.any():
        state = space.state_of(plant.measure(space.part))
        if not left[state].any():
            goal = int(rng.choice(np.flatnonzero(left.any(axis=1))))
            if not _entered(plant, goal):
                left[goal] = 0
            continue
        action = int(rng.choice(np.flatnonzero(left[state])))
        left[state, action] -= 1
        failed[state, action] += move(plant, space, state, action)[1] != space.goals[state, action]
    return failed / 2.0


def _entered(plant: ReachPlant, state: int) -> bool:
    """Go to a state without a target, in at most three actions; return whether it was entered."""
    plant.present(None)
    space = reach_space()
    return any(space.state_of(plant.act(space.part, space.target(state)).q) == state for _ in range(3))


Runs = Mapping[tuple[str, str], list[dict[str, Any]]]  # by change and learner


def runs_of(found: Cells) -> Runs:
    """Return the results of each learner, as in `trial` but of one learner, by change and learner."""
    groups = grouped_by(found, "change")
    names = ("score", "failures", "without", "false", "detected")
    return {
        (change, learner): [{name: one[name][number] for name in names} | {"oracle": one["oracle"]} for one in groups[(change,)]]
        for change in CHANGES
        if (change,) in groups
        for number, learner in enumerate(LEARNERS)
    }


def relative(runs: list[dict[str, Any]]) -> Array:
    """Return the scores over the new oracle's, (N, L)."""
    return np.array([run["score"] / run["oracle"] for run in runs])


def failures(runs: list[dict[str, Any]]) -> Array:
    """Return the failed transitions per evaluation, (N, L)."""
    return np.array([run["failures"] for run in runs])


def findings(found: Cells) -> dict[str, Any]:
    """Return a row for each change and learner, and the claims."""
    runs = runs_of(found)
    rows = {f"{CHANGES[change]}; {learner}": _row(group) for (change, learner), group in runs.items()}
    return {"learners": rows, "claims": judged(CLAIMS, runs, len(runs) == len(CHANGES) * len(LEARNERS))}


def _row(runs: list[dict[str, Any]]) -> dict[str, Any]:
    points = [f"after {n}" for n in CHECKPOINTS]
    first = [float(run["detected"]) for run in runs if np.isfinite(run["detected"])]
    return (
        row(runs, {"detected before the change": lambda run: float(run["false"])})
        | {f"score over the new oracle's, {at}": estimate(column) for at, column in zip(points, relative(runs).T, strict=True)}
        | {f"failed transitions, {at}": estimate(column, 1) for at, column in zip(points, failures(runs).T, strict=True)}
        | {"runs with a detection": len(first), "first detection, median of problem-tries": float(np.median(first)) if first else None}
    )


def _back(change: str, runs: Runs) -> Measured:
    ours, without = (relative(runs[change, name])[:, -1] for name in (OURS, WITHOUT))
    return f"{estimate(ours)}; without a detector {estimate(without)}", decides(interval(ours), least=BACK)


def _few(change: str, runs: Runs) -> Measured:
    ours, without = (failures(runs[change, name])[:, -1] for name in (OURS, WITHOUT))
    return f"{estimate(ours, 1)}; without a detector {estimate(without, 1)}", decides(interval(ours), most=MAX_FAILURES)


def _unchanged(runs: Runs) -> Measured:
    ours, without = (relative(runs["nothing", name])[:, -1] for name in (OURS, WITHOUT))
    false = sum(int(run["false"]) + bool(np.isfinite(run["detected"])) for run in runs["nothing", OURS])
    text = f"{estimate(ours, 3)} and {estimate(without, 3)}; {false} changes detected in {len(ours)} runs"
    return text, equivalent(ours, without, MARGIN * float(without.mean()))


def _of_each_change(text: str, published: str, rule: Callable[[str, Runs], Measured]) -> list[Claim]:
    """Return a claim about the learner that detects changes and sees its hand after each change of the world."""
    changes = {change: name for change, name in CHANGES.items() if change != "nothing"}
    return [
        Claim(OUR_AIM, f"{name}: 60 problem-tries later, {text}", published, rule=partial(rule, change)) for change, name in changes.items()
    ]


CLAIMS = (
    *_of_each_change(
        f"the learner with a detector that sees its hand has at least {BACK:.2f} of the score of the new world's oracle",
        f"at least {BACK:.2f}",
        _back,
    ),
    *_of_each_change(
        f"at most {MAX_FAILURES:.0f} transitions fail in an evaluation of the learner with a detector that sees its hand",
        f"at most {MAX_FAILURES:.0f}",
        _few,
    ),
    Claim(
        OUR_AIM,
        "in a world that does not change, the learner with a detector that sees its hand and one without both have the same score to 1 %",
        "equal to 1 %",
        rule=_unchanged,
    ),
)


def plot(found: Cells) -> Any:
    """Draw scores and failed transitions over the problem-tries since the change: a column for each change."""
    runs = runs_of(found)
    drawing = new_figure(16.0, 7.0)
    panels = drawing.subplots(2, len(CHANGES), sharex=True, sharey="row")
    for column, (change, title) in enumerate(CHANGES.items()):
        for number, learner in enumerate(LEARNERS):
            if group := runs.get((change, learner)):
                for axes, values in zip(panels[:, column], (relative(group), failures(group)), strict=True):
                    draw_curve(axes, CHECKPOINTS[: values.shape[1]], values, f"C{number}", learner)
        panels[0, column].axhline(BACK, color="k", linestyle=":", linewidth=0.8)
        panels[1, column].axhline(MAX_FAILURES, color="k", linestyle=":", linewidth=0.8)
        finish(panels[0, column], title=title)
        finish(panels[1, column], xlabel="problem-tries since the change")
        ticks_at(panels[1, column], CHECKPOINTS)
    panels[0, 0].set_ylabel("score over the new oracle's")
    panels[1, 0].set_ylabel("failed transitions per evaluation")
    panels[1, 0].legend(fontsize=8, title="learner", loc="upper right")
    return drawing


EXPERIMENT = Experiment(
    claim="a reach learner that detects changes and sees its hand soon has an oracle's score, and loses nothing where nothing changes",
    source="aim of this reproduction, to thesis 7.2.6",
    method=Sweep(conditions, trial, findings, plot, seeds=SEEDS),
    claims=CLAIMS,
)
