# SPDX-License-Identifier: Apache-2.0
"""Compare a reach learner with planners whose model is wrong, and which plan again after every change, with and without memory.

Claim: where the model is wrong, learning from tries overtakes planning (thesis 9.3: one could plan the motions offline, but moving the
target just a little may invalidate the plan).
Source: thesis 5.3, 9.3; our own aims: equal success after 200 tries, 20 percentage points more after 800.  Published: no numbers.
Run time: ten minutes on 2 cores, for 10 seeds.

The robot is today's robot file "icub" under the default control law (not those of 2014).  The right arm has 27 targets that it can touch
without a force of a joint limit: 12 of the thesis, and others drawn between them.  Targets that cannot be touched because of the ball are
left out.  The planners' model lacks the constraints of the shoulder's cables, and a ball with a diameter of 10 cm in the workspace, which
only blocks motions; its target positions are wrong by 1 cm and its joints by 3 degrees.  There are three kinds of runs.  "planners": only
the planners' model is wrong.  "everyone": MoBeE's model has the same errors of targets and joints, so that the learner's reaches miss as
the planners' motions do, and only the outcome shows it.  "nothing": all models are right, for comparison.

The learner has learned the outcomes of transitions in 3000 curious transitions without target and ball.  Learner and planner make the same
number of tries; each try is for the target with the fewest tries so far, from the arm's present pose.  The planner uses inverse kinematics
and RRT-Connect (OMPL), and checks poses for contacts in its own model; it has 20 actions per try, the learner 10.  It remembers nothing
("none"), or where motions were blocked ("blocked"), or also which poses missed the target ("missed").  A try fails when its actions are
used up.
The seeds draw ball, errors, noise and first poses.  Seed 0 was used while scene and planner were developed; therefore the reported runs
begin with --seed 1.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import permutations
from typing import Any, Protocol

import numpy as np

from experiments.kit.cells import CellResult
from experiments.kit.experiment import OUR_AIM, Claim, Experiment, Measured, Rule, judged
from experiments.kit.learning.arm import RIGHT
from experiments.kit.plots import draw_curve, finish, new_figure, ticks_at
from experiments.kit.reaching.arm import (
    PART,
    Errors,
    JudgedPlant,
    arm_belief,
    arm_plant,
    body,
    learned_transitions,
    reach_agent,
    space,
    straight_paths,
)
from experiments.kit.reaching.belief import PeerBelief
from experiments.kit.reaching.planner_peer import ENDS, MEMORIES, Memory, PeerTry, PlannerPeer
from experiments.kit.reaching.targets import GOOD, grid, touchable, touchable_targets
from experiments.kit.rules import all_hold, decides, within
from experiments.kit.statistics import estimate, interquartile_mean, interval
from experiments.kit.sweep import Cells, Condition, Sweep
from mobee import World, sphere
from mobee.arrays import Array
from mobee.errors import InvalidValue
from mobee.learning.reaching.store import Problems
from mobee.reach import ReachTarget
from mobee.roadmap.ompl import require_ompl

WRONG = ("nothing", "planners", "everyone")
"""Whose model is wrong: nobody's; only the planners'; or everyone's, so that MoBeE has the same wrong joints and target positions."""
SHIFT, TURN = 0.01, np.deg2rad(3.0)  # m and rad, errors of the believed target positions and joint angles
UNSEEN = "unseen"  # name of the hidden ball
RADIUS = 0.05  # m, of the hidden ball
TARGET_CLEARANCE = 0.12  # m, least distance of the ball's centre from the centre of any target of the thesis
MIN_BLOCKED, MAX_BLOCKED = 0.08, 0.3  # share of the straight paths between two states that the ball blocks
DRAWS = 400  # positions of the ball that are tried

TRIES = (5, 25, 50, 100, 200, 400, 800)  # after which the contestants are evaluated
REPETITIONS = 2  # of all targets in an evaluation
COSTS = {"learner": 7.0, "none": 5.0, "blocked": 17.0, "missed": 23.0}  # s of processor time
FATES = ("reached", "missed", "used up", "no plan")
"""How a try ends: within 2 cm of the target; as planned, but not there; with all actions used up; or without a plan."""

