# SPDX-License-Identifier: Apache-2.0
"""Change the world of the live robot after a reach learner has learned in it, and measure how soon the learner is back.

Claim: as in the experiment changed-worlds, but on a robot with physics: a learner that detects changes, and sees its hand and the objects,
is back at .95 of the score of an oracle that knows the new world within 60 problem-tries, with at most 2 failed transitions per evaluation.
Source: aim of this reproduction, to thesis 7.2.6, where actions "suddenly brought the robot somewhere else".  Published: no numbers.
Run time: 1 h 45 min on 2 cores.

The robot, its table, law, states and targets are those of the experiment live-reach: the iCub in lockstep under the default law, with ticks
of 20 ms.  A learner (`ReachAgent` with predictor "gp", strategy "ucb", failures "alike" and detector "run_length") makes 3000 curious
transitions and 200 tries of the 27 targets on the offline plant with the identified motors, then 27 tries on the live robot.  Then the
robot is started again in a changed world, once for each change.  A ball with a radius of 10 cm has appeared, the first of the 20 balls of
changed-worlds; or the table is 8 cm higher; or the encoders of four joints of the arm are wrong by 5 degrees each, in the simulator, so
that controller and model have wrong angles too.

The learner is evaluated once as it is, without knowledge of the change.  Its eyes and its practice are those of the fifth learner of
changed-worlds.  It sees its hand with an error of 5 mm, and an object that appeared or moved with errors of 1 cm (5 mm in a ball's radius);
it then makes 1000 tries on the offline plant in the world as it is seen.  That plant is not the robot here, which has physics: its motors
are only similar, and contacts do not stop it.  Then the learner makes 60 live tries, and is evaluated twice.

The oracle knows the reward of one reach from each state for each target, and which transitions failed in at least one of two tries without
a target.  Both were measured on the offline plant in the changed world, where the arm is put directly into each state; on the live robot
this would take two hours.  Three live tries of each target have shown the oracle which transitions a target blocks.  Its rewards are single
samples of another plant: a learner can exceed its score.  The oracle's encoders are as wrong as the learner's.  All are judged by the
simulator's joint positions.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, Literal

import numpy as np
from msgspec import Struct, structs

from bus_schema.messages import Truth as TruthMessage
from experiments.claims.ch8_reaching import changed_worlds
from experiments.claims.ch8_reaching.changed_worlds import (
    BACK,
    BALLS,
    MAX_FAILURES,
    PRACTICE,
    RADIUS,
    RAISED,
    TRIES,
    TURNS,
    change_world,
    claims_of_each_change,
    errors_after,
)
from experiments.claims.ch8_reaching.live_reach.contestants import Hand
from experiments.claims.ch8_reaching.live_reach.problems import (
    GAINS,
    RATE,
    ROBOT,
    TRANSITIONS,
    WRIST,
    grid_targets,
    robot,
    space,
    train,
)
from experiments.kit.control.plant_runs import place
from experiments.kit.experiment import MIN_SEEDS, Experiment, Measured, judged
from experiments.kit.learning.arm import RIGHT
from experiments.kit.live.launch import TABLE, LaunchFailed, add_backend, append_done, launch, read_done, read_job, write_job
from experiments.kit.plots import finish, new_figure, ticks_at
from experiments.kit.reaching.arm import MARKER, PART, JudgedPlant, SeenHand
from experiments.kit.reaching.truth import Truth, failed_transitions, load_truth, oracle, remaining_errors
from experiments.kit.rules import decides
from experiments.kit.statistics import estimate, interval
from experiments.kit.sweep import Cells, Condition, Sweep
from mobee import Gains, Model, MotorParameters, OfflinePlant, World, load_robot, load_world
from mobee.arrays import Array
from mobee.errors import InvalidValue
from mobee.learning.reaching.reach_agent import ReachAgent
from mobee.learning.reaching.store import ReachStore
from mobee.learning.record import load_learned
from mobee.reach import ReachOutcome, ReachPlant, ReachTarget
from mobee.robot.robot import Robot
from mobee.store import STORE
from services.common.service import Service

LIVE_TRIES = 27  # before the change, after TRIES (200) offline
CHECKPOINTS, REPETITIONS = (0, 60), (1, 2)  # problem-tries after it, and the number of evaluations after these
ORACLE_REPETITIONS = 4  # evaluations
BALL = 0  # number of the ball that appears
SEEDS = 5
CHANGES = {change: name for change, name in changed_worlds.CHANGES.items() if change != "nothing"}
SCALE = 0.01  # m, unit of the remaining error in the reward
KEPT_TICKS = 4096
LATE = 5.0  # s of real time for which a message of the simulator's true posture may be late
MAX_SECONDS = 1e5  # s of robot time of a launch

PERFORM = "experiments.claims.ch8_reaching.changed_worlds_live:perform"


class TrueHand(Hand):
    """The live arm, whose reaches are judged by the simulator's true joint positions.

    It is also a `experiments.kit.reaching.arm.Judge`: it can judge the reaches of a plant that acts through it and corrects its encoders.
    """

    def __init__(self, service: Service, robot: Robot) -> None:
        super().__init__(service, robot)
        self.reached: Array = np.full(3, np.nan)
        self._model, self._target = Model(robot), ReachTarget(np.zeros(3))
        self._postures: dict[int, list[float]] = {}  # by the tick after which it was measured
        self._last = 0
        service.on_each(TruthMessage, self._note_truth)

    def present(self, target: ReachTarget | None) -> None:
        """Present a target, or remove it (None); the last target is kept to judge the reach."""
        self._target = target or self._target
        super().present(target)

    def reach(self, part: str, marker: str, stay: bool = False) -> ReachOutcome:
        """Reach as `BusPlant.reach` does; the outcome has the true position of the marker and the true error that remains."""
        found = super().reach(part, marker, stay)
        self.reached = self._place(marker, self.end - 1)
        return replace(found, marker=self.reached, missing=self._target.missing(self.reached))

    def marker_at(self, marker: str) -> Array:
        """Return the true position of the marker at the end of the last tick, (3,) m, root frame."""
        return self._place(marker, self.tick - 1)

    def _place(self, marker: str, k: int) -> Array:
        """Return the true position of a marker at the end of tick k; waits until the simulator's message has arrived."""
        self._link.spin(time.monotonic() + LATE, lambda: self._last >= k)
        if k not in self._postures:
            raise InvalidValue(f"the true posture of tick {k} has not arrived; the last is of tick {self._last}")
        return self._model.evaluate(np.array(self._postures[k])).position(marker)

    def _note_truth(self, truth: TruthMessage) -> None:
        self._postures[truth.k], self._last = truth.q, truth.k
        self._postures.pop(truth.k - KEPT_TICKS, None)


