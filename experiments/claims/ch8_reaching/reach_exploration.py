# SPDX-License-Identifier: Apache-2.0
"""Compare three exploration strategies of an agent that learns to reach for the 27 targets of the thesis.

Claim: after about 800 problem-tries, intrinsically motivated exploration yields higher scores than random or greedy optimistic exploration,
and its score rises steadily, although it is the lowest after 100.  Its runs agree on a few states from which they reach; the runs of the
other strategies do not.  The random explorer receives the most negative rewards and takes twice the robot's time.
Source: thesis 8.4, figs. 8.2 to 8.8; 3 strategies x 5 runs x 6400 problem-tries, evaluated 5 times after 100, 200, ... 6400.
Published: 207, 109 and 113 hours for 5 runs of random, greedy and intrinsic exploration; otherwise figures only.
Run time: 30 minutes on 2 cores; with 5 seeds, as published, 12.

The robot is the right arm with four joints under the published control law.  It has 81 states and 432 actions to equidistant neighbours.
For every seed, a curious agent first learns the outcomes of these actions in 3000 transitions without a target.  Predictors, strategies and
negative rewards are as published; docs/reaching.md explains how the texts are interpreted.  The thesis does not name the unit of distances
in the equations: all strategies run with 1 cm, and with 3 cm and 10 cm for the first 10 seeds (--scales).  A score is the sum of the
rewards of the 27 targets in one evaluation.  experiments/kit/reaching/README.md lists the targets and which of them inverse kinematics can
reach.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from itertools import pairwise
from typing import Any

import numpy as np

from experiments.claims.ch8_reaching.reach_measures import STRATEGIES, ByStrategy, Runs, runs_of
from experiments.kit.command_line import positive_number
from experiments.kit.experiment import OUR_AIM, Experiment, Measured, claim, judged
from experiments.kit.plots import finish, new_figure, ticks_at
from experiments.kit.reaching.arm import MARKER, PART, laws, learned_beliefs, reach_plant, reach_space
from experiments.kit.reaching.learning import learn
from experiments.kit.reaching.targets import grid, targets_at
from experiments.kit.rules import about, all_hold, better, changes, decides, ratio_within, rises, within
from experiments.kit.statistics import estimate, interquartile_mean, interval, ratio_estimate, ratio_interval
from experiments.kit.sweep import Cells, Condition, Sweep
from mobee import Model
from mobee.learning.reaching.reach_agent import ReachAgent
from mobee.rendering.picture import Picture
from mobee.rendering.sheet import pictures_of
from mobee.rendering.solid import Solid, ball, robot_solids

CHECKPOINTS = (100, 200, 400, 800, 1600, 3200, 6400)  # problem-tries after which the agents are evaluated
REPETITIONS = 5  # evaluations at each checkpoint
SCALES = (0.01, 0.03, 0.1)  # m, the units of distances
FEW_SEEDS = 10  # of the second unit and the following
COST = {"random": 2.0}  # relative computing time of a run; 1 for the other strategies
RIVALS = STRATEGIES[1:]
JUDGED = (800, 1600, 3200, 6400)  # problem-tries after which intrinsic motivation is compared with the others
HOURS = {"random": 207.0, "greedy": 109.0, "intrinsic": 113.0}  # published robot time of 5 runs
TWICE, SAME = (1.5, 2.5), (0.8, 1.2)  # ratios that count as "about twice" and "about as long"
MOST = 0.5  # share of runs
NEARLY_ALL = 0.9  # share that counts as "almost all possible combinations"
MAX_MINUTES, CORES, RUNS = 10.0, 2, 5  # our aim: RUNS runs of each strategy on CORES cores within MAX_MINUTES

PUBLISHED_STATES = ({57, 77}, {56, 76})  # of reaches 489 and 509, if the 81 reaches follow 432 actions, counted from 0 or from 1

COLORS = {"intrinsic": "tab:red", "greedy": "tab:blue", "random": "0.4"}
TITLES = {"intrinsic": "intrinsic motivation", "greedy": "greedy, optimistic", "random": "random"}
STACKED_RUNS = 5  # runs whose choices are drawn on top of each other, as published
SHOWN = (0.0, 0.5, 1.0)  # checkpoints that are drawn, as shares of the list

POSES = 4  # drawn: the states most often reached from
HEIGHT = 400  # pixels of a drawn pose
PALM_RADIUS, TARGET_RADIUS = 0.014, 0.011  # m, of the drawn symbols; the real ones are far larger
OPACITY = 0.4
GOLD, GREEN = (0.96, 0.62, 0.0), (0.25, 0.65, 0.3)  # RGB


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the options --law, the control law, and --scales, the units of the distance on which a reward depends (thesis eq. 8.4)."""
    parser.add_argument("--law", choices=list(laws()), default="published", help="the control law of the arm (default: published)")
    parser.add_argument(
        "--scales",
        type=positive_number,
        nargs="+",
        default=list(SCALES),
        metavar="M",
        help=f"units of distances in the equations (default: {' '.join(map(str, SCALES))} m)",
    )


