# SPDX-License-Identifier: Apache-2.0
"""Compare roadmap planners (PRM) with the learned MDP planner on the same noisy robot, of which the roadmaps have a wrong model.

Claim: "a plan first, act later approach, such as PRM planning, will never work well on robots such as the iCub", and the roadmap's "simple
graph is insufficient"; an MDP is needed.  Source: paper 2.3, 3.1 (which announce this comparison); thesis 4.2.
Published: no numbers.  Run time: four minutes on 2 cores.

The left arm of the published robot moves among four balls.  Each of 60 queries begins at rest, ends in the Voronoi cell of a state of the
rank 3 lattice, and lasts at most 120 s.  Half of the queries are hard: a straight motion does not reach the goal.  The model that the
roadmaps use lacks the constraints of the shoulder's cables ("no cables"), or its balls are wrong by 1 cm and its joints by 3 degrees
("miscalibrated"), or both; "gross" lacks the cables and has three times these errors.  The MDP has no such model: it learns by curiosity
before the queries, or from the queries alone.  A path through a roadmap is planned once, or again after each failed motion, which is
removed for the present query ("repairs") or for all later queries too ("remembers").  A roadmap does not work well if it succeeds in less
than 95 % of the hard queries and less often than the MDP.  The seeds draw balls, noise and queries; all runs share the lattice's graph.
"""

from __future__ import annotations

import argparse
from collections import defaultdict
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from experiments.kit.control.plant_runs import place
from experiments.kit.experiment import Envelope, Experiment, Measured, claim, judged
from experiments.kit.learning.arm import ARM_NEIGHBOURS, JOINTS, PART, RANK3, arm_clauses, arm_plant, arm_space, columns, robot, whole
from experiments.kit.learning.arm_planners import (
    KINDS,
    NEIGHBOURS,
    Belief,
    Learned,
    PlannedOnce,
    Repaired,
    Rival,
    Straight,
    make_roadmap,
    with_goals,
)
from experiments.kit.plots import draw_band, draw_points, finish, new_figure
from experiments.kit.rules import all_hold, decides, is_above
from experiments.kit.statistics import estimate, interquartile_mean, interval
from experiments.kit.sweep import Cells, Condition, Sweep
from mobee import CuriousAgent, Lattice, Model, OfflinePlant, World, sphere
from mobee.arrays import Array, Ints
from mobee.errors import InvalidValue
from mobee.roadmap.ompl import require_ompl

BELIEFS = ("true", "no cables", "miscalibrated", "both", "gross")
WRONG = ("both", "no cables", "miscalibrated", "gross")
BALLS, RADIUS = 4, 0.03  # m
SHIFT, TURN = 0.01, np.deg2rad(3.0)  # m and rad, errors of the believed position of a ball and of a joint angle
MAX_MOTIONS = 20_000  # among which the queries are found
QUERY_TIMEOUT = 120.0  # s of plant time per query

LEARNED = (0, 1000, 4000)  # transitions before the first query
QUERIES = 60
MIN_SUCCESS = 0.95  # success in hard queries from which a planner "works well"
BLOCK_SIZE = 20  # queries whose mean is one point of a curve
NUMBERS = {
    "success": "success",
    "hard": "success in hard queries",
    "seconds": "robot time per query [s]",
    "actions": "actions per query",
    "repairs": "repairs per query",
}

COLORS = {
    "OMPL, planned once": "tab:gray",
    "OMPL, repairs": "tab:orange",
    "OMPL, remembers": "tab:red",
    "lattice, planned once": "0.75",
    "lattice, repairs": "tab:cyan",
    "lattice, remembers": "tab:blue",
    "MDP, 0 learned": "yellowgreen",
    "MDP, 1000 learned": "limegreen",
    "MDP, 4000 learned": "darkgreen",
    "straight": "black",
}
SHOWN = "both"  # the roadmaps' model in the curves


