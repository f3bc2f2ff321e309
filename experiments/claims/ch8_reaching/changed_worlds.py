# SPDX-License-Identifier: Apache-2.0
"""Change the world after an agent has learned to reach in it, and measure how much of its score it loses and how soon it recovers.

Claim: a learner that detects changes, and sees its hand and the objects, recovers within 60 problem-tries (attempts to reach one target):
its score is .95 of the score of an oracle, an agent that knows the new world, and at most 2 transitions fail per evaluation.  In a world
that does not change it loses nothing.
Source: aim of this reproduction, to thesis 7.2.6, where actions "suddenly brought the robot somewhere else".  Published: no numbers.
Run time: 45 minutes on 2 cores.

The arm, the targets, the control law and the recommended learner are those of the experiment reach-predictors, at a table.  After 200
problem-tries a ball with a radius of 10 cm appears, the table is raised by 8 cm, or each joint is miscalibrated by 5 degrees; or nothing
changes.  There are 20 positions of the ball.  They were drawn uniformly in the workspace, at least 12 cm from each target and away from the
robot at home.  A position was kept if a learner without a detector loses at least 15 % of its score there, while an oracle keeps at least
three quarters of its own; the first 20 such positions were taken.  All seeds are run with each ball.  A result with balls is computed from
the 20 means over the seeds, because results differ more between balls than between seeds.

The oracle of the new world plans as the learners do, but it knows the world from measurements.  For each state and each target one reach
was made, and the oracle knows its reward.  Without a target each transition was tried twice, and the oracle avoids those that failed at
least once.  From three tries of each target it has learned which transitions a target blocks.  As its rewards are single samples, a learner
can exceed its score.  With the ball number 12 the oracle's score is far too low (.83, while learners have 4.6): it enters states that the
robot entered in no measurement, so that it knows no failures there, and cannot leave them.  The interquartile mean leaves this ball out.
The oracle's encoders have the same errors as the learners'.

There are five learners.  The first has no detector of changes; the second assumes a change after every 100 outcomes; the third detects
changes by a generalised likelihood ratio of two windows, and the fourth by the posterior over run lengths (numbers of outcomes since the
last change).  The fifth has the same detector as the fourth, and also sees.  It sees its hand after each action, with an error of 5 mm
along each axis (standard deviation); from these positions its plant corrects the encoders (`mobee.vision.calibration.self_calibration`).
During evaluations it does not see the hand, because they measure what it knew before.  It also sees an object that appears or has moved,
with an error of 1 cm along each axis, and of 5 mm in the radius of a ball.  Then it first makes 1000 problem-tries on a simulated robot in
the world as it is seen (`ReachAgent.practise`); they do not count among the 60.  The simulator is that of the robot itself, so that only
the errors of the object and the noise differ: this shows what perception is worth, not what a wrong model of the robot costs.  All learners
are judged by the true place of the hand.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping
from functools import cache, partial
from typing import Any

import numpy as np

from experiments.kit.experiment import OUR_AIM, Claim, Experiment, Measured, judged
from experiments.kit.learning.arm import RIGHT, robot, table_world
from experiments.kit.learning.exploration import begin_anywhere, explore
from experiments.kit.plots import draw_curve, finish, new_figure, ticks_at
from experiments.kit.reaching.arm import MARKER, TRANSITIONS, Errors, JudgedPlant, SeenHand, laws, reach_space
from experiments.kit.reaching.targets import grid, targets_at
from experiments.kit.reaching.truth import BLOCKED, Known, Truth, failed_transitions, remaining_errors
from experiments.kit.rules import decides, equivalent, row
from experiments.kit.statistics import estimate, interval
from experiments.kit.sweep import Cells, Condition, Sweep, grouped_by
from mobee import CuriousAgent, Model, OfflinePlant, TransitionModel, World, sphere
from mobee.arrays import Array
from mobee.learning.reaching.changes import HAZARDS, SHARES, DetectorOf
from mobee.learning.reaching.reach_agent import ReachAgent
from mobee.plant import Plant
from mobee.reach import ReachTarget
from mobee.robot.robot import Robot

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
SEEN, SEEN_RADIUS = 0.01, 0.005  # m, standard deviations of the errors along each axis, and of a radius, of an object that is seen
PRACTICE = 1000  # problem-tries in the world as it is seen, after an object has appeared or moved
TURN = np.deg2rad(5.0)
TURNS = dict(zip(RIGHT, (TURN * np.array([1.0, -1.0, 1.0, -1.0])).tolist(), strict=True))  # rad, true minus measured, by motor
SEEDS = 10
CHANGES = {"nothing": "nothing changes", "ball": "a ball appears", "table": "the table is raised", "turn": "joints are miscalibrated"}
TRUTH_SEED = 9001  # of the plants on which an oracle's knowledge is measured


class FixedRate:
    """A detector that reports a change after every 100 outcomes, so that the learner forgets at a fixed rate."""

    def __init__(self) -> None:
        self._outcomes = 0

    def add(self, learned: float, unknown: float) -> int | None:
        """Count an outcome; returns 100, the number of outcomes since the last change, at every hundredth outcome, else None.

        `learned`, `unknown`: probabilities, which are not used.  As in `mobee.learning.reaching.changes.Detector.add`.
        """
        self._outcomes += 1
        return None if self._outcomes % 100 else 100


class LikelihoodRatio:
    """A detector that compares two windows of outcomes with a single window, by the generalised likelihood ratio.

    In a window, a constant share of the outcomes contradicts what was learned: these have the probability `unknown`, the others `learned`
    (the arguments of `add`).  The n outcomes since the last change are divided into two windows with different shares, at the place where
    their likelihood is largest.  A change is reported if the logarithm of this likelihood exceeds that of a single window by more than log
    n - log h: log n is the penalty of the Bayesian information criterion for two further parameters, and h is 0.01, the largest value in
    `HAZARDS` (probabilities that the world changes before an outcome).
    """

    def __init__(self) -> None:
        self._logs: list[Array] = []

    def add(self, learned: float, unknown: float) -> int | None:
        """Add an outcome; returns the number of outcomes since a change, if one is detected now, else None.

        `learned`: probability or density of the outcome according to what was learned; `unknown`: the same if nothing was learned.  A
        change to fewer contradicting outcomes is not reported.  As in `mobee.learning.reaching.changes.Detector.add`.
        """
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


LEARNERS: dict[str, tuple[str | DetectorOf, bool]] = {  # the detector, and whether hand and objects are seen
    "no detector": ("none", False),
    "fixed rate": (FixedRate, False),
    "likelihood ratio": (LikelihoodRatio, False),
    "run length": ("run_length", False),
    "run length, sees": ("run_length", True),
}
OURS, WITHOUT = "run length, sees", "no detector"


def conditions(arguments: argparse.Namespace) -> list[Condition]:
    """Return the settings of the runs: one for each change; the change "ball" has one for each of the 20 balls.

    With --quick there is one ball, and a quarter of the tries.  The world that does not change has ten times as many seeds, because its
    claim is an equality to 1 %, while single scores have a standard deviation of 1.8 %.
    """
    quick = arguments.quick
    share, name = (4, "quick-") if quick else (1, "")
    settings = {"tries": TRIES // share, "checkpoints": [n // share for n in CHECKPOINTS], "practice": PRACTICE // share}
    found = [Condition(f"{name}{change}", settings | {"change": change, "ball": -1}) for change in CHANGES if change in ("table", "turn")]
    unchanged = range(arguments.seed, arguments.seed + (1 if quick else 10) * arguments.seeds)
    found.append(Condition(f"{name}nothing", settings | {"change": "nothing", "ball": -1}, seeds=tuple(unchanged)))
    for ball in range(1 if quick else len(BALLS)):
        found.append(Condition(f"{name}ball{ball}", settings | {"change": "ball", "ball": ball}, 1.1))
    return found


def plant_of(change: str, ball: int, seed: int) -> JudgedPlant:
    """Return the right arm at the table, after a change of the world.

    `change`: "nothing" (also the world before every change), "ball", "table" (raised) or "turn" (miscalibrated joints).  `ball`: number of
    the ball that appears, 0 to 19; used by the change "ball" alone.  `seed`: of the plant.
    """
    return JudgedPlant(_offline_plant(change_world(table_world(), change, ball), seed), errors_after(change, robot()))


def errors_after(change: str, body: Robot) -> Errors:
    """Return the calibration errors of a robot after a change: the change "turn" makes encoders wrong, the others make no errors.

    `change`: as in `plant_of`.  `body`: the robot, an iCub.
    """
    turns = np.zeros(len(body.motors))
    if change == "turn":
        turns[[body.motor_index(name) for name in TURNS]] = list(TURNS.values())
    return Errors(turns, np.zeros(3))


def seen_plant(change: str, ball: int, seed: int) -> OfflinePlant:
    """Return a simulated right arm in the world as a learner sees it, with random errors of the object that has appeared or moved.

    `change`: "ball" or "table".  `ball`: as in `plant_of`.  `seed`: of errors and plant.
    """
    return _offline_plant(change_world(table_world(), change, ball, np.random.default_rng(seed)), seed)


def change_world(world: World, change: str, ball: int, seen: np.random.Generator | None = None) -> World:
    """Change a world with a table, and return it.

    `change`, `ball`: as in `plant_of`.  `seen`: draws errors of the position of the changed object and of a ball's radius, as a learner
    sees them; None: no errors.
    """
    error, error_of_radius = (np.zeros(3), 0.0) if seen is None else (seen.normal(0.0, SEEN, 3), float(seen.normal(0.0, SEEN_RADIUS)))
    if change == "table":
        world.move("table", position=world.objects["table"].position + np.array([0.0, 0.0, RAISED]) + error)
    if change == "ball":
        world.add("ball", sphere(RADIUS + error_of_radius), position=np.array(BALLS[ball]) + error)
    return world


def _offline_plant(world: World, seed: int) -> OfflinePlant:
    return OfflinePlant(Model(robot(), world), seed, laws()[LAW].gains, dt=laws()[LAW].dt, active=RIGHT)


@cache
def targets() -> list[ReachTarget]:
    """Return the 27 targets of the thesis: spheres of 10 cm on a grid in the workspace."""
    return targets_at(grid(), laws()[LAW].aim)


@cache
def model_of(seed: int) -> TransitionModel:
    """Return the transition model of a curious agent that has learned at the table for 3000 transitions.

    `seed`: of agent and plant.
    """
    plant = plant_of("nothing", -1, seed + 300).inner
    begin_anywhere(reach_space(), plant, seed)
    agent = CuriousAgent(reach_space(), plant, seed=seed)
    explore(agent, TRANSITIONS)
    return agent.model


def trial(settings: dict[str, Any], seed: int) -> dict[str, Any]:
    """Let every learner learn, change the world, and let the learners learn again; the oracle of the new world is measured, too.

    The D learners are evaluated L times after the change, each time after a given number of problem-tries (attempts to reach one target).
    Returns as means over the evaluations at one time: `score` (D, L), sum of the rewards; `failures` (D, L), number of failed transitions;
    `without` (D, L), number of targets for which no reach was made.  `false` (D,): number of changes detected before the world changed.
    `detected` (D,): problem-tries from the change until the learner detected a change; 0 if it saw the change at once, inf if it never
    detected one.  `oracle`: score of the oracle.  `settings`: "change" and "ball", as in `plant_of`; "tries", the number before the change;
    "checkpoints", the L numbers of problem-tries since the change; "practice", number of tries in a simulation of the changed world.
    `seed`: of learners and plants.
    """
    found = [_learned(*learner, settings, seed) for learner in LEARNERS.values()]
    names = ("score", "failures", "without", "false", "detected")
    oracle = oracle_score(settings["change"], settings["ball"])
    return {name: np.array([one[name] for one in found]) for name in names} | {"oracle": oracle}


def _learned(detector: str | DetectorOf, sees: bool, settings: dict[str, Any], seed: int) -> dict[str, Any]:
    """Return the results of one learner, see `trial`."""
    hand = SeenHand(robot(), RIGHT, seed)
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
    if sees and settings["change"] in ("ball", "table"):
        agent.practise(seen_plant(settings["change"], settings["ball"], seed + 700), targets(), settings["practice"])
        first = 0.0
    begun = agent.tries
    for checkpoint in settings["checkpoints"]:
        while agent.tries < begun + checkpoint:
            agent.learn(targets(), 1)
            if _detected(agent) + len(hand.offsets.changes) > false:
                first = min(first, agent.tries - begun)
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
    """Return the score of the oracle in the world after a change, as a mean of ten evaluations.

    The oracle is an agent that knows the measured rewards of all reaches and the transitions that fail.  `change`, `ball`: as in
    `plant_of`.
    """
    places, space = np.array([target.position for target in targets()]), reach_space()
    missing = remaining_errors(plant_of(change, ball, TRUTH_SEED), space, targets())
    truth = Truth(places, missing[:, :, None], np.zeros((len(places), *space.goals.shape)))
    oracle = ReachAgent(
        space, plant_of(change, ball, TRUTH_SEED + 1), model_of(0).debiased(), marker=MARKER,
        predictor=Known(truth, 0.01), strategy="greedy", failures="local",
    )  # fmt: skip
    for state, action in np.argwhere(failed_transitions(plant_of(change, ball, TRUTH_SEED), space, 2) >= BLOCKED).tolist():
        for place in places:
            oracle.failures.add(state, action, place, oracle.penalty)
    oracle.learn(targets(), 3 * len(places))
    return float(oracle.evaluate(targets(), 10).scores.mean())


Rule = Callable[[str, Any], Measured]  # judges the runs after a change, given its key in CHANGES
Worlds = list[list[dict[str, Any]]]  # the runs in each world; only with balls there is more than one seed in a world
Runs = Mapping[tuple[str, str], Worlds]  # by change and learner


def runs_of(found: Cells) -> Runs:
    """Return a dict from (change of the world, learner) to the results of its finished runs, which are grouped by world.

    After the change "ball", the world depends on which of the 20 balls has appeared: the runs with the same ball and different seeds form a
    group.  After the other changes, each run is a group by itself.  A result has the keys that `trial` returns, but the numbers of this
    learner alone.
    """
    worlds: dict[str, Worlds] = {}
    for (change, ball), group in sorted(grouped_by(found, "change", "ball").items()):
        worlds.setdefault(change, []).extend([group] if ball >= 0 else [[one] for one in group])
    names = ("score", "failures", "without", "false", "detected")
    return {
        (change, learner): [
            [{name: one[name][number] for name in names} | {"oracle": one["oracle"]} for one in group] for group in worlds[change]
        ]
        for change in CHANGES
        if change in worlds
        for number, learner in enumerate(LEARNERS)
    }


def relative(worlds: Worlds) -> Array:
    """Return the scores in N worlds at the L checkpoints after the change, divided by the score of the world's oracle, (N, L).

    A checkpoint is a number of problem-tries (attempts to reach one target).  The scores are means over the seeds of a world.
    """
    return np.array([np.mean([run["score"] / run["oracle"] for run in group], axis=0) for group in worlds])


def failures(worlds: Worlds) -> Array:
    """Return the mean number of failed transitions in an evaluation, in N worlds at the L checkpoints after the change, (N, L).

    A checkpoint is a number of problem-tries (attempts to reach one target).  The mean is over evaluations and seeds.
    """
    return np.array([np.mean([run["failures"] for run in group], axis=0) for group in worlds])


def findings(found: Cells) -> dict[str, Any]:
    """Return the results: "learners" is a dict from "change; learner" to a row, "claims" a list with the judged claims, as dicts.

    The numbers of a row: "seeds", scores and failed transitions after numbers of problem-tries (attempts to reach one target), and
    detections of the change.  If not every change was run, the claims have no numbers.
    """
    runs = runs_of(found)
    rows = {f"{CHANGES[change]}; {learner}": _row(group) for (change, learner), group in runs.items()}
    return {"learners": rows, "claims": judged(CLAIMS, runs, len(runs) == len(CHANGES) * len(LEARNERS))}


def _row(worlds: Worlds) -> dict[str, Any]:
    points, runs = [f"after {n}" for n in CHECKPOINTS], [run for group in worlds for run in group]
    first = [float(run["detected"]) for run in runs if np.isfinite(run["detected"])]
    return (
        row(runs, {"detected before the change": lambda run: float(run["false"])})
        | {f"score over the new oracle's, {at}": estimate(column) for at, column in zip(points, relative(worlds).T, strict=True)}
        | {f"failed transitions, {at}": estimate(column, 1) for at, column in zip(points, failures(worlds).T, strict=True)}
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
    false = sum(int(run["false"]) + bool(np.isfinite(run["detected"])) for (run,) in runs["nothing", OURS])
    text = f"{estimate(ours, 3)} and {estimate(without, 3)}; {false} changes detected in {len(ours)} runs"
    return text, equivalent(ours, without, MARGIN * float(without.mean()))


def claims_of_each_change(back: Rule, few: Rule, where: str = "") -> list[Claim]:
    """Return the claims about the learner that detects changes and sees: its score and its failed transitions after each change.

    `back`, `few`: judge the runs after a change, given its key in CHANGES: whether the score is high enough, and whether few transitions
    fail.  `where`: begins each text, as "on the live robot, ".
    """
    learner = "the learner that sees its hand and the objects"
    enough = f"{learner} has at least {BACK:.2f} of the score of the new world's oracle", f"at least {BACK:.2f}", back
    harmless = f"at most {MAX_FAILURES:.0f} transitions fail in an evaluation of {learner}", f"at most {MAX_FAILURES:.0f}", few
    changes = {change: name for change, name in CHANGES.items() if change != "nothing"}
    return [
        Claim(OUR_AIM, f"{where}{name}: 60 problem-tries later, {text}", published, rule=partial(rule, change))
        for text, published, rule in (enough, harmless)
        for change, name in changes.items()
    ]


CLAIMS = (
    *claims_of_each_change(_back, _few),
    Claim(
        OUR_AIM,
        "in a world that does not change, the learner that sees, with a detector, and one without both have the same score to 1 %",
        "equal to 1 %",
        rule=_unchanged,
    ),
)


def plot(found: Cells) -> Any:
    """Draw scores and failed transitions over the problem-tries since the change, in a column of panels for each change.

    Returns a matplotlib figure.  A problem-try is one attempt to reach one target.
    """
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
    claim="a reach learner that detects changes and sees soon has an oracle's score, and loses nothing where nothing changes",
    source="aim of this reproduction, to thesis 7.2.6",
    method=Sweep(conditions, trial, findings, plot, seeds=SEEDS),
    claims=CLAIMS,
)