def conditions(arguments: argparse.Namespace) -> list[Condition]:
    """Return the settings of the runs: each of three strategies with each unit of distances in the option --scales.

    The reward of a reach (thesis eq. 8.4) depends on the remaining distance in this unit.  With --quick only the first unit is used, and
    there are 400 problem-tries (attempts to reach one target).
    """
    shared = {"law": arguments.law, "checkpoints": list(CHECKPOINTS[:3] if arguments.quick else CHECKPOINTS)}
    first, *others = arguments.scales[:1] if arguments.quick else arguments.scales
    few = tuple(range(arguments.seed, arguments.seed + min(arguments.seeds, FEW_SEEDS)))
    units = [(first, "", ()), *((scale, f"-{100.0 * scale:g}cm", few) for scale in others)]
    return [
        Condition(strategy + name, {"strategy": strategy, "scale": scale, **shared}, COST.get(strategy, 1.0), seeds)
        for scale, name, seeds in units
        for strategy in STRATEGIES
    ]


def trial(settings: dict[str, Any], seed: int) -> dict[str, Any]:
    """Learn the outcomes of actions, and then to reach for the 27 targets with one strategy.

    Returns arrays by name.  For the T attempts to reach one target (problem-tries): `problem`, the number of the target, `reach_state`,
    `reward`, `actions` and `duration` [s], each (T,); `failures` (S, A), number of failures of each transition.  For L evaluations of R
    repetitions: `rewards_grid` and `states_grid` (L, R, 27), and `blocked_grid` (L,), failed transitions.  The names are those of
    `experiments.kit.reaching.learning.learn`.  `settings`: "strategy", its name; "law", a key of the dict that `laws` returns; "scale",
    unit of distances [m]; "checkpoints", numbers of tries before the evaluations.  `seed`: of agent and plant.
    """
    plant = reach_plant(seed, settings["law"])
    beliefs = learned_beliefs(plant, seed)
    agent = ReachAgent(reach_space(), plant, beliefs, marker=MARKER, strategy=settings["strategy"], scale=settings["scale"], seed=seed)
    problems = targets_at(grid(), laws()[settings["law"]].aim)
    return learn(agent, problems, settings["checkpoints"], REPETITIONS, {"grid": problems})


def summary(values: dict[str, Any]) -> dict[str, Any]:
    """Reduce the values of `trial` to those from which the claims and the figure are computed.

    Rewards of an evaluation are added up over the targets, (L, R, 1), for L evaluations of R repetitions.  Problem-tries (attempts to reach
    one target) between two checkpoints are sorted by target and state, because later only their counts are used.  Durations become the
    total `hours`, actions their mean.
    """
    state, problem = values["reach_state"].astype(np.int8), values["problem"].astype(np.uint8)
    between = np.searchsorted(CHECKPOINTS, np.arange(len(state)), side="right")
    order = np.lexsort((state, problem, between))
    return {
        "rewards_grid": values["rewards_grid"].sum(axis=-1, keepdims=True),
        "states_grid": values["states_grid"],
        "failures": values["failures"],
        "reach_state": state[order],
        "problem": problem[order],
        "hours": float(values["duration"].sum()) / 3600.0,
        "mean_actions": float(values["actions"].mean()),
    }