HIDDEN = WRONG[1:]
MARGIN, MIN_LEAD = 0.05, 0.2  # of success: a share at most this much lower counts as equal; a lead of this much is the aim
EQUAL_BY, LEAD_BY = 200, 800  # tries
PERFECT = 0.9  # share of tries that succeed with a perfect model, if planning is enough
COLORS = {"learner": "tab:red", "none": "0.5", "blocked": "tab:blue", "missed": "tab:cyan"}
LABELS = {
    "learner": "reach learner",
    "none": "planner, no memory",
    "blocked": "planner, remembers blocked motions",
    "missed": "planner, also remembers poses that missed",
}
TITLES = {
    "nothing": "no model is wrong",
    "planners": "the planners' model is wrong",
    "everyone": "the planners' and MoBeE's models are wrong",
}


def conditions(arguments: argparse.Namespace) -> list[Condition]:
    """Return the settings of the runs: one for each contestant (the learner, or a planner with one kind of memory) and each set of errors.

    A set of errors says whose model is wrong: only the planners' ("planners"), or also MoBeE's ("everyone"); for these all contestants are
    run.  If no model is wrong ("nothing"), only the planner without memory is run.  With --quick there are at most 100 tries.
    """
    tries = list(TRIES[:4] if arguments.quick else TRIES)
    return [
        Condition(f"{contestant}-{wrong}", {"contestant": contestant, "wrong": wrong, "tries": tries}, COSTS[contestant])
        for wrong in WRONG
        for contestant in (("learner", *MEMORIES) if wrong != "nothing" else ("none",))  # the learner has no planner's model
    ]


def trial(settings: dict[str, Any], seed: int) -> dict[str, Any]:
    """Let one contestant learn, and evaluate it after each number of tries in the setting `tries`.

    Returns `rows`, a list with a dict for each evaluation: `fates`, `seconds` and `actions` as in `Score`, and `hours`, the plant time so
    far [h]; and `targets`, their number.  For a planner also `planning`, the processor time of each try [s], and `remembered`, the number
    of poses in its memory.  `settings`: "contestant": "learner", or the memory of the planner, "none", "blocked" or "missed"; "wrong", one
    of WRONG; "tries", the numbers of tries before the evaluations.  `seed`: of scene and contestant.
    """
    contestant = settings["contestant"]
    scene = make_scene(seed, settings["wrong"])
    player: Contestant = Learner(scene, seed) if contestant == "learner" else Planner(scene, contestant, seed)
    rows, made = [], 0
    for n in settings["tries"]:
        if contestant != "none":  # which learns nothing
            player.learn(n - made)
            made = n
        rows.append(player.evaluate(REPETITIONS).values() | {"hours": player.hours})
    found: dict[str, Any] = {"rows": rows, "targets": len(scene.targets)}
    if isinstance(player, Planner):
        found |= {"planning": player.planning, "remembered": player.peer.remembered}
    return found


def summary(values: dict[str, Any]) -> dict[str, Any]:
    """Return the values of `trial` for its record: of the times of planning only the median is kept, in a list."""
    return values | ({"planning": [float(np.median(values["planning"]))]} if "planning" in values else {})


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """The task that all contestants of one seed get.

    `targets`: at the positions that MoBeE believes.  `ball`: position of the ball that blocks motions, (3,) m, root frame.  `turns`: errors
    of the joint angles, (4,) rad.  `shift`: error of the target positions, (3,) m.  `wrong`: whose model has these errors: "nothing" (no
    model), "planners" or "everyone" (the planners and MoBeE).
    """

    targets: list[ReachTarget]
    ball: Array
    turns: Array
    shift: Array
    wrong: str

    def plant(self, seed: int, ball: bool = True) -> JudgedPlant:
        """Return an offline plant of the arm, which measures the results of reaches at the true positions of marker and target.

        If `wrong` is "everyone", encoders and target positions have the errors of the scene, and the control uses them as they are;
        otherwise they have no such errors.  `seed`: of the plant's random numbers.  `ball`: whether the ball that blocks motions is in the
        world; outcomes do not report contacts with it.
        """
        turns = np.zeros(len(body().motors))
        turns[[body().motor_index(name) for name in RIGHT]] = self.turns
        errors = Errors(turns, self.shift) if self.wrong == "everyone" else None
        return JudgedPlant(arm_plant(seed, _world(self.ball) if ball else None), errors, [UNSEEN])

    def belief(self) -> PeerBelief:
        """Return the planners' model of arm and workspace.

        Unless `wrong` is "nothing", it lacks the ball and the cable constraints.  If `wrong` is "planners", its joint angles are wrong by
        `turns`, too; if it is "everyone", the encoders of `plant` have these errors instead.
        """
        if self.wrong == "nothing":
            return arm_belief(_world(self.ball))
        return arm_belief(cables=False, turns=self.turns if self.wrong == "planners" else None)

    def seen(self, target: ReachTarget) -> ReachTarget:
        """Return a target at the position that the planners believe, which includes `shift` (3,) m if `wrong` is "planners".

        Otherwise the target is returned as it is given, at the position that MoBeE believes.
        """
        return replace(target, position=target.position + self.shift) if self.wrong == "planners" else target