class Job(Struct, frozen=True):
    """What the performer does in one launch of the system.

    `kind`: "before" (live tries before the change), "after" (evaluations and tries after it) or "oracle".  `store`: path of the file with
    what was learned offline and before the change.  `change`: key of CHANGES.  `tries`: live tries before the change, or after it.
    `practice`: tries in the simulated world.  `targets`: number of targets after the change; None: all 27.  `truth`: path of the file with
    the oracle's knowledge.
    """

    kind: Literal["before", "after", "oracle"]
    seed: int
    store: str
    change: str
    tries: int
    practice: int
    truth: str = ""
    targets: int | None = None


class Score(Struct, frozen=True):
    """The results of the evaluations at one time; the first three are means over these evaluations.

    `score`: sum of the rewards.  `failures`: number of failed transitions.  `without`: number of targets for which no reach was made.
    `detected`: number of changes detected so far.
    """

    score: float
    failures: float
    without: float
    detected: int


def perform(service: Service, folder: Path) -> None:
    """Do the job that is written in the folder, and append the score of each checkpoint to the folder.

    The launched performer calls this function with its own service.
    """
    job, robot = read_job(folder, Job), load_robot(service.config.robot)
    hand = TrueHand(service, robot)
    service.ready()
    hand.measure(PART)
    {"before": _before, "after": _after, "oracle": _oracle}[job.kind](hand, job, folder)
    hand.leave()


def _before(hand: TrueHand, job: Job, folder: Path) -> None:
    with ReachStore(job.store, PART) as store:
        _agent(hand, job, store).learn(grid_targets(), job.tries)