def conditions(arguments: argparse.Namespace) -> list[Condition]:
    """Return the settings of the runs: straight motions, the MDP after 0, 1000 and 4000 transitions, and roadmaps with each model.

    The models that the roadmaps use have no errors, or one of four kinds of errors, as in `believed`.  With --quick there are 20 queries
    instead of 60.
    """
    shared = {"queries": 20 if arguments.quick else QUERIES}
    learned = [Condition(f"mdp-{n}", {**shared, "learned": n}, 1.0 + n / 1000) for n in LEARNED]
    roadmaps = [Condition(f"roadmaps-{belief.replace(' ', '-')}", {**shared, "belief": belief}, 8.0) for belief in BELIEFS]
    return [Condition("straight", shared), *learned, *roadmaps]


def trial(settings: dict[str, Any], seed: int) -> dict[str, Any]:
    """Let the planners of one kind (straight, MDP or roadmaps) answer all queries.

    Returns `hard` (Q,), whether a straight motion had failed in each of the Q queries; and arrays with keys "planner|measure".  The
    measures are "success", "seconds" (time of the simulated robot), "actions" and "repairs" (actions that did not end as planned), each
    (Q,), and "cost", a number: for the MDP the hours of plant time before the first query, for roadmaps the thousands of poses that were
    checked before it.  `settings`: "queries", their number; for the MDP also "learned", the number of transitions; for roadmaps "belief",
    the kind of errors in their model, as in `believed`.  `seed`: of scene and planners.
    """
    scene, lattice = make_scene(seed, settings["queries"]), space()
    values: dict[str, Any] = {"hard": scene.is_hard}
    for name, rival, cost in _rivals(settings, seed, scene, lattice):
        got = answer(scene, rival, seed)
        for measure in ("success", "seconds", "actions", "repairs"):
            values[f"{name}|{measure}"] = np.asarray(getattr(got, measure))
        values[f"{name}|cost"] = np.array(cost)
    return values


def _rivals(settings: dict[str, Any], seed: int, scene: Scene, lattice: Lattice) -> Iterator[tuple[str, Rival, float]]:
    """Yield the compared planners of one kind (straight, MDP or roadmaps) as name, planner, and cost before the first query.

    The cost is the plant time of learning [h] for the MDP, the thousands of poses that were checked for roadmaps, and 0 for straight
    motions.
    """
    if "learned" in settings:
        plant = arm_plant(seed + 500, world=world_of(scene.balls))
        agent = CuriousAgent(lattice, plant, seed=seed)
        agent.run(settings["learned"])
        yield f"MDP, {settings['learned']} learned", Learned(lattice, agent.model), plant.time / 3600.0
    elif "belief" in settings:
        belief = believed(scene, settings["belief"])
        for kind in KINDS:
            before = belief.checked
            roadmap = make_roadmap(kind, belief, lattice, seed)
            vertex_of = with_goals(roadmap, lattice, scene.goals)
            checked = (belief.checked - before) / 1000.0
            yield f"{kind}, planned once", PlannedOnce(roadmap, vertex_of, NEIGHBOURS), checked
            for remembers in (False, True):
                yield f"{kind}, {'remembers' if remembers else 'repairs'}", Repaired(roadmap, vertex_of, NEIGHBOURS, remembers), checked
    else:
        yield "straight", Straight(lattice), 0.0


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """The true world, the errors of the planners' model, and Q queries.

    In a query the arm starts at rest, and has to reach the Voronoi cell of a lattice state.  `balls`: (B, 3) m, true positions.  `shifts`:
    (B, 3) m, believed minus true positions.  `turns`: (4,) rad, believed minus true joint angles.  `starts`: (Q, 4) rad, start poses of the
    arm.  `goals`: (Q,) goal states.  `is_hard`: (Q,), whether the straight motion failed when it was tried.
    """

    balls: Array
    shifts: Array
    turns: Array
    starts: Array
    goals: Ints
    is_hard: NDArray[np.bool_]