def make_scene(seed: int, wrong: str) -> Scene:
    """Draw a ball that blocks motions, and errors of joint angles (3 degrees) and target positions (1 cm).

    `wrong`: whose model has the errors: "nothing", "planners" or "everyone".  Ball and errors do not depend on it.  Targets that cannot be
    touched because of the ball are left out.  `seed`: of the draw.
    """
    return replace(_drawn(seed), wrong=wrong)


@cache
def _drawn(seed: int) -> Scene:
    rng = np.random.default_rng([seed, 86])
    ball = _ball(rng, grid())
    shift = rng.normal(size=3)
    knowing = arm_belief(_world(ball))
    targets = [target for target in touchable_targets() if touchable(knowing, target)]
    return Scene(targets, ball, TURN * rng.choice([-1.0, 1.0], size=len(RIGHT)), SHIFT * shift / np.linalg.norm(shift), WRONG[0])


def _world(ball: Array) -> World:
    world = World()
    world.add(UNSEEN, sphere(RADIUS), position=ball)
    return world


def _ball(rng: np.random.Generator, targets: Array) -> Array:
    """Draw the position of the centre of the ball that blocks motions, (3,) m, root frame: one that the palm reaches in a random pose.

    There the ball is at least 12 cm from all targets and has no contact with the robot at home.  It blocks 8 to 30 % of 100 straight
    motions between states, in addition to those that were blocked before.  Raises InvalidValue if no position is found in 400 draws.
    """
    low, high = body().limits[[body().motor_index(name) for name in RIGHT]].T
    pairs = list(permutations(range(len(space())), 2))
    chosen = [pairs[i] for i in rng.permutation(len(pairs))[:100]]
    paths = straight_paths(chosen).reshape(-1, len(RIGHT))
    alone = arm_belief()
    before = 1.0 - alone.sound(paths).reshape(len(chosen), -1).all(axis=1).mean()
    for _ in range(DRAWS):
        q = rng.uniform(low, high)
        place = alone.model.evaluate(alone.whole(q)).position(alone.marker)
        if np.linalg.norm(targets - place, axis=1).min() < TARGET_CLEARANCE:
            continue
        belief = arm_belief(_world(place))
        if len(belief.model.evaluate(body().home).table):
            continue
        blocked = 1.0 - belief.sound(paths).reshape(len(chosen), -1).all(axis=1).mean()
        if MIN_BLOCKED <= blocked - before <= MAX_BLOCKED:
            found: Array = place
            return found
    raise InvalidValue(f"no position for the ball was found in {DRAWS} draws: use another seed.")


@dataclass(frozen=True, slots=True, eq=False)
class Score:
    """The result of an evaluation.

    `fates`: (4,), shares of tries by their end, in this order: target reached, target missed, all actions used up, no plan.  `seconds`:
    mean plant time of a try.  `actions`: mean number of actions of a try.
    """

    fates: Array
    seconds: float
    actions: float

    def values(self) -> dict[str, Any]:
        """Return a dict from the name of each field to its JSON value."""
        return {"fates": self.fates.tolist(), "seconds": self.seconds, "actions": self.actions}


class Contestant(Protocol):
    """The interface of the learner and the planners: they try to reach targets, and may learn from these tries."""

    def learn(self, tries: int) -> None:
        """Make `tries` more tries, each for the target with the fewest tries so far (thesis 8.3.2), and learn from them."""

    def evaluate(self, repetitions: int) -> Score:
        """Try all targets `repetitions` times, each time in random order, without learning (thesis 8.3.3).

        A repetition begins in a random state; each further try in it begins where the last one ended.
        """

    @property
    def hours(self) -> float:
        """The plant time so far [h], with the learning before the first try, and without evaluations."""


