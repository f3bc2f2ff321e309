"""Learning to reach: which exploration makes the best reacher, on the 27 targets of the thesis?

Claim: after about 800 problem-tries intrinsically motivated exploration makes a more competent agent than random or greedy optimistic
exploration, and it improves steadily, though it is the weakest after 100; its runs agree on a few favourite pre-reach poses, those of
the others do not; the random explorer collects the most negative rewards and takes twice the time.
Source: thesis 8.4, figs. 8.2 to 8.8; 3 strategies x 5 runs x 6400 problem-tries, evaluated 5 times after 100, 200, ... 6400.
Published: 207, 109 and 113 hours for 5 runs each, random, greedy and intrinsic; otherwise figures only.
Run time: 15 minutes on 2 cores; with 5 seeds, as published, 4.

The four joints of the right arm under the published law, 81 states and 432 transitions of equidistant neighbours, their outcomes learned
before by 3000 curious transitions without a target, anew for every seed.  Predictors, strategies and negative rewards as published,
with the resolutions of docs/reaching.md; distances in units of 1 cm (--scale).  A score is the sum of the rewards of the 27 targets in one
evaluation.  The targets and what inverse kinematics can reach of them: experiments/kit/reaching/README.md.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from itertools import pairwise
from typing import Any

import numpy as np

from experiments.claims.ch8_reaching.reach_runs import CHECKPOINTS, STRATEGIES, Runs, runs_of
from experiments.kit.command_line import positive_number
from experiments.kit.experiment import Claim, Experiment
from experiments.kit.plots import new_figure
from experiments.kit.reaching.arm import MARKER, PART, laws, learned_beliefs, reach_plant, reach_space
from experiments.kit.reaching.learning import learn
from experiments.kit.reaching.targets import grid, targets_at
from experiments.kit.statistics import all_hold, better, changes, decides, estimate, interquartile_mean, interval, published_ratio, rises
from experiments.kit.sweep import Cells, Condition, Sweep
from mobee import Model
from mobee.arrays import Array
from mobee.learning.reaching.predictors.predictor import SCALE
from mobee.learning.reaching.reach_agent import ReachAgent
from mobee.rendering.picture import Picture
from mobee.rendering.sheet import pictures_of
from mobee.rendering.solid import Solid, ball, robot_solids

REPETITIONS = 5  # of an evaluation
COST = {"random": 2.0}
RIVALS = STRATEGIES[1:]
JUDGED = (800, 1600, 3200, 6400)  # problem-tries at which intrinsic motivation is compared
HOURS = {"random": 207.0, "greedy": 109.0, "intrinsic": 113.0}  # published, of 5 runs
TWICE, SAME = (1.5, 2.5), (0.8, 1.2)  # "about twice", and as long as
NEARLY_ALL = 0.9  # "almost all possible combinations"
MINUTES, CORES, RUNS = 10.0, 2, 5

_SCORES, _CHOICES = "thesis 8.4.1, fig. 8.2", "thesis 8.4.2, figs. 8.4-8.6"
BETTER = {
    checkpoint: Claim(
        _SCORES,
        f"after {checkpoint} problem-tries intrinsic motivation has made a more competent agent than greedy and random exploration",
        "significantly more competent after about 800",
    )
    for checkpoint in JUDGED
}
WEAK = Claim(_SCORES, "the intrinsically motivated agent is less competent than the others after 100 problem-tries", "figure only")
STEADY = Claim(_SCORES, "it improves steadily, from 100 to 3200 problem-tries", "figure only")
FALLS = Claim(
    "our prototype of thesis 8.4",
    "it falls back from 3200 to 6400 problem-tries, as negative rewards spread over all targets",
    "6.5 of 7.9",
)
DECREASES = Claim("thesis 8.4.2", "the randomly exploring agent's score decreases from 100 to 400 problem-tries", "figure only")
AGREE = Claim(
    _CHOICES, "the runs of the intrinsic agent come to agree on the states to reach from, more than those of the others", "figures only"
)
FEW = Claim(_CHOICES, "it settles on few favourite states, fewer than the others", "2 are pictured in fig. 8.3")
NAMED = ({57, 77}, {56, 76})  # what 489 and 509 of 432 + 81 state-actions are if the reaches come last, counted from 0 or from 1
THOSE = Claim(
    "thesis 8.4.3", "its two favourites are the reaches 489 and 509 of 513: 57 and 77, or 56 and 76, if reaches come last", "489 and 509"
)
HIGH = Claim(_CHOICES, "the randomly exploring agent comes to prefer states with the hand high", "figure only")
COMBINATIONS = Claim(
    "thesis 8.4.3, fig. 8.7",
    "after 3200 problem-tries the intrinsic agent has tried almost all pairs of a state and a target",
    "almost all 2187",
)
REGIONS = Claim(
    "thesis 8.4.3, fig. 8.7", "the greedy agent leaves large regions untried, more than the intrinsic one (after 1600)", "figure only"
)
LINES = Claim(
    "thesis 8.4.3, fig. 8.7",
    "from 1600 problem-tries on the greedy agent reaches nearly always from two states",
    "all its time, two red lines",
)
NEGATIVE = Claim("thesis 8.4.4, fig. 8.8", "the random explorer gets many more negative rewards than the other two", "figure only")
TIME = Claim("thesis 8.4.4", "random exploration takes about twice the robot's time of intrinsic motivation", "207 against 113 h: 1.83")
TIME_GREEDY = Claim("thesis 8.4.4", "greedy exploration takes about as long as intrinsic motivation", "109 against 113 h: 0.96")
SPEED = Claim(
    "aim of this reproduction", f"all {RUNS * 3} runs of figure 8.2 take less than {MINUTES:.0f} minutes on {CORES} cores", "429 h"
)
CLAIMS = (
    *BETTER.values(),
    WEAK,
    STEADY,
    FALLS,
    DECREASES,
    AGREE,
    FEW,
    THOSE,
    HIGH,
    COMBINATIONS,
    REGIONS,
    LINES,
    NEGATIVE,
    TIME,
    TIME_GREEDY,
    SPEED,
)


COLORS = {"intrinsic": "tab:red", "greedy": "tab:blue", "random": "0.4"}
TITLES = {"intrinsic": "intrinsic motivation", "greedy": "greedy, optimistic", "random": "random"}
STACKED = 5  # runs whose choices are drawn on top of each other, as published
SHOWN = (0.0, 0.5, 1.0)  # which checkpoints, as shares of their number

FAVOURITES = 4  # poses that are drawn
HEIGHT = 400  # pixels
PALM, TARGET = 0.014, 0.011  # m, radii of what stands for the palm and for a target, which are far larger
VEILED = 0.4
GOLD, GREEN = (0.96, 0.62, 0.0), (0.25, 0.65, 0.3)


def add_options(parser: argparse.ArgumentParser) -> None:
    """Options besides those of all sweeps."""
    parser.add_argument("--law", choices=list(laws()), default="published", help="the law that the arm moves by (default: published)")
    parser.add_argument(
        "--scale", type=positive_number, default=SCALE, metavar="M", help=f"the unit of distances in the equations (default: {SCALE} m)"
    )


def conditions(arguments: argparse.Namespace) -> list[Condition]:
    """Every strategy; --quick: 400 problem-tries."""
    shared = {"law": arguments.law, "scale": arguments.scale, "looks": list(CHECKPOINTS[:3] if arguments.quick else CHECKPOINTS)}
    return [Condition(strategy, {"strategy": strategy, **shared}, COST.get(strategy, 1.0)) for strategy in STRATEGIES]


def trial(settings: dict[str, Any], seed: int) -> dict[str, Any]:
    """Learn the transitions, then to reach; see `experiments.kit.reaching.learning.learn`."""
    plant = reach_plant(seed, settings["law"])
    beliefs = learned_beliefs(plant, seed)
    agent = ReachAgent(reach_space(), plant, beliefs, marker=MARKER, strategy=settings["strategy"], scale=settings["scale"], seed=seed)
    problems = targets_at(grid(), laws()[settings["law"]].aim)
    return learn(agent, problems, settings["looks"], REPETITIONS, {"grid": problems})


def findings(found: Cells) -> dict[str, Any]:
    """A row a strategy, and the claims; those about problem-tries that were not made stay open."""
    runs = runs_of(found)
    results: dict[str, Any] = {"runs": {name: _row(mine) for name, mine in runs.items()}}
    if set(runs) == set(STRATEGIES):
        results["claims"] = [claim.record() for claim in measured(runs)]
    return results


def measured(runs: Mapping[str, Runs]) -> list[Claim]:
    """The claims with our numbers."""
    checkpoints = runs["intrinsic"].checkpoints
    if checkpoints[-1] < JUDGED[-1]:
        return list(CLAIMS)
    return [*_scores(runs), *_choices(runs), *_exploration(runs), *_costs(runs)]


def _row(mine: Runs) -> dict[str, Any]:
    last = mine.checkpoints[-1]
    return {
        "seeds": len(mine),
        "scores": {str(checkpoint): estimate(mine.scores(checkpoint)) for checkpoint in mine.checkpoints},
        "agreement": {str(checkpoint): estimate(mine.agreement(checkpoint)) for checkpoint in mine.checkpoints},
        "states_of_half_the_reaches": {str(checkpoint): estimate(mine.favourites(checkpoint), 1) for checkpoint in mine.checkpoints},
        "pairs_tried": {str(checkpoint): estimate(mine.tried(checkpoint)) for checkpoint in mine.checkpoints},
        "favourites": np.argsort(-mine.chosen(last).mean(axis=0))[:5].tolist(),
        "negative_rewards": estimate(mine.failures(), 0),
        "actions_a_try": estimate(mine.actions()),
        "robot_hours_of_5_runs": estimate(5.0 * mine.hours(), 1),
        "seconds": interquartile_mean(mine.seconds),
    }


def _scores(runs: Mapping[str, Runs]) -> list[Claim]:
    def each(checkpoint: int) -> dict[str, Any]:
        return {name: mine.scores(checkpoint) for name, mine in runs.items()}

    found = []
    for checkpoint, claim in BETTER.items():
        text, verdicts = better(each(checkpoint), "intrinsic", RIVALS)
        found.append(claim.measured(text, all_hold(verdicts)))
    text, verdicts = better(each(100), "intrinsic", RIVALS, worse=True)
    found.append(WEAK.measured(text, all_hold(verdicts)))
    mine, random = runs["intrinsic"], runs["random"]
    steps = [
        mine.scores(later) - mine.scores(sooner)
        for sooner, later in pairwise(checkpoint for checkpoint in mine.checkpoints if checkpoint <= 3200)
    ]
    whole = mine.scores(3200) - mine.scores(100)
    falls = [rises(step) is False for step in steps]
    text = f"{changes(mine.scores(100), mine.scores(3200))}; significant falls between looks: {sum(falls)}"
    found.append(STEADY.measured(text, all_hold([rises(whole), not any(falls)])))
    for claim, runner, (sooner, later) in ((FALLS, mine, (3200, 6400)), (DECREASES, random, (100, 400))):
        before, after = runner.scores(sooner), runner.scores(later)
        found.append(claim.measured(changes(before, after), rises(before - after)))
    return found


def _choices(runs: Mapping[str, Runs]) -> list[Claim]:
    last = {name: mine.agreement(6400) for name, mine in runs.items()}
    mine = runs["intrinsic"]
    text, verdicts = better(last, "intrinsic", RIVALS)
    grown = rises(mine.agreement(6400) - mine.agreement(100))
    agree = AGREE.measured(
        f"overlap of two runs' choices {changes(mine.agreement(100), mine.agreement(6400))}; {text}", all_hold([grown, *verdicts])
    )
    text, verdicts = better({name: one.favourites(6400) for name, one in runs.items()}, "intrinsic", RIVALS, worse=True, digits=1)
    favourite = np.argsort(-mine.chosen(6400).mean(axis=0))[:2].tolist()
    few = FEW.measured(f"states of half the reaches: {text}; the two most frequent: {favourite[0]}, {favourite[1]}", all_hold(verdicts))
    named = np.array([float(set(np.argsort(-one)[:2].tolist()) in NAMED) for one in mine.chosen(6400)])
    text = f"they are in {named.sum():.0f} of {len(named)} runs; over all runs {favourite[0]} and {favourite[1]}"
    those = THOSE.measured(text, decides(interval(named, _means), least=0.5))
    height = runs["random"].height(6400)
    return [agree, few, those, HIGH.measured(f"{estimate(100.0 * height, 1)} cm above the mean of all states", rises(height))]


def _means(values: Array) -> Array:
    means: Array = values.mean(axis=-1)
    return means


def _exploration(runs: Mapping[str, Runs]) -> list[Claim]:
    tried, greedy = runs["intrinsic"].tried(3200), runs["greedy"].concentration(1600, 6400)
    text, verdicts = better({name: runs[name].tried(1600) for name in ("intrinsic", "greedy")}, "intrinsic", ("greedy",))
    return [
        COMBINATIONS.measured(f"{estimate(tried)} of them", decides(interval(tried), least=NEARLY_ALL)),
        REGIONS.measured(f"share tried: {text}", all_hold(verdicts)),
        LINES.measured(
            f"{estimate(greedy)} of its reaches, intrinsic {estimate(runs['intrinsic'].concentration(1600, 6400))}",
            decides(interval(greedy), least=NEARLY_ALL),
        ),
    ]


def _costs(runs: Mapping[str, Runs]) -> list[Claim]:
    text, verdicts = better({name: mine.failures() for name, mine in runs.items()}, "random", ("greedy", "intrinsic"), digits=0)
    negative = NEGATIVE.measured(text, all_hold(verdicts))
    hours = {name: mine.hours() for name, mine in runs.items()}
    minutes = RUNS * sum(float(np.mean(mine.seconds)) for mine in runs.values()) / CORES / 60.0
    said = ", ".join(f"{name} {estimate(RUNS * hours[name], 1)} h" for name in HOURS)
    return [
        negative,
        published_ratio(TIME, hours["random"], hours["intrinsic"], TWICE, f"; 5 runs: {said}"),
        published_ratio(TIME_GREEDY, hours["greedy"], hours["intrinsic"], SAME),
        SPEED.measured(
            f"{minutes:.1f} minutes: 5 times the mean run of each strategy, on {CORES} cores; without the figure", minutes < MINUTES
        ),
    ]


def plot(found: Cells) -> Any:
    """Scores and costs above; a row a strategy with its choices and its problem-tries; the favourite poses below."""
    runs = runs_of(found)
    drawing = new_figure(15.0, 5.0 + 2.6 * len(runs) + 3.9)
    drawing.get_layout_engine().set(w_pad=0.1)  # inches: labels do not touch the panel before
    above, middle, below = drawing.subfigures(3, 1, height_ratios=[5.0, 2.6 * len(runs), 3.9])
    scores, costs, fails = above.subplots(1, 3, width_ratios=[2.0, 1.0, 2.0])
    _draw_scores(scores, runs)
    _draw_costs(costs, runs)
    _draw_failures(fails, runs)
    for row, (name, mine) in zip(middle.subplots(len(runs), 5, squeeze=False), runs.items(), strict=True):
        checkpoints = [mine.checkpoints[round(share * (len(mine.checkpoints) - 1))] for share in SHOWN]
        for axes, checkpoint in zip(row[:3], checkpoints, strict=True):
            _draw_choices(axes, mine, checkpoint, f"{TITLES[name]}, {checkpoint}")
        for axes, checkpoint in zip(row[3:], checkpoints[1:], strict=True):
            _draw_tries(axes, mine, checkpoint, f"{TITLES[name]}, {checkpoint}")
    _draw_poses(below, runs[next(iter(runs))])
    return drawing


def _draw_scores(axes: Any, runs: Mapping[str, Runs]) -> None:
    """Interquartile mean and interval over the runs, and each run as a dot (fig. 8.2)."""
    for shift, (name, mine) in zip((0.97, 1.0, 1.03), runs.items(), strict=False):
        scores = np.array([mine.scores(checkpoint) for checkpoint in mine.checkpoints])
        at = shift * np.array(mine.checkpoints)
        middle, spans = [interquartile_mean(one) for one in scores], np.array([interval(one) for one in scores]).T
        axes.plot(at, middle, color=COLORS[name], label=f"{TITLES[name]} ({len(mine)})")
        axes.fill_between(at, *spans, color=COLORS[name], alpha=0.15, linewidth=0.0)
        axes.plot(at, scores, ".", color=COLORS[name], markersize=3.0, alpha=0.4)
    axes.set(xscale="log", xlabel="problem-tries", ylabel="cumulative reward, 27 targets", ylim=(0.0, None), title="fig. 8.2: competence")
    checkpoints = next(iter(runs.values())).checkpoints
    axes.set_xticks(checkpoints, checkpoints)
    axes.minorticks_off()
    axes.legend(fontsize=8)
    axes.grid(alpha=0.2)


def _draw_costs(axes: Any, runs: Mapping[str, Runs]) -> None:
    hours = [5.0 * float(mine.hours().mean()) for mine in runs.values()]
    axes.bar(range(len(runs)), hours, color=[COLORS[name] for name in runs])
    axes.set_xticks(range(len(runs)), runs, fontsize=8)
    axes.set(ylabel="h of the robot, 5 runs", title="exploration takes")


def _draw_failures(axes: Any, runs: Mapping[str, Runs]) -> None:
    """Negative rewards by state-action, sorted: where each strategy's runs fail (fig. 8.8)."""
    most = 0.0
    for name, mine in runs.items():
        mean = np.mean([one["failures"] for one in mine.values], axis=0).sum(axis=1)
        most = max(most, float(mean.max()))
        axes.step(range(len(mean)), mean, color=COLORS[name], where="mid", label=f"{TITLES[name]}: {mean.sum():.0f} a run", linewidth=1.0)
    axes.set(xlabel="state in which the transition begins", ylabel="negative rewards, mean of the runs", title="fig. 8.8")
    axes.set_yscale("symlog", linthresh=1.0)
    axes.set(ylim=(0.0, 4.0 * most + 1.0))
    ticks = [0, *(each for each in (0.5, 1, 2, 5, 10, 20, 50, 100, 200, 500) if each < 2.0 * most)]
    axes.set_yticks(ticks, [f"{each:g}" for each in ticks])
    axes.minorticks_off()
    axes.legend(fontsize=8, loc="upper center")