def space() -> Lattice:
    """Return the published lattice of rank 3: 81 states of the left arm with 16 neighbours each."""
    return arm_space(RANK3, ARM_NEIGHBOURS)


def world_of(balls: Array) -> World:
    """Return a world with a ball of 3 cm radius at each of these positions (B, 3) m, root frame."""
    world = World()
    for number, position in enumerate(balls):
        world.add(f"ball {number}", sphere(RADIUS), position=position)
    return world


def plant_of(scene: Scene, seed: int, start: Array) -> OfflinePlant:
    """Return an offline plant of the left arm, at rest in the pose `start` (4,) rad, with the balls of a scene at their true positions.

    The model of a planner may have the balls at wrong positions.  `seed`: seed of the plant's random numbers.
    """
    plant = arm_plant(seed, world=world_of(scene.balls))
    place(plant, whole(start[None])[0])
    return plant


def make_scene(seed: int, queries: int) -> Scene:
    """Draw the balls and the errors of a scene, and its queries.

    Half of the queries are hard: a straight motion does not reach the goal.  In the other half it does.  If too few queries of one kind are
    found, the scene has fewer queries; if none of a kind is found, InvalidValue is raised.  `seed`: of the draw.  `queries`: their number.
    """
    rng = np.random.default_rng([seed, 75])
    balls = _balls(rng)
    shifts = rng.normal(size=balls.shape)
    shifts *= SHIFT / np.linalg.norm(shifts, axis=1, keepdims=True)
    turns = TURN * rng.choice([-1.0, 1.0], size=JOINTS)
    return Scene(balls, shifts, turns, *_queries(seed, rng, balls, queries))


def _balls(rng: np.random.Generator) -> Array:
    """Return the positions of the centres of the balls, (BALLS, 3) m, in the root frame.

    Each is the position of the palm in a random pose of the arm between the lattice's outermost samples.  A position is used only if a
    ball there has no contact with the robot at home.
    """
    low, high = robot().limits[columns()].T
    alone = Model(robot())
    found: list[Array] = []
    while len(found) < BALLS:
        pose = low + rng.uniform(RANK3[0], RANK3[-1], JOINTS) * (high - low)
        ball = alone.evaluate(whole(pose)).position("left_palm")
        if not len(Model(robot(), world_of(ball[None])).evaluate(robot().home).table):
            found.append(ball)
    return np.array(found)


def _queries(seed: int, rng: np.random.Generator, balls: Array, count: int) -> tuple[Array, Ints, NDArray[np.bool_]]:
    """Move straight between random samples of the lattice, and choose half of the queries from the motions that failed, half from others.

    The goal of each query was reached by at least one motion.  Returns the first poses (Q, J) rad, the goals (Q,) as states of the lattice,
    and whether the straight motion failed, (Q,).  Raises InvalidValue if there is no query of one of the two kinds.
    """
    lattice = space()
    plant = arm_plant(seed, world=world_of(balls))
    free = [s for s in range(len(lattice)) if not len(plant.model.evaluate(whole(lattice.samples[s])).table)]
    tried: list[tuple[Array, int, bool]] = []
    reached: set[int] = set()
    here = plant.measure(PART)[:JOINTS]
    while len(tried) < MAX_MOTIONS:
        goal = int(rng.choice(free))
        end = plant.act(PART, lattice.target(goal)).q[:JOINTS]
        succeeded = lattice.state_of(end) == goal
        if lattice.state_of(here) != goal:
            tried.append((here, goal, not succeeded))
        reached |= {goal} if succeeded else set()
        here = end
        if len(tried) % 100 == 0:
            hard = [query for query in tried if query[2] and query[1] in reached]
            easy = [query for query in tried if not query[2]]
            if min(len(hard), len(easy)) >= (count + 1) // 2:
                break
    if not hard or not easy:
        raise InvalidValue(
            f"scene {seed}: straight motions reached {len(easy)} of {len(tried)} goals; queries of both kinds are needed: use another seed."
        )
    half = count // 2
    chosen = [*_some(rng, hard, count - half), *_some(rng, easy, half)]
    chosen = [chosen[i] for i in rng.permutation(len(chosen))]
    starts, goals, failed = zip(*chosen, strict=True)
    return np.array(starts), np.array(goals, dtype=np.intp), np.array(failed)


