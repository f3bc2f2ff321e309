# SPDX-License-Identifier: Apache-2.0
"""Compare an agent that has learned to reach with a planner (inverse kinematics and RRT-Connect) that knows the robot and the world.

Claim: the learned reacher is no worse than planning with a perfect model, also under encoder noise and for a moving target.  Single-query
planning is too slow to be used online: it takes 10 s for a path of both arms around a table's edge to a cup, and 125 s to smooth this path.
Source: thesis 1.5, 9.3.  Published: BT-RRT's 10 s and 125 s (Perez et al. 2011).  Run time: three minutes on 2 cores.

One arm: the right arm of the robot file "icub" (not that of 2014) under the default control law.  Targets, first poses and seeds are the
same for learner and planner; the palm can touch each target in a pose in which no joint limit exerts a force.  The learner has made 3000
curious transitions (actions for information gain, without a target) and 800 tries before, and learns nothing here.  The planner
(experiments/kit/reaching/planner_peer.py) knows the robot, its cables and the target's position, and plans again after every change; MoBeE
executes its motions.  "noise": encoder noise of 0.5 degrees, five times the usual; "moving": the target moves back and forth by 5 to 12 cm
at 3 cm/s without a stop.  Success: the palm is within 2 cm of the target's surface; the learner may reach three times, the planner has 20
actions.  Plant time stands still during planning, which is measured in processor time.

A moving target has another position after every motion of the planner, so that all paths except straight ones are planned again at each
corner.  The last motion takes a second or more, and goes to the position that the target had when this motion began.  The learner's reach
follows the target.  Neither of them predicts the target's motion.

Two arms (twelve joints, thesis 1.5): no figure that shows this problem was published.  Here both hands begin beside the table, below its
top or just above it, and end on both sides of a cup; poses are drawn anew for each query.  So the comparison of times shows orders of
magnitude only; it also compares today's processor with that of 2011.  Seed 0 was used while the planner was developed; therefore the
reported runs begin with --seed 1.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from experiments.kit.control.plant_runs import place
from experiments.kit.experiment import OUR_AIM, Claim, Experiment, Measured, Rule, judged
from experiments.kit.plots import draw_bars, finish, new_figure
from experiments.kit.reaching.arm import PART, TRANSITIONS, JudgedPlant, arm_belief, body
from experiments.kit.reaching.belief import PeerBelief, approach, rrt_connect, shortened
from experiments.kit.reaching.cases import EVERY, Attempt, Case, attempt, begun, make_cases, trained
from experiments.kit.reaching.planner_peer import PlannerPeer
from experiments.kit.reaching.targets import GOOD
from experiments.kit.rules import all_hold, decides
from experiments.kit.statistics import estimate, interquartile_mean, interval
from experiments.kit.sweep import Cells, Condition, Sweep, grouped
from mobee import Gains, Model, MotorParameters, OfflinePlant, World, box, cylinder
from mobee.arrays import Array
from mobee.errors import InvalidValue
from mobee.reach import reward_of
from mobee.roadmap.ompl import require_ompl

TRIES, CASES, QUERIES = 800, 40, 20
NOISE = np.deg2rad(0.5)  # rad
SCENES = ("perfect", "noise", "moving")
CONTESTANTS = ("learner", "peer")
ARM_MEASURES = ("found", "seconds", "smoothing", "corners", "missing")  # fields of a PlannedQuery
SITUATIONS = {"perfect": "a perfect model", "noise": "encoder noise five times the usual", "moving": "a target that never stops"}
PEER = dict.fromkeys(SCENES, "inverse kinematics and RRT-Connect") | {
    "moving": "inverse kinematics and RRT-Connect, whose motions go to where the target was when they began"
}
MARGIN = 0.05  # of success: a share at most this much lower still counts as equal
FEASIBLE, SMOOTHED = 10.0, 125.0  # s, published
SLOW = 0.1  # share of the published times from which a planner counts as too slow
COLORS = {"learner": "tab:red", "peer": "tab:blue"}
LABELS = {"learner": "learned reacher", "peer": "inverse kinematics and RRT-Connect"}

ARM_JOINTS = 6  # of each arm: all but the last of the wrist
SIDES = {"right_arm": 1.0, "left_arm": -1.0}
EDGE, TABLE_WIDTH, TOP = -0.14, 0.36, 0.0  # m: x where the table begins, its width, and the height of its top in the root frame
CUP = np.array([-0.3, 0.0, 0.05])  # m, its middle
GRIP = np.array([0.0, 0.08, 0.05])  # m, from the cup's middle to the right palm; for the left palm y is mirrored
BESIDE, BELOW = 0.22, 0.03  # m: the hands begin at least this far from the middle, and at most this far above the top
DRAWS, PAIRS, ENDS = 20_000, 4_000, 8  # poses of each arm that are drawn, pairs of them that are tried, end poses for the planner
EXTENSIONS = 20_000  # of the trees, at most
MAX_GRIP_ERROR = 0.002  # m

Runs = list[dict[str, Any]]  # values by seed


def conditions(arguments: argparse.Namespace) -> list[Condition]:
    """Return the settings of the runs: the cases of the right arm ("cases"), and the queries of both arms ("arms").

    With --quick there are fewer transitions, tries, cases and queries.
    """
    full: dict[str, Any] = {"transitions": TRANSITIONS, "tries": TRIES, "cases": CASES}
    cases = {"transitions": 500, "tries": 50, "cases": 4} if arguments.quick else full
    queries = 3 if arguments.quick else QUERIES
    return [Condition("cases", {"scene": "cases", **cases}, 2.0), Condition("arms", {"scene": "two arms", "queries": queries})]


def trial(settings: dict[str, Any], seed: int) -> dict[str, Any]:
    """Let learner and planner attempt the same cases of the right arm, or plan paths of both arms.

    For the cases, returns arrays (cases,) with keys "scene|contestant|measure"; the measures are "success", "missing" [m], "seconds" (plant
    time) and "thinking" (processor time for plans, s).  For both arms, returns arrays (queries,): "found", "seconds", "smoothing",
    "corners" and "missing", as in `PlannedQuery`.  `settings`: "scene", which is "cases" or "two arms".  With "cases" also "cases", their
    number, and "transitions" and "tries", numbers of the learner's training; with "two arms" also "queries", their number.  `seed`: of
    learner, cases and planner.
    """
    if settings["scene"] == "two arms":
        queries = [plan_both_arms(1000 * seed + number) for number in range(settings["queries"])]
        return {name: np.array([getattr(query, name) for query in queries]) for name in ARM_MEASURES}
    agent = trained(seed, settings["transitions"], settings["tries"], free=True)
    found: dict[str, Any] = {}
    for scene in SCENES:
        motors = replace(MotorParameters(), encoder_noise=NOISE) if scene == "noise" else None
        cases = make_cases("moving" if scene == "moving" else "free", settings["cases"], seed, free=True)
        cases = [replace(case, to_and_fro=True) for case in cases]
        seeds = range(1000 * seed, 1000 * seed + len(cases))
        attempts = {
            "learner": [attempt("both", agent, case, seed, motors) for case, seed in zip(cases, seeds, strict=True)],
            "peer": [planned(case, seed, motors) for case, seed in zip(cases, seeds, strict=True)],
        }
        for contestant, each in attempts.items():
            found[f"{scene}|{contestant}|success"] = np.array([one.missing <= GOOD for one in each])
            for measure in ("missing", "seconds", "thinking"):
                found[f"{scene}|{contestant}|{measure}"] = np.array([getattr(one, measure) for one in each])
    return found


def planned(case: Case, seed: int, motors: MotorParameters | None) -> Attempt:
    """Let the planner attempt a case of the right arm, and return the result.

    `seed`: of plant and planner.  `motors`: parameters of the motors; None: the default ones.
    """
    plant = JudgedPlant(begun(case, seed, motors))
    start = plant.time
    if case.to is not None:
        plant.inner.every(EVERY, lambda now: plant.present(case.seen_at(now - start)))
    peer = PlannerPeer(plant, arm_belief(case.world()), PART, "none", seed)
    tried = peer.try_problem(case.target, lambda: case.seen_at(plant.time - start))
    return Attempt(tried.missing, tried.seconds, tried.planning, reward_of(tried.missing))


@dataclass(frozen=True, slots=True)
class PlannedQuery:
    """The result of a query of both arms.

    `found`: whether there is a path.  `seconds`, `smoothing`: processor time to find the path, and to shorten it.  `corners`: number of
    poses of the path.  `missing`: distance of a palm from its planned position at the end of the executed path, the larger one of the two
    palms [m]; inf without a path.
    """

    found: bool
    seconds: float
    smoothing: float
    corners: int
    missing: float


def plan_both_arms(seed: int) -> PlannedQuery:
    """Draw first poses of both arms, plan a path to the cup, and follow it through MoBeE; returns times and remaining error.

    `seed`: of poses, plant and planner.
    """
    rng = np.random.default_rng([seed, 15])
    model = Model(body(), table_and_cup())
    both = _belief(model, tuple(SIDES))
    starts = _sound_pairs(both, [_poses_beside_table(part, rng) for part in SIDES], rng)
    ends = _sound_pairs(both, [_poses_at_cup(part, rng) for part in SIDES], rng)[:ENDS]
    before = time.process_time()
    path = rrt_connect(both, starts[0], ends, seed, extensions=EXTENSIONS)
    seconds = time.process_time() - before
    if path is None:
        return PlannedQuery(False, seconds, 0.0, 0, np.inf)
    before = time.process_time()
    path = shortened(both, path, rng)
    smoothing = time.process_time() - before
    return PlannedQuery(True, seconds, smoothing, len(path), _followed(both, path, seed))


def table_and_cup() -> World:
    """Return the world in which both arms plan: a table, and a cup on it."""
    world = World()
    world.add("table", box(0.6, TABLE_WIDTH, 0.5), position=(EDGE - 0.3, 0.0, TOP - 0.25))
    world.add("cup", cylinder(0.03, 0.1), position=CUP)
    return world


def _belief(model: Model, parts: tuple[str, ...]) -> PeerBelief:
    robot = model.robot
    motors = [name for part in parts for name in robot.parts[part].motors[:ARM_JOINTS]]
    clauses = [clause for clause in robot.clauses if clause.part in parts]
    return PeerBelief(model, motors, f"{parts[0].removesuffix('_arm')}_palm", clauses, Gains.default())


def _poses_beside_table(part: str, rng: np.random.Generator) -> Array:
    """Return poses of an arm (K, 6) rad with the hand low and beside the table."""
    belief = _belief(Model(body()), (part,))
    q = rng.uniform(belief.limits[:, 0], belief.limits[:, 1], (DRAWS, ARM_JOINTS))
    palm = belief.model.evaluate(belief.whole(q)).position(belief.marker)
    q = q[(SIDES[part] * palm[:, 1] > BESIDE) & (palm[:, 2] < TOP + BELOW)]
    found: Array = q[belief.sound(q)]
    return found


def _poses_at_cup(part: str, rng: np.random.Generator) -> Array:
    """Return poses of an arm (K, 6) rad with the palm beside the cup."""
    belief = _belief(Model(body()), (part,))
    grip = CUP + GRIP * (1.0, SIDES[part], 1.0)
    starts = rng.uniform(belief.limits[:, 0], belief.limits[:, 1], (256, ARM_JOINTS))
    q, error = approach(belief, starts, grip, 0.0, belief.limits)
    q = q[error < MAX_GRIP_ERROR]
    found: Array = q[belief.sound(q)]
    return found


def _sound_pairs(both: PeerBelief, arms: list[Array], rng: np.random.Generator) -> Array:
    """Combine random poses of each arm, and return those pairs (K, 12) rad that are valid in the world: see `PeerBelief.sound`.

    `arms`: poses of each arm, (N, 6) rad, in the order of SIDES.  Raises InvalidValue if no pair is valid.
    """
    if all(len(arm) for arm in arms):
        pairs = np.concatenate([arm[rng.integers(len(arm), size=PAIRS)] for arm in arms], axis=1)
        found: Array = pairs[both.sound(pairs)]
        if len(found):
            return found
    raise InvalidValue("no valid pose of both arms was found: use another seed.")


def _followed(both: PeerBelief, path: Array, seed: int) -> float:
    """Follow a path with both arms; returns the larger distance of a palm from its place in the last pose, m."""
    plant = OfflinePlant(Model(body(), table_and_cup()), seed, active=tuple(body().motors[i] for i in both.columns))
    place(plant, both.whole(path[0]))
    for corner in path[1:]:
        whole = both.whole(corner)
        for part in SIDES:
            plant.begin(part, whole[body().parts[part].slice])
        waiting = set(SIDES)
        while waiting:
            waiting -= {part for part, _ in plant.advance()}
    reached = plant.model.evaluate(plant.q)
    goal = both.model.evaluate(both.whole(path[-1]))
    palms = [f"{part.removesuffix('_arm')}_palm" for part in SIDES]
    return max(float(np.linalg.norm(reached.position(palm) - goal.position(palm))) for palm in palms)


def findings(found: Cells) -> dict[str, Any]:
    """Return the results of the sweep.

    Keys: "claims", a list with the judged claims, as dicts (`Claim.record`); "cases", a list with a row for each scene and contestant, as
    text: success, robot time [s], and planning per try [ms]; "both arms", a dict from "seconds", "smoothing", "corners" and "missing" (see
    `PlannedQuery`) to mean and interval as text, or None if it was not measured; and "distance that counts as success [m]".
    """
    cases, arms = _of(found, "cases"), _of(found, "two arms")
    rows = [
        {
            "scene": scene,
            "contestant": LABELS[contestant],
            "success": estimate(of_cases(cases, scene, contestant, "success")),
            "robot time [s]": estimate(of_cases(cases, scene, contestant, "seconds"), 1),
            "planning per try [ms]": estimate(1000.0 * of_cases(cases, scene, contestant, "thinking"), 1),
        }
        for scene in SCENES
        for contestant in CONTESTANTS
    ]
    numbers = {measure: of_queries(arms, measure) for measure in ARM_MEASURES[1:]}
    return {
        "claims": judged(CLAIMS, (cases, arms)),
        "cases": rows,
        "both arms": {name: estimate(values, 3) if len(values) else None for name, values in numbers.items()},
        "distance that counts as success [m]": GOOD,
    }


def _of(found: Cells, kind: str) -> Runs:
    return grouped(found, "scene", [kind]).get(kind, [])


def of_cases(cases: Runs, scene: str, contestant: str, measure: str) -> Array:
    """Return the mean of a measure of `trial` over the cases, for each seed, (seeds,).

    `cases`: the results of `trial` for each seed.  `scene`, `contestant`, `measure`: the mean is over the values under the key
    "scene|contestant|measure".
    """
    return np.array([values[f"{scene}|{contestant}|{measure}"].mean() for values in cases])


def of_queries(arms: Runs, measure: str) -> Array:
    """Return the median of `measure`, a field of `PlannedQuery`, over the queries of each seed, (seeds,).

    `arms`: the results of `trial` for each seed.  "seconds" is over all queries, the other fields over those with a path; seeds without any
    are left out.
    """
    counted = [values[measure][slice(None) if measure == "seconds" else values["found"].astype(bool)] for values in arms]
    return np.array([float(np.median(values)) for values in counted if len(values)])


Both = tuple[Runs, Runs]  # the runs of the cases, and those of both arms


def _no_worse(scene: str) -> Rule:
    """Return the rule that the learner succeeds as often as the planner."""

    def of_runs(runs: Both) -> Measured:
        learner, peer = (of_cases(runs[0], scene, contestant, "success") for contestant in CONTESTANTS)
        times = [f"{1000.0 * interquartile_mean(of_cases(runs[0], scene, one, 'thinking')):.1f} ms" for one in CONTESTANTS]
        text = f"success: learner {estimate(learner)}, planner {estimate(peer)}; planning per try: {times[0]}, planner {times[1]}"
        return text, decides(interval(learner - peer), least=-MARGIN)

    return of_runs


def _takes_long(runs: Both) -> Measured:
    """Judge whether the planner takes at least a tenth of the published times."""
    took, more = (of_queries(runs[1], measure) for measure in ("seconds", "smoothing"))
    if not len(more):
        return "no path was found", None
    share = estimate([values["found"].mean() for values in runs[1]])
    text = f"{estimate(took, 3)} s of processor time, and {estimate(more, 3)} s for smoothing, with a compiled test of poses;"
    text += f" a path is found in {share} of the queries"
    pairs = ((took, FEASIBLE), (more, SMOOTHED))
    return text, all_hold(decides(interval(values), least=SLOW * published) for values, published in pairs)


CLAIMS = (
    *(
        Claim(
            f"thesis 9.3; {OUR_AIM}",
            f"with {SITUATIONS[scene]} the learned reacher is no worse than {PEER[scene]} "
            f"(at most {100 * MARGIN:.0f} points of success below)",
            "-",
            rule=_no_worse(scene),
        )
        for scene in SCENES
    ),
    Claim(
        "thesis 1.5, with a problem of our own",
        "single query planning is too slow to be used online: a path of both arms (12 DOF) around a table's edge to a cup takes at least "
        f"{SLOW * FEASIBLE:.0f} s of processor time, and smoothing it {SLOW * SMOOTHED:.1f} s more, a tenth of the published times",
        f"{FEASIBLE:.0f} s, another {SMOOTHED:.0f} s",
        rule=_takes_long,
        untested="the published problem, program and computer",
    ),
)


def plot(found: Cells) -> Any:
    """Draw success and planning time of learner and planner, and the planner's times for both arms.

    Returns a matplotlib figure.  Raises InvalidValue if the cases or the queries of both arms have no finished run.
    """
    cases, arms = _of(found, "cases"), _of(found, "two arms")
    if not cases or not arms:
        raise InvalidValue("some cells are not finished: continue the run with --resume.")
    drawing = new_figure(15.0, 4.2)
    success, thinking, both = drawing.subplots(1, 3)
    for axes, measure, factor in ((success, "success", 1.0), (thinking, "thinking", 1000.0)):
        for number, contestant in enumerate(CONTESTANTS):
            values = [factor * of_cases(cases, scene, contestant, measure) for scene in SCENES]
            draw_bars(axes, np.arange(3) + 0.4 * (number - 0.5), values, 0.38, COLORS[contestant], LABELS[contestant])
        names = [SITUATIONS[scene].replace(" that", "\nthat").replace(" five", "\nfive") for scene in SCENES]
        axes.set_xticks(range(3), names, fontsize=8)
        axes.grid(alpha=0.2, axis="y")
    success.set(ylabel="share of cases with the palm within 2 cm", ylim=(0.0, 1.02))
    success.legend(fontsize=8, loc="lower left")
    thinking.set(ylabel="planning per try [ms]", yscale="log")
    _draw_arms(both, arms)
    return drawing


def _draw_arms(axes: Any, arms: Runs) -> None:
    """Draw the distribution of the planner's times for both arms."""
    queries = sum(len(values["found"]) for values in arms)
    for measure, color, label in (("seconds", "tab:blue", "finding a path"), ("smoothing", "tab:cyan", "shortening it")):
        took = np.sort(np.concatenate([values[measure][values["found"].astype(bool)] for values in arms]))
        axes.plot(took, np.arange(1, len(took) + 1) / queries, color=color, label=label)
    axes.axvline(FEASIBLE, color="0.5", linestyle="--", label="finding a path, BT-RRT as published")
    xlabel = "both arms around the table's edge: processor time [s]"
    finish(axes, legend=8, xscale="log", xlabel=xlabel, ylabel="share of queries", ylim=(0.0, 1.02))


EXPERIMENT = Experiment(
    claim="the learned reacher is no worse than a planner with a perfect model, also under encoder noise and for moving targets",
    source="thesis 1.5, 9.3",
    method=Sweep(conditions, trial, findings, plot, require=require_ompl),
    claims=CLAIMS,
)