def findings(found: Cells) -> dict[str, Any]:
    """Return the results: "runs" is a dict from "strategy, unit" to a row, "claims" a list with the judged claims, as dicts.

    A key of "runs" names a strategy and a unit of distances, as "greedy, 1 cm".  The values of a row are numbers or text, or dicts from a
    number of problem-tries (attempts to reach one target) to text, such as "scores".  Only units with runs of all strategies are judged;
    without such a unit there are no "claims".  If these runs have fewer than 6400 problem-tries, all claims stay open.
    """
    units = runs_of(found)
    results: dict[str, Any] = {"runs": {f"{name}, {unit}": _row(group) for unit, runs in units.items() for name, group in runs.items()}}
    whole = {unit: runs for unit, runs in units.items() if set(runs) == set(STRATEGIES)}
    if whole:
        results["claims"] = judged(CLAIMS, whole, all(runs["intrinsic"].checkpoints[-1] >= JUDGED[-1] for runs in whole.values()))
    return results


def _row(group: Runs) -> dict[str, Any]:
    checkpoints = group.checkpoints
    return {
        "seeds": len(group),
        "scores": {str(checkpoint): estimate(group.scores(checkpoint)) for checkpoint in checkpoints},
        "agreement": {str(checkpoint): estimate(group.agreement(checkpoint)) for checkpoint in checkpoints},
        "states_of_half_the_reaches": {str(checkpoint): estimate(group.states_of_half(checkpoint), 1) for checkpoint in checkpoints},
        "pairs_tried": {str(checkpoint): estimate(group.tried(checkpoint)) for checkpoint in checkpoints},
        "most_frequent_states": np.argsort(-group.chosen(checkpoints[-1]).mean(axis=0))[:5].tolist(),
        "negative_rewards": estimate(group.failures(), 0),
        "actions_per_try": estimate(group.actions()),
        "robot_hours_of_5_runs": estimate(5.0 * group.hours(), 1),
        "computing_seconds": interquartile_mean(group.seconds),
    }


_SCORES, _CHOICES = "thesis 8.4.1, fig. 8.2", "thesis 8.4.2, figs. 8.4-8.6"


_UNIT = "unit of distance"


@claim(
    _SCORES,
    f"from about {JUDGED[0]} problem-tries on the intrinsically motivated agent scores higher than the greedy and the random one: "
    f"mean after {', '.join(map(str, JUDGED))}",
    "significantly more competent after about 800",
    varies=_UNIT,
)
def best(runs: ByStrategy) -> Measured:
    scores = {name: np.mean([group.scores(checkpoint) for checkpoint in JUDGED], axis=0) for name, group in runs.items()}
    text, holds = better(scores, "intrinsic", RIVALS)
    return f"score: {text}", holds


@claim(_SCORES, "after 100 problem-tries the intrinsically motivated agent scores lower than the other two", "figure only", varies=_UNIT)
def weak_early(runs: ByStrategy) -> Measured:
    text, holds = better({name: group.scores(100) for name, group in runs.items()}, "intrinsic", RIVALS, worse=True)
    return f"score: {text}", holds


@claim(_SCORES, "the intrinsic agent's score rises steadily from 100 to 3200 problem-tries", "figure only", varies=_UNIT)
def steady(runs: ByStrategy) -> Measured:
    intrinsic = runs["intrinsic"]
    scores = [intrinsic.scores(checkpoint) for checkpoint in intrinsic.checkpoints if checkpoint <= 3200]
    falls = sum(interval(later - sooner)[1] < 0.0 for sooner, later in pairwise(scores))
    text = f"score {changes(scores[0], scores[-1])}; significant falls between two evaluations: {falls}"
    return text, all_hold([rises(scores[-1] - scores[0]), not falls])


@claim("thesis 8.4.2", "the randomly exploring agent's score falls from 100 to 400 problem-tries", "figure only", varies=_UNIT)
def decreases(runs: ByStrategy) -> Measured:
    before, after = (runs["random"].scores(checkpoint) for checkpoint in (100, 400))
    return f"score {changes(before, after)}", rises(before - after)