def _some(rng: np.random.Generator, queries: list[tuple[Array, int, bool]], count: int) -> list[tuple[Array, int, bool]]:
    return [queries[i] for i in rng.permutation(len(queries))[:count]]


def believed(scene: Scene, kind: str) -> Belief:
    """Return the model of a scene that the planners believe, with errors of the kind `kind`.

    "true": without errors; "no cables": without the constraints of the shoulder's cables; "miscalibrated": balls wrong by 1 cm and joints
    by 3 degrees; "both": both errors; "gross": both, with three times the miscalibration.
    """
    times = {"miscalibrated": 1.0, "both": 1.0, "gross": 3.0}.get(kind, 0.0)
    clauses = [] if kind in ("no cables", "both", "gross") else arm_clauses()
    return Belief(Model(robot(), world_of(scene.balls + times * scene.shifts)), times * scene.turns, clauses)


@dataclass(frozen=True, slots=True, eq=False)
class Answers:
    """The results of one planner in Q queries, each (Q,).

    `success`: whether the goal was reached in time.  `seconds`: plant time, 120 s for queries that failed.  `actions`, `repairs`: numbers
    of actions, and of actions that did not end as planned.
    """

    success: NDArray[np.bool_]
    seconds: Array
    actions: Ints
    repairs: Ints


def answer(scene: Scene, rival: Rival, seed: int) -> Answers:
    """Let a planner answer all queries of a scene in their order, and return its results.

    A query ends in the goal's cell, after 120 s of plant time, or when the planner gives up.  `seed`: it determines, together with the
    number of a query, the plant's noise in this query, which is the same for all planners.
    """
    lattice = space()
    rows = []
    for number, goal in enumerate(scene.goals):
        plant = plant_of(scene, 1000 * seed + number, scene.starts[number])
        first_time, repairs, actions = plant.time, rival.repairs, 0
        rival.begin(int(goal))
        here = plant.measure(PART)[:JOINTS]
        while lattice.state_of(here) != goal and plant.time - first_time < QUERY_TIMEOUT:
            aim = rival.aim(here)
            if aim is None:
                break
            target = lattice.target(int(goal))
            target[:JOINTS] = aim
            end = plant.act(PART, target).q[:JOINTS]
            rival.observe(here, end)
            here, actions = end, actions + 1
        success, seconds = lattice.state_of(here) == goal, plant.time - first_time
        success = success and seconds <= QUERY_TIMEOUT
        rows.append((success, seconds if success else QUERY_TIMEOUT, actions, rival.repairs - repairs))
    success, seconds, actions, repairs = zip(*rows, strict=True)
    return Answers(np.array(success), np.array(seconds), np.array(actions), np.array(repairs))


@dataclass(frozen=True, slots=True, eq=False)
class Row:
    """The results of one planner with one belief (the errors of its model), over the seeds.

    `numbers`: means over the queries, (seeds,), under "success", "hard" (success in hard queries), "seconds" (plant time; 120 s for queries
    that failed), "actions" and "repairs".  `cost`: hours of plant time (MDP), or thousands of checked poses (roadmaps), before the first
    query.  `blocks`: for each block of 20 consecutive queries, the plant time per query, (seeds,); the last blocks have fewer seeds if a
    scene has fewer queries.
    """

    numbers: dict[str, Array]
    cost: float
    blocks: list[Array]

    def text(self, name: str) -> str:
        """Return the interquartile mean over the seeds and its 95 % interval as text; `name`: key in `numbers`, as "success"."""
        values = self.numbers[name]
        return estimate(values, 1 if abs(interquartile_mean(values)) >= 2.0 else 2)