def _after(hand: TrueHand, job: Job, folder: Path) -> None:
    eyes, targets = SeenHand(hand.robot, RIGHT, job.seed), grid_targets()[: job.targets]
    agent = _agent(eyes.correct(hand), job)
    with ReachStore(job.store, PART, read_only=True) as store:
        agent.replay(store.problems(), store.load())

    def evaluate(repetitions: int) -> None:
        eyes.is_seen = False
        detected = len(eyes.offsets.changes) + (0 if agent.changes is None else len(agent.changes.detected))
        append_done(folder, _score(agent, targets, repetitions, detected))
        eyes.is_seen = True

    evaluate(REPETITIONS[0])
    if job.change != "turn":
        agent.practise(seen_plant(job.change, job.seed), targets, job.practice)
    agent.learn(targets, job.tries)
    evaluate(REPETITIONS[1])


def _agent(plant: ReachPlant, job: Job, store: ReachStore | None = None) -> ReachAgent:
    known = load_learned(job.store, PART, plant.robot)
    return ReachAgent(
        known.space, plant, known.model.debiased(), marker=MARKER, predictor="gp", strategy="ucb", failures="alike",
        detector="run_length", seed=job.seed, store=store,
    )  # fmt: skip


def _oracle(hand: TrueHand, job: Job, folder: Path) -> None:
    known, targets = load_learned(job.store, PART, hand.robot), grid_targets()[: job.targets]
    agent = oracle(load_truth(Path(job.truth)), known.space, hand, known.model.debiased(), MARKER, SCALE, job.seed)
    agent.learn(targets, job.tries)
    append_done(folder, _score(agent, targets, ORACLE_REPETITIONS, 0))


def _score(agent: ReachAgent, targets: Sequence[ReachTarget], repetitions: int, detected: int) -> Score:
    found = agent.evaluate(targets, repetitions)
    without = float(np.isnan(found.missing).sum(axis=1).mean())
    return Score(float(found.scores.mean()), float(found.failures.sum(axis=1).mean()), without, detected)


def measured_truth(change: str, seed: int, targets: Sequence[ReachTarget]) -> Truth:
    """Return what the oracle of a changed world knows of the targets, measured on the offline plant in this world.

    `change`: key of CHANGES.  `seed`: of the plant.
    """
    plant = JudgedPlant(offline_plant_in(changed_world(change), seed), errors_after(change, robot()))
    enter = partial(_put_into, plant)
    missing, failed = remaining_errors(plant, space(), targets, enter), failed_transitions(plant, space(), 2, enter)
    every_place = np.broadcast_to(failed, (len(targets), *failed.shape))  # measured without a target
    return Truth(np.array([one.position for one in targets]), missing[:, :, None], every_place)


def _put_into(plant: JudgedPlant, state: int) -> bool:
    """Put the simulated robot into a state, without a path to it; return whether it stays there."""
    q = plant.robot.home.copy()
    q[plant.robot.part(PART).slice] = space().target(state)
    plant.present(None)
    place(plant.inner, q)
    return space().state_of(plant.act(PART, space().target(state)).q) == state


def seen_plant(change: str, seed: int) -> OfflinePlant:
    """Return the offline plant in the world as a learner sees it, with random errors of the object that has appeared or moved.

    `change`: "ball" or "table".  `seed`: of errors and plant.
    """
    return offline_plant_in(changed_world(change, np.random.default_rng([seed, 7])), seed)


def offline_plant_in(world: World, seed: int) -> OfflinePlant:
    """Return the offline plant of the live robot in another world; `seed`: of the plant."""
    motors, active = MotorParameters.identified(ROBOT), robot().parts[PART].motors[:WRIST]
    return OfflinePlant(Model(robot(), world), seed, Gains.named(GAINS), motors, 1.0 / RATE, active=active)


def changed_world(change: str, seen: np.random.Generator | None = None) -> World:
    """Return the world after a change; `change`: key of CHANGES, "" for none.  `seen`: draws errors, as in `change_world`."""
    return change_world(load_world(str(TABLE)), change, BALL, seen)


def world_file(change: str, folder: Path) -> Path:
    """Write the world after a change to a file in the folder, for the live system, and return its path."""
    text, path = TABLE.read_text(), folder / "changed.xml"
    if change == "table":
        text = text.replace('pz="-0.35"', f'pz="{RAISED - 0.35:g}"')
    if change == "ball":
        x, y, z = BALLS[BALL]
        text = text.replace("</World>", f' <sphere name="ball" radius="{RADIUS}" px="{x}" py="{y}" pz="{z}"/>\n</World>')
    path.write_text(text)
    return path