@claim(
    _CHOICES,
    "the intrinsic agent's runs increasingly reach from the same states, more so than the runs of the others",
    "figures only",
    varies=_UNIT,
)
def agree(runs: ByStrategy) -> Measured:
    before, after = runs["intrinsic"].agreement(100), runs["intrinsic"].agreement(6400)
    text, holds = better({name: group.agreement(6400) for name, group in runs.items()}, "intrinsic", RIVALS)
    return f"overlap of two runs' choices {changes(before, after)}; {text}", all_hold([rises(after - before), holds])


@claim(_CHOICES, "the intrinsic agent reaches from few states, fewer than the other two agents", "2 are pictured in fig. 8.3", varies=_UNIT)
def few(runs: ByStrategy) -> Measured:
    states = {name: group.states_of_half(6400) for name, group in runs.items()}
    text, holds = better(states, "intrinsic", RIVALS, worse=True, digits=1)
    return f"number of states from which half of the reaches start: {text}", holds


@claim(
    "thesis 8.4.3",
    "the two states from which the intrinsic agent reaches most are those of reaches 489 and 509 of 513: 57 and 77 (or 56 and 76, if "
    "counted from 1), if the 81 reaches are numbered after the 432 actions",
    "489 and 509",
    untested="the order in which the thesis numbers states and actions",
    varies=_UNIT,
)
def same_states(runs: ByStrategy) -> Measured:
    chosen = runs["intrinsic"].chosen(6400)
    first, second = np.argsort(-chosen.mean(axis=0))[:2].tolist()
    same = np.array([float(set(np.argsort(-shares)[:2].tolist()) in PUBLISHED_STATES) for shares in chosen])
    text = f"in {same.sum():.0f} of {len(same)} runs; over all runs the two states are {first} and {second}"
    return text, decides(interval(same, lambda drawn: np.asarray(drawn.mean(axis=-1))), least=MOST)


@claim(_CHOICES, "the randomly exploring agent increasingly reaches from states in which the hand is high", "figure only", varies=_UNIT)
def high(runs: ByStrategy) -> Measured:
    height = runs["random"].height(6400)
    return f"{estimate(100.0 * height, 1)} cm above the mean of all states", rises(height)


@claim(
    "thesis 8.4.3, fig. 8.7",
    "after 3200 problem-tries the intrinsic agent has tried almost all pairs of a state and a target (at least 0.9 of them)",
    "almost all 2187",
    varies=_UNIT,
)
def combinations(runs: ByStrategy) -> Measured:
    return within(runs["intrinsic"].tried(3200), least=NEARLY_ALL, text="{} of them")


@claim(
    "thesis 8.4.3, fig. 8.7",
    "after 1600 problem-tries the greedy agent has left more pairs of a state and a target untried than the intrinsic agent",
    "figure only",
    varies=_UNIT,
)
def regions(runs: ByStrategy) -> Measured:
    text, holds = better({name: runs[name].tried(1600) for name in ("intrinsic", "greedy")}, "intrinsic", ("greedy",))
    return f"share tried: {text}", holds


@claim(
    "thesis 8.4.3, fig. 8.7",
    "from 1600 problem-tries on the greedy agent nearly always (in 0.9 of its reaches) reaches from the same two states",
    "all its time, two red lines",
    varies=_UNIT,
)
def lines(runs: ByStrategy) -> Measured:
    greedy, intrinsic = (runs[name].concentration(1600, 6400) for name in ("greedy", "intrinsic"))
    return within(greedy, least=NEARLY_ALL, text=f"{{}} of its reaches, intrinsic {estimate(intrinsic)}")


@claim("thesis 8.4.4, fig. 8.8", "the random explorer receives many more negative rewards than the other two", "figure only", varies=_UNIT)
def negative(runs: ByStrategy) -> Measured:
    return better({name: group.failures() for name, group in runs.items()}, "random", ("greedy", "intrinsic"), digits=0)


@claim(
    "thesis 8.4.4",
    "random exploration takes about twice (1.5 to 2.5 times) the robot time of intrinsic motivation",
    "207 to 113 h: 1.83",
    varies=_UNIT,
)
def time(runs: ByStrategy) -> Measured:
    random, intrinsic = runs["random"].hours(), runs["intrinsic"].hours()
    each = ", ".join(f"{name} {estimate(RUNS * runs[name].hours(), 1)} h" for name in HOURS)
    text = f"{ratio_estimate(random, intrinsic)}; {RUNS} runs: {each}"
    return text, about(ratio_interval(random, intrinsic), *TWICE, stronger_below=False)