class Learner:
    """The reach learner; before the first try it learns the outcomes of transitions on a plant without the ball that blocks motions."""

    def __init__(self, scene: Scene, seed: int) -> None:
        alone = scene.plant(seed + 500, ball=False)
        model = learned_transitions(alone.inner, seed)
        self._plant, self._targets = scene.plant(seed), scene.targets
        self.agent = reach_agent(self._plant, model, seed)
        self._seconds = alone.time

    def learn(self, tries: int) -> None:
        """Make `tries` more tries, and learn from them; as in `Contestant.learn`."""
        before = self._plant.time
        self.agent.learn(self._targets, tries)
        self._seconds += self._plant.time - before

    def evaluate(self, repetitions: int) -> Score:
        """Try all targets `repetitions` times without learning; as in `Contestant.evaluate`."""
        found = self.agent.evaluate(self._targets, repetitions)
        arrived = np.isfinite(found.missing)
        good = np.where(arrived, found.missing, np.inf) <= GOOD
        fates = np.array([good.mean(), (arrived & ~good).mean(), (~arrived).mean(), 0.0])
        return Score(fates, float(found.duration.mean()), float(found.actions.mean()))

    @property
    def hours(self) -> float:
        """The plant time so far [h], without evaluations; as in `Contestant.hours`."""
        return self._seconds / 3600.0


class Planner:
    """A planner (inverse kinematics and RRT-Connect) that plans with its model, and may have a memory of earlier tries.

    `memory`: what it remembers.  "none": nothing.  "blocked": where motions were blocked.  "missed": also which poses missed the target.
    """

    def __init__(self, scene: Scene, memory: Memory, seed: int) -> None:
        self._scene, self._seed, self._tries, self._seconds = scene, seed, 0, 0.0
        self._plant = scene.plant(seed)
        self.peer = PlannerPeer(self._plant, scene.belief(), PART, memory, seed)
        self._problems = Problems()
        self.planning: list[float] = []
        """Processor time of each try so far, s."""

    def learn(self, tries: int) -> None:
        """Make `tries` more tries, and remember blocked motions and missed poses as `memory` allows; as in `Contestant.learn`."""
        for _ in range(tries):
            rng = np.random.default_rng([self._seed, 861, self._tries])
            target = self._problems.least_tried(self._scene.targets, rng)
            number = self._problems.index(target)
            self._seconds += self._try(target).seconds
            self._problems.tries[number] += 1
            self._tries += 1

    def evaluate(self, repetitions: int) -> Score:
        """Try all targets `repetitions` times; as in `Contestant.evaluate`.

        What the planner remembers from a repetition is forgotten at its end.
        """
        tries: list[PeerTry] = []
        known = self.peer.knowledge()
        for repetition in range(repetitions):
            rng = np.random.default_rng([self._seed, 862, self._tries, repetition])
            self._plant.present(None)
            self._plant.act(PART, space().target(int(rng.integers(len(space())))))
            tries += [self._try(self._scene.targets[i]) for i in rng.permutation(len(self._scene.targets))]
            self.peer.restore(known)
        return _score(tries)

    @property
    def hours(self) -> float:
        """The plant time of the tries so far [h], without evaluations; as in `Contestant.hours`."""
        return self._seconds / 3600.0

    def _try(self, target: ReachTarget) -> PeerTry:
        tried = self.peer.try_problem(target, lambda: self._scene.seen(target))
        self.planning.append(tried.planning)
        return tried


def _score(tries: Sequence[PeerTry]) -> Score:
    good = np.array([one.missing <= GOOD for one in tries])
    ended = [np.array([one.ended == end for one in tries]) & ~good for end in ENDS]
    fates = np.array([good.mean(), *(one.mean() for one in ended)])
    return Score(fates, float(np.mean([one.seconds for one in tries])), float(np.mean([one.actions for one in tries])))