Rows = Mapping[tuple[str, str], Row]  # by rival and belief ("" for rivals without a model)


def rows_of(found: Cells) -> Rows:
    """Return the row of each planner and belief, by (planner, belief); the belief is "" for planners without a model.

    A belief is the kind of errors in the planner's model, as in `believed`.
    """
    values: dict[tuple[str, str], dict[str, list[Array]]] = defaultdict(lambda: defaultdict(list))
    for result in found.values():
        belief = str(result.cell.settings.get("belief", ""))
        for key, array in result.values.items():
            rival, _, measure = key.partition("|")
            if measure:
                values[rival, belief][measure].append(array)
                if measure == "success":
                    values[rival, belief]["hard"].append(array[result.values["hard"]])
    return {key: _row(measures) for key, measures in sorted(values.items())}


def _row(measures: dict[str, list[Array]]) -> Row:
    numbers = {name: np.array([values.mean() for values in measures[name]]) for name in NUMBERS}
    seconds = measures["seconds"]
    firsts = range(0, max(map(len, seconds)), BLOCK_SIZE)
    blocks = [np.array([one[first : first + BLOCK_SIZE].mean() for one in seconds if len(one) > first]) for first in firsts]
    return Row(numbers, float(np.mean(measures["cost"])), blocks)


def row_of(rows: Rows, rival: str, belief: str) -> Row:
    """Return the row of one planner with one belief.

    `rival`: name of the planner.  `belief`: kind of errors in its model, as in `believed`; "" for a planner without a model.  Raises
    InvalidValue if this planner has no finished run with this belief.
    """
    if (rival, belief) not in rows:
        raise InvalidValue(f"no finished cell of {rival!r} with belief {belief!r}: continue the run with --resume.")
    return rows[rival, belief]


def findings(found: Cells) -> dict[str, Any]:
    """Return the results: "claims" is a list with the judged claims, as dicts, "rivals" a list with rows.

    There is a row, a dict of text, for each planner and kind of errors in its model: "planner", "its model", the numbers in NUMBERS, and
    "before the first query", the cost of the preparation.
    """
    rows = rows_of(found)
    table = [
        {"planner": rival, "its model": belief or "none"}
        | {label: row.text(name) for name, label in NUMBERS.items()}
        | {"before the first query": f"{row.cost:.2f} {'thousand poses checked' if belief else 'h of robot time'}"}
        for (rival, belief), row in rows.items()
    ]
    return {"claims": judged(CLAIMS, rows), "rivals": table}


def _falls_short(roadmap: Row, learned: Row) -> bool | None:
    """Return whether the roadmap does not work well (success below 95 %) in hard queries, and the MDP has more successes in these.

    None if the confidence intervals over the seeds do not decide.
    """
    short = decides(interval(roadmap.numbers["hard"]), most=MIN_SUCCESS)
    return False if short is False else all_hold([short, is_above(learned.numbers["hard"], roadmap.numbers["hard"])])


def _in_wrong_models(rows: Rows, rival: str) -> Measured:
    """Judge whether a roadmap planner does not work well in hard queries and the MDP does better, for each kind of wrong model.

    `rival`: name of the planner.  Returns a text with the success of both, and the verdict by the kind of errors in the model (`WRONG`):
    True, False or None (open).
    """
    learned = row_of(rows, "MDP, 4000 learned", "")
    roadmaps = {belief: row_of(rows, rival, belief) for belief in WRONG}
    each = (f"{belief} {roadmaps[belief].text('hard')}" for belief in BELIEFS[1:])
    text = f"success in hard queries: PRM, by the error of its model: {', '.join(each)}; MDP after 4000 transitions {learned.text('hard')}"
    return text, Envelope("error of the model", {belief: _falls_short(row, learned) for belief, row in roadmaps.items()})