@claim(
    "thesis 8.4.4",
    "greedy exploration takes about as much (0.8 to 1.2 times) robot time as intrinsic motivation",
    "109 to 113 h: 0.96",
    varies=_UNIT,
)
def time_greedy(runs: ByStrategy) -> Measured:
    return ratio_within(runs["greedy"].hours(), runs["intrinsic"].hours(), 2, *SAME)


@claim(OUR_AIM, f"all {RUNS * 3} runs of figure 8.2 take less than {MAX_MINUTES:.0f} minutes on {CORES} cores", "429 h", varies=_UNIT)
def speed(runs: ByStrategy) -> Measured:
    minutes = RUNS * np.sum([group.seconds for group in runs.values()], axis=0) / CORES / 60.0
    return within(
        minutes, 1, most=MAX_MINUTES, text=f"{{}} minutes: {RUNS} times a run of each strategy, on {CORES} cores; without the figure"
    )


CLAIMS = (
    *(best, weak_early, steady, decreases),
    *(agree, few, same_states, high, combinations, regions, lines),
    *(negative, time, time_greedy, speed),
)


def plot(found: Cells) -> Any:
    """Draw the runs with the smallest unit of distances (option --scales), and return the matplotlib figure.

    Above: scores, robot time and negative rewards of each strategy.  Middle, one row for each strategy: three panels with the share of
    reaches that started in each state in an evaluation, and two panels with the number of reaches by state and target in the tries.  Below:
    pictures of the robot in the four states from which the first strategy, intrinsic motivation, reached most often in the last evaluation.
    """
    runs = next(iter(runs_of(found).values()))
    drawing = new_figure(15.0, 5.0 + 2.6 * len(runs) + 3.9)
    drawing.get_layout_engine().set(w_pad=0.1)  # inches: so that labels do not touch the panel on their left
    above, middle, below = drawing.subfigures(3, 1, height_ratios=[5.0, 2.6 * len(runs), 3.9])
    scores, costs, fails = above.subplots(1, 3, width_ratios=[2.0, 1.0, 2.0])
    _draw_scores(scores, runs)
    _draw_costs(costs, runs)
    _draw_failures(fails, runs)
    for row, (name, group) in zip(middle.subplots(len(runs), 5, squeeze=False), runs.items(), strict=True):
        checkpoints = [group.checkpoints[round(share * (len(group.checkpoints) - 1))] for share in SHOWN]
        for axes, checkpoint in zip(row[:3], checkpoints, strict=True):
            _draw_choices(axes, group, checkpoint, f"{TITLES[name]}, after {checkpoint} tries")
        for axes, checkpoint in zip(row[3:], checkpoints[1:], strict=True):
            _draw_tries(axes, group, checkpoint, f"{TITLES[name]}, first {checkpoint} tries")
    _draw_poses(below, runs[next(iter(runs))])
    return drawing


def _draw_scores(axes: Any, runs: Mapping[str, Runs]) -> None:
    """Draw the interquartile mean and interval over the runs, and each run as a dot (fig. 8.2)."""
    for shift, (name, group) in zip((0.97, 1.0, 1.03), runs.items(), strict=False):
        scores = np.array([group.scores(checkpoint) for checkpoint in group.checkpoints])
        at = shift * np.array(group.checkpoints)
        middle, spans = [interquartile_mean(one) for one in scores], np.array([interval(one) for one in scores]).T
        axes.plot(at, middle, color=COLORS[name], label=f"{TITLES[name]} ({len(group)} runs)")
        axes.fill_between(at, *spans, color=COLORS[name], alpha=0.15, linewidth=0.0)
        axes.plot(at, scores, ".", color=COLORS[name], markersize=3.0, alpha=0.4)
    axes.set(xscale="log", xlabel="problem-tries", ylabel="score: sum of rewards of 27 targets")
    ticks_at(axes, next(iter(runs.values())).checkpoints)
    finish(axes, legend=8, ylim=(0.0, None), title="score (fig. 8.2)")