def findings(done: Cells) -> dict[str, Any]:
    """Return the results, as lists.

    Keys: "claims", a list with the judged claims, as dicts (`Claim.record`); "success", a row for each contestant and kind of error, with
    the share of success after each number of tries, and, of the last evaluation, the shares of all other ends in FATES, times and actions;
    "crossover", a row for each planner and kind of error: the number of tries from which the learner is no worse than the planner, for
    each seed, as text.
    """
    rows, crossings = [], []
    for wrong in WRONG:
        rows += [_row(done, contestant, wrong) for contestant in ("learner", *MEMORIES) if _of(done, contestant, wrong)]
        for memory in MEMORIES:
            tries, learner, peer = *success(done, "learner", wrong), success(done, memory, wrong)[1]
            if len(learner) and learner.shape == peer.shape:
                each = crossover(tries, learner, peer)
                text = ", ".join("never" if np.isinf(n) else f"{n:.0f}" for n in each)
                crossings.append(
                    {"models": TITLES[wrong], "planner": LABELS[memory], "learner no worse after so many tries, by seed": text}
                )
    return {"claims": judged(CLAIMS, done), "success": rows, "crossover": crossings}


def _row(done: Cells, contestant: str, wrong: str) -> dict[str, Any]:
    found = _of(done, contestant, wrong)
    last = [one.values["rows"][-1] for one in found]
    points, values = success(done, contestant, wrong)
    row = {"models": TITLES[wrong], "contestant": LABELS[contestant]}
    row |= {f"success after {n} tries": estimate(values[:, i]) for i, n in enumerate(points)}
    row |= {f"share {fate}": estimate([one["fates"][i] for one in last]) for i, fate in enumerate(FATES) if i}
    names = {"seconds": "robot time per try [s]", "actions": "actions per try", "hours": "robot time in all [h]"}
    row |= {label: estimate([one[name] for one in last], 1) for name, label in names.items()}
    if contestant != "learner":
        row["planning per try [ms]"] = estimate([1000.0 * float(np.median(one.values["planning"])) for one in found], 1)
    return row


def verdict(leads: Mapping[str, Array], least: float) -> bool | None:
    """Return whether the learner's lead in success over each planner is at least `least`.

    `leads`: dict from a planner to the learner's share of successes minus that of the planner, (seeds,).  The intervals over the seeds
    decide: True if they all lie above `least`, False if one lies completely below it, else None.
    """
    return all_hold(decides(interval(lead), least=least) for lead in leads.values())


def success(done: Cells, contestant: str, wrong: str) -> tuple[list[int], Array]:
    """Return the numbers of tries after which a contestant was evaluated, and its shares of successes, (seeds, points).

    `wrong`: whose model is wrong, "nothing", "planners" or "everyone".
    """
    found = _of(done, contestant, wrong)
    points = list(found[0].cell.settings["tries"]) if found else []
    return points, np.array([[row["fates"][0] for row in one.values["rows"]] for one in found]).reshape(len(found), len(points))


def crossover(tries: list[int], learner: Array, peer: Array) -> Array:
    """Return, for each seed, the number of tries from which the learner's success is never again below the planner's, (seeds,).

    `tries`: numbers of tries after which both were evaluated.  `learner`, `peer`: shares of successes of learner and planner in these
    evaluations, (seeds, evaluations).  inf if the learner's last share is below the planner's.
    """
    ahead = learner >= peer
    for_good = np.flip(np.cumprod(np.flip(ahead, 1), axis=1), 1).astype(bool)
    return np.where(for_good.any(axis=1), np.array(tries)[for_good.argmax(axis=1)], np.inf)


def _leads(wrong: str, by: int, least: float) -> Rule:
    """Return the rule that the learner's share of successes after `by` tries exceeds that of every planner by at least `least`.

    `wrong`: whose model is wrong, "nothing", "planners" or "everyone".
    """

    def of_cells(done: Cells) -> Measured:
        tries, learner = success(done, "learner", wrong)
        if by not in tries:
            return "not measured", None
        at = tries.index(by)
        theirs = {memory: success(done, memory, wrong)[1][:, at] for memory in MEMORIES}
        leads = {memory: learner[:, at] - values for memory, values in theirs.items()}
        each = [f"{LABELS[memory]} {estimate(theirs[memory])}, learner's lead {estimate(leads[memory])}" for memory in MEMORIES]
        text = "; ".join([f"success: {LABELS['learner']} {estimate(learner[:, at])}", *each])
        return text, verdict({str(memory): lead for memory, lead in leads.items()}, least)

    return of_cells