def conditions(arguments: argparse.Namespace) -> list[Condition]:
    """Return the settings of the runs: the learner, and the oracle after each change; --quick: one seed, one change, few targets."""
    quick = arguments.quick
    settings = {"backend": arguments.backend, "changes": ["ball"] if quick else list(CHANGES), "practice": 20 if quick else PRACTICE}
    settings |= {"tries": 20 if quick else TRIES, "before": 3 if quick else LIVE_TRIES, "after": 3 if quick else CHECKPOINTS[-1]}
    settings |= {"targets": 3} if quick else {}
    name, seeds = ("quick-learner", (arguments.seed,)) if quick else ("learner", ())
    found = [Condition(name, settings | {"runs": "learner"}, 3.0, seeds)]
    for change in settings["changes"]:
        alone = {"changes": [change], "runs": "oracle", "after": 3 if quick else 3 * len(grid_targets())}
        found.append(Condition(f"{'quick-' if quick else ''}{change}-oracle", settings | alone, seeds=(arguments.seed,)))
    return found


def trial(settings: dict[str, Any], seed: int) -> dict[str, Any]:
    """Let a learner learn offline and live, and learn again after each of C changes; or evaluate the oracle of one changed world.

    The learner is evaluated directly after the change and after its live tries (L = 2), the oracle once (L = 1).  Returns arrays (C, L) of
    means over the evaluations at one time: `score`, sum of the rewards; `failures`, number of failed transitions; `without`, number of
    targets for which no reach was made; and `detected`, number of changes detected until then.  `settings`: "runs", "learner" or "oracle";
    "changes", keys of CHANGES; "backend".  Numbers of tries before the change: "tries", offline; "before", live.  After the change:
    "practice", in a simulation of the changed world; "after", live.  "targets": number of targets after it.  `seed`: of learner and robot.
    """
    rows: list[list[Score]] = []
    with tempfile.TemporaryDirectory() as scratch:
        place, backend = Path(scratch), settings["backend"]
        train(place / STORE, seed, TRANSITIONS, settings["tries"])
        before = Job("before", seed, str(place / STORE), "", settings["before"], settings["practice"], targets=settings.get("targets"))
        if settings["runs"] == "learner":
            _launched(place / "before", before, backend)
        kind: Literal["after", "oracle"] = "after" if settings["runs"] == "learner" else "oracle"
        for change in settings["changes"]:
            job = structs.replace(before, kind=kind, change=change, tries=settings["after"], truth=str(place / "truth.npz"))
            if kind == "oracle":
                measured_truth(change, seed, grid_targets()[: job.targets]).save(Path(job.truth))
            rows.append(_launched(place / change, job, backend))
    names = ("score", "failures", "without", "detected")
    return {name: np.array([[getattr(one, name) for one in row] for row in rows]) for name in names}


def _launched(folder: Path, job: Job, backend: str) -> list[Score]:
    """Launch the live system for one job, and return the scores that it wrote; raises LaunchFailed if the job did not write all of them."""
    write_job(folder, job)
    world = world_file(job.change, folder)
    simulator: dict[str, Any] = {"backend": backend, "truth_rate": RATE}
    if job.change == "turn":
        simulator["encoder_errors"] = {name: -turn for name, turn in TURNS.items()}
    launch(
        folder, PERFORM, title=f"Changed worlds with {backend}: {job.kind} {job.change}", world=str(world), seed=job.seed, rate=RATE,
        speed=1.0, seconds=MAX_SECONDS, simulator=simulator,
    )  # fmt: skip
    scores = read_done(folder, Score)
    if len(scores) < (wanted := {"before": 0, "after": len(REPETITIONS), "oracle": 1}[job.kind]):
        raise LaunchFailed(f"{folder.name}: the system ended after {len(scores)} of {wanted} evaluations.")
    return scores


Runs = Mapping[str, list[dict[str, Any]]]  # by change


def runs_of(found: Cells) -> Runs:
    """Return a dict from the change of the world to the results of the learner's runs after it, sorted by seed.

    A result is a dict.  Under each key of `trial` it has the numbers after this change, (2,): directly after it, and after the live tries.
    Under "oracle" it has the score of the agent that knows the changed world.  A change is left out until the run of its oracle has
    finished.
    """
    learners = [one for one in found.values() if one.cell.settings["runs"] == "learner"]
    others = [one for one in found.values() if one.cell.settings["runs"] == "oracle"]
    oracles = {one.cell.settings["changes"][0]: float(one.values["score"][0, 0]) for one in others}
    return {
        change: [
            {name: values[one.cell.settings["changes"].index(change)] for name, values in one.values.items()} | {"oracle": score}
            for one in sorted(learners, key=lambda one: one.cell.seed)
        ]
        for change, score in oracles.items()
        if learners
    }