def _draw_costs(axes: Any, runs: Mapping[str, Runs]) -> None:
    hours = [5.0 * float(group.hours().mean()) for group in runs.values()]
    axes.bar(range(len(runs)), hours, color=[COLORS[name] for name in runs])
    axes.set_xticks(range(len(runs)), runs, fontsize=8)
    axes.set(ylabel="robot time of 5 runs [h]", title="time of exploration")


def _draw_failures(axes: Any, runs: Mapping[str, Runs]) -> None:
    """Draw the number of negative rewards by the state in which the failed action began (fig. 8.8)."""
    most = 0.0
    for name, group in runs.items():
        mean = np.mean([one["failures"] for one in group.values], axis=0).sum(axis=1)
        most = max(most, float(mean.max()))
        axes.step(range(len(mean)), mean, color=COLORS[name], where="mid", label=f"{TITLES[name]}: {mean.sum():.0f} per run", linewidth=1.0)
    axes.set(xlabel="state in which the action began", ylabel="negative rewards, mean of the runs", title="negative rewards (fig. 8.8)")
    axes.set_yscale("symlog", linthresh=1.0)
    axes.set(ylim=(0.0, 4.0 * most + 1.0))
    ticks = [0, *(each for each in (0.5, 1, 2, 5, 10, 20, 50, 100, 200, 500) if each < 2.0 * most)]
    axes.set_yticks(ticks, [f"{each:g}" for each in ticks])
    axes.minorticks_off()
    axes.legend(fontsize=8, loc="upper center")


def _draw_choices(axes: Any, group: Runs, checkpoint: int, title: str) -> None:
    """Draw the states from which the first runs reached in an evaluation, one run on top of the other (figs. 8.4 to 8.6)."""
    chosen = group.chosen(checkpoint)[:STACKED_RUNS]
    floor = np.zeros(chosen.shape[1])
    for number, one in enumerate(chosen):
        axes.stairs(floor + one, np.arange(len(one) + 1) - 0.5, baseline=floor, fill=True, color=f"C{number}")
        floor = floor + one
    axes.set_title(title, fontsize=9)
    axes.set_xlabel("state from which the agent reached", fontsize=8)


def _draw_tries(axes: Any, group: Runs, checkpoint: int, title: str) -> None:
    """Draw how often the agent reached for each target from each state (fig. 8.7)."""
    axes.imshow(np.log1p(group.exploration(checkpoint)), aspect="auto", cmap="viridis", interpolation="nearest")
    axes.set_title(title, fontsize=9)
    axes.set_xlabel("state from which the agent reached", fontsize=8)
    axes.set_ylabel("target", fontsize=8)


def _draw_poses(drawing: Any, group: Runs) -> None:
    """Draw the states most often reached from at the last checkpoint, the most frequent first."""
    share = group.chosen(group.checkpoints[-1]).mean(axis=0)
    states = np.argsort(-share)[:POSES].tolist()
    for axes, state, picture in zip(drawing.subplots(1, POSES), states, _pictures(states), strict=True):
        axes.imshow(picture)
        axes.axis("off")
        axes.set_title(f"state {state}: {100.0 * share[state]:.0f} % of the reaches", fontsize=9)


def _pictures(states: list[int]) -> list[Picture]:
    """Draw the robot in each of the states, the palm in gold, the targets' centres in green, from the front and the robot's right."""
    return pictures_of([_scene(state) for state in states], "oblique", HEIGHT)


def _scene(state: int) -> list[Solid]:
    space = reach_space()
    q = space.robot.home.copy()
    q[space.robot.part(PART).slice] = space.target(state)
    pose = Model(space.robot).evaluate(q)
    targets = [ball(place, TARGET_RADIUS, GREEN, OPACITY, group=-2) for place in grid()]
    return [*robot_solids(pose, [PART]), *targets, ball(pose.position(MARKER), PALM_RADIUS, GOLD, OPACITY, group=-3)]


EXPERIMENT = Experiment(
    claim="of the three published exploration strategies, intrinsic motivation yields the best scores, and the only runs that agree on "
    "where to reach from",
    source="thesis 8.4, figs. 8.2-8.8",
    method=Sweep(conditions, trial, findings, plot, seeds=20, add_options=add_options, summary=summary),
    claims=CLAIMS,
)