def _draw_choices(axes: Any, mine: Runs, checkpoint: int, title: str) -> None:
    """From where the first runs reached when evaluated, stacked (figs. 8.4 to 8.6)."""
    chosen = mine.chosen(checkpoint)[:STACKED]
    floor = np.zeros(chosen.shape[1])
    for number, one in enumerate(chosen):
        axes.stairs(floor + one, np.arange(len(one) + 1) - 0.5, baseline=floor, fill=True, color=f"C{number}")
        floor = floor + one
    axes.set_title(title, fontsize=9)
    axes.set_xlabel("state reached from", fontsize=8)


def _draw_tries(axes: Any, mine: Runs, checkpoint: int, title: str) -> None:
    """How often each state was reached from for each target (fig. 8.7)."""
    axes.imshow(np.log1p(mine.exploration(checkpoint)), aspect="auto", cmap="viridis", interpolation="nearest")
    axes.set_title(f"tries: {title}", fontsize=9)
    axes.set_xlabel("state", fontsize=8)
    axes.set_ylabel("target", fontsize=8)


def _draw_poses(drawing: Any, mine: Runs) -> None:
    """The favourites at the last checkpoint, by how often they were chosen; seen from the front and the robot's right."""
    share = mine.chosen(mine.checkpoints[-1]).mean(axis=0)
    states = np.argsort(-share)[:FAVOURITES].tolist()
    for axes, state, picture in zip(drawing.subplots(1, FAVOURITES), states, _pictures(states), strict=True):
        axes.imshow(picture)
        axes.axis("off")
        axes.set_title(f"state {state}: {100.0 * share[state]:.0f} % of the reaches", fontsize=9)


def _pictures(states: list[int]) -> list[Picture]:
    """The robot in each of the states, the palm in gold, the targets' centres in green."""
    return pictures_of([_scene(state) for state in states], "oblique", HEIGHT)


def _scene(state: int) -> list[Solid]:
    space = reach_space()
    q = space.robot.home.copy()
    q[space.robot.part(PART).slice] = space.target(state)
    pose = Model(space.robot).evaluate(q)
    targets = [ball(place, TARGET, GREEN, VEILED, group=-2) for place in grid()]
    return [*robot_solids(pose, [PART]), *targets, ball(pose.position(MARKER), PALM, GOLD, VEILED, group=-3)]


EXPERIMENT = Experiment(
    name="reach-exploration",
    claim="intrinsic motivation makes the best reacher of the three published strategies, and the only one that knows its favourite poses",
    source="thesis 8.4, figs. 8.2-8.8",
    notes=__doc__,
    method=Sweep(conditions, trial, findings, plot, seeds=20, add_options=add_options),
    claims=CLAIMS,
)