def _enough(done: Cells) -> Measured:
    tries, learner = success(done, "learner", WRONG[0])
    values = success(done, "none", WRONG[0])[1]
    if not len(learner) or not len(values):
        return "not measured", None
    text = f"success: planner {{}}, learner after {tries[-1]} tries {estimate(learner[:, -1])}"
    return within(values[:, -1], least=PERFECT, text=text)


_PEERS = "every replanning peer: without memory, with memory of blocked motions, and also of poses that missed"
CLAIMS = (
    *(
        Claim(OUR_AIM, f"where {where}, the reach learner{text}", f"by {by} tries", rule=_leads(wrong, by, least))
        for wrong, where in (
            ("planners", "only the planners' model is wrong"),
            ("everyone", "MoBeE's model is as wrong as the planners'"),
        )
        for text, by, least in (
            (f" succeeds as often as {_PEERS} (at most {100.0 * MARGIN:.0f} points of success below)", EQUAL_BY, -MARGIN),
            (f"'s success is at least {100.0 * MIN_LEAD:.0f} points above {_PEERS}", LEAD_BY, MIN_LEAD),
        )
    ),
    Claim(
        "thesis 9.3",
        f"where no model is wrong, planning is enough: the planner peer succeeds in at least {PERFECT:.0%} of its tries",
        "-",
        rule=_enough,
    ),
)


def _of(done: Cells, contestant: str, wrong: str) -> list[CellResult]:
    """Return the cells (results of single runs) of a contestant in which the model of `wrong` is wrong, sorted by seed.

    The learner uses no planner's model.  So its runs of "planners" are valid for "nothing" too, and are returned for both.
    """
    wanted = {"contestant": contestant, "wrong": HIDDEN[0] if contestant == "learner" and wrong == WRONG[0] else wrong}
    found = [one for one in done.values() if wanted.items() <= one.cell.settings.items()]
    return sorted(found, key=lambda one: one.cell.seed)


def plot(done: Cells) -> Any:
    """Draw the share of successes over the tries, a panel for each kind of error.

    A star on the learner's curve, in the colour of a planner, marks the median number of tries of `crossover`, if it is one of the numbers
    after which there was an evaluation.  Returns a matplotlib figure.
    """
    drawing = new_figure(15.0, 4.6)
    for axes, wrong in zip(drawing.subplots(1, len(WRONG), sharey=True), WRONG, strict=True):
        for contestant, color in COLORS.items():
            tries, values = success(done, contestant, wrong)
            if len(values):
                draw_curve(axes, tries, values, color, LABELS[contestant])
        _mark_crossover(axes, done, wrong)
        axes.axvline(EQUAL_BY, color="0.8", linewidth=0.8, zorder=0)
        finish(axes, title=TITLES[wrong], xlabel="tries", xscale="log", ylim=(0.0, 1.02))
        ticks_at(axes, TRIES)
    drawing.axes[0].set_ylabel("share of tries with the palm within 2 cm")
    drawing.axes[1].legend(fontsize=8, loc="lower right")  # this panel has all four contestants
    return drawing


def _mark_crossover(axes: Any, done: Cells, wrong: str) -> None:
    """Draw a star on the learner's curve for each planner, at the median of `crossover` over the seeds.

    This is the number of tries from which the learner's success is never again below that of this planner.
    """
    tries, learner = success(done, "learner", wrong)
    for memory in MEMORIES:
        peer = success(done, memory, wrong)[1]
        if not len(learner) or learner.shape != peer.shape:
            continue
        at = float(np.median(crossover(tries, learner, peer)))
        if at in tries:
            height = interquartile_mean(learner[:, tries.index(int(at))])
            axes.plot([at], [height], "*", color=COLORS[memory], markersize=13, zorder=4, markeredgecolor="black", markeredgewidth=0.5)


EXPERIMENT = Experiment(
    claim="where the models are wrong, a reach learner overtakes a planner that replans after every change",
    source="thesis 5.3, 9.3; aim of this reproduction",
    method=Sweep(conditions, trial, findings, plot, require=require_ompl, summary=summary),
    claims=CLAIMS,
)