def relative(runs: list[dict[str, Any]]) -> Array:
    """Return the scores of N runs directly after the change and after the live tries, divided by the score of the oracle, (N, 2)."""
    return np.array([run["score"] / run["oracle"] for run in runs])


def failures(runs: list[dict[str, Any]]) -> Array:
    """Return the mean number of failed transitions per evaluation, for N runs, (N, 2).

    The columns are the two times of the evaluations: directly after the change, and after the live tries.
    """
    return np.array([run["failures"] for run in runs])


def findings(found: Cells) -> dict[str, Any]:
    """Return the results: "changes" is a dict from the change to a row, "claims" a list with the judged claims, as dicts.

    The numbers of a row: "runs", the oracle's score, scores and failed transitions after numbers of problem-tries (attempts to reach one
    target), and runs in which a change was detected.
    """
    runs = runs_of(found)
    return {
        "changes": {CHANGES[change]: _row(runs[change]) for change in CHANGES if change in runs},
        "claims": judged(CLAIMS, runs, set(runs) == set(CHANGES)),
    }


def _row(runs: list[dict[str, Any]]) -> dict[str, Any]:
    points = [f"after {n}" for n in CHECKPOINTS]
    return (
        {"runs": len(runs), "oracle's score": runs[0]["oracle"]}
        | {f"score over the oracle's, {at}": estimate(column) for at, column in zip(points, relative(runs).T, strict=True)}
        | {f"failed transitions, {at}": estimate(column, 1) for at, column in zip(points, failures(runs).T, strict=True)}
        | {"runs with a detection": sum(bool(run["detected"][-1] > run["detected"][0]) for run in runs)}
    )


def _compared(runs: list[dict[str, Any]], of: Callable[[list[dict[str, Any]]], Array], digits: int) -> tuple[str, Array]:
    """Return a measure of N runs as text, directly after the change and after the live tries, and the numbers after the live tries, (N,).

    `of`: function that computes the measure of the runs at both times, (N, 2), as `relative` or `failures`.
    """
    before, after = of(runs).T
    few = "" if len(after) >= MIN_SEEDS else f" ({len(after)} runs, too few for a verdict)"
    return f"{estimate(after, digits)}; directly after the change {estimate(before, digits)}{few}", after


def _back(change: str, runs: Runs) -> Measured:
    text, after = _compared(runs[change], relative, 2)
    return text, decides(interval(after), least=BACK) if len(after) >= MIN_SEEDS else None


def _few(change: str, runs: Runs) -> Measured:
    text, after = _compared(runs[change], failures, 1)
    return text, decides(interval(after), most=MAX_FAILURES) if len(after) >= MIN_SEEDS else None


CLAIMS = tuple(claims_of_each_change(_back, _few, "on the live robot, "))


def plot(found: Cells) -> Any:
    """Draw scores and failed transitions of all runs over the problem-tries since the change, in a column of panels for each change.

    Returns a matplotlib figure.  A problem-try is one attempt to reach one target.
    """
    runs = runs_of(found)
    drawing = new_figure(12.0, 6.0)
    panels = drawing.subplots(2, len(CHANGES), sharex=True, sharey="row")
    for column, (change, title) in enumerate(CHANGES.items()):
        for axes, of, bound in zip(panels[:, column], (relative, failures), (BACK, MAX_FAILURES), strict=True):
            for line in of(runs.get(change, [])):
                axes.plot(CHECKPOINTS, line, "o-", color="C0", markersize=4, linewidth=0.8)
            axes.axhline(bound, color="k", linestyle=":", linewidth=0.8)
        finish(panels[0, column], title=title)
        finish(panels[1, column], xlabel="problem-tries since the change")
        ticks_at(panels[1, column], CHECKPOINTS)
    panels[0, 0].set_ylabel("score over the oracle's")
    panels[1, 0].set_ylabel("failed transitions per evaluation")
    return drawing


EXPERIMENT = Experiment(
    claim="on the live robot, a reach learner that detects changes and sees soon has an oracle's score",
    source="aim of this reproduction, to thesis 7.2.6",
    method=Sweep(conditions, trial, findings, plot, seeds=SEEDS, add_options=add_backend),
    claims=CLAIMS,
)