@claim(
    "paper 3.1",
    "planning first and acting later, as with a PRM, does not work well: plans of a wrong model fail at run time (in more than 5 % of the "
    "hard queries)",
    "no number",
)
def fails(rows: Rows) -> Measured:
    return _in_wrong_models(rows, "OMPL, planned once")


@claim(
    "paper 2.3",
    "the PRM's simple graph is insufficient, even if it is repaired: where the model is wrong, a PRM that removes failed edges and "
    "remembers them fails in more than 5 % of the hard queries",
    "no number",
)
def insufficient(rows: Rows) -> Measured:
    text, found = _in_wrong_models(rows, "OMPL, remembers")
    cost = row_of(rows, "MDP, 4000 learned", "").cost
    return f"{text}, {cost:.1f} h of learning, {3600.0 * cost / QUERIES:.0f} s for each of {QUERIES} queries", found


CLAIMS = (fails, insufficient)


def plot(found: Cells) -> Any:
    """Draw success and time of all planners for each kind of errors in their model, and the time per query after n queries.

    Returns a matplotlib figure.
    """
    rows = rows_of(found)
    drawing = new_figure(15.0, 5.0)
    success, seconds, curves = drawing.subplots(1, 3)
    _points(success, rows, "hard", "success in hard queries")
    _points(seconds, rows, "seconds", "robot time per query [s]")
    for rival, color in COLORS.items():
        for belief in ("", SHOWN):
            if (rival, belief) in rows and rival != "straight" and "once" not in rival:
                blocks = rows[rival, belief].blocks
                draw_band(curves, BLOCK_SIZE * (np.arange(len(blocks)) + 0.5), blocks, ".-", color, 0.1, linewidth=1.2)
    finish(curves, xlabel="queries so far", ylabel=f"robot time per query [s], roadmaps' model “{SHOWN}”", ylim=(0.0, None))
    drawing.legend(*success.get_legend_handles_labels(), loc="outside lower center", ncols=5, fontsize=8)
    return drawing


def _points(axes: Any, rows: Rows, name: str, label: str) -> None:
    roadmaps = [rival for rival in COLORS if any(key[0] == rival and key[1] for key in rows)]
    for rival, color in COLORS.items():
        mine = {belief: row for (other, belief), row in rows.items() if other == rival}
        if rival in roadmaps:
            shift = 0.11 * (roadmaps.index(rival) - (len(roadmaps) - 1) / 2)
            at = np.array([BELIEFS.index(belief) for belief in mine]) + shift
            style: dict[str, Any] = {"fmt": "o", "color": color, "markersize": 4, "capsize": 2, "linewidth": 1.0, "label": rival}
            draw_points(axes, at, [row.numbers[name] for row in mine.values()], **style)
        elif mine:  # without a model: the same under all beliefs
            values, cost = mine[""].numbers[name], mine[""].cost
            text = f"{rival} ({cost:.1f} h)" if "MDP" in rival else rival
            axes.axhline(interquartile_mean(values), color=color, linewidth=1.0, label=text)
            axes.axhspan(*interval(values), color=color, alpha=0.12, linewidth=0.0)
    axes.set_xticks(range(len(BELIEFS)), BELIEFS, fontsize=8)
    axes.set(xlabel="the roadmaps' model of the robot", ylabel=label, ylim=(0.0, None))
    axes.grid(alpha=0.2, axis="y")


EXPERIMENT = Experiment(
    claim="planning first in a roadmap and acting later does not work well on a noisy robot; a learned MDP is needed",
    source="paper 2.3, 3.1; thesis 4.2",
    method=Sweep(conditions, trial, findings, plot, require=require_ompl),
    claims=CLAIMS,
)
