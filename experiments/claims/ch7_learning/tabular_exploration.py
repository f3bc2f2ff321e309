# SPDX-License-Identifier: Apache-2.0
"""Compare the curiosity of the thesis (information gain 'Kail') with explorers of the literature, in tabular worlds of the literature.

Claim: none is tested.  The question is how soon each explorer has tried every action, and how much reward it finds, if the outcomes are not
known in advance.
Source: none; the thesis compares with random and least-tried actions only.  Run time: 5 minutes on 2 cores.

Worlds: RiverSwim with 6 and 20 states, DeepSea of depth 10, four rooms with slipping steps, and random worlds in which every action has
five outcomes.  All explorers know the number of states and actions, and nothing of an action before its first try.

Two tasks are measured.  "coverage", without rewards: the number of transitions until every reachable state-action was tried once, and five
times; and the L1 distance (0 to 2) of the believed outcomes from the true ones, after 20 transitions for each state-action.  For all
explorers these beliefs are those of `TransitionModel.debiased`: the real counts and a weak prior.  "return": the sum of all rewards, over
that of the best policy; the explorers must find the rewards by trying.  For "return" each explorer has one parameter, with the same value
in all worlds: the weight of the rewards relative to the information gain in nats ("curious"), the size of the bonus ("count bonus"), the
tries after which an action counts as known ("R-MAX"), the steps of an episode ("PSRL"), or the share of random actions ("epsilon-greedy").
The values were set in advance and not tuned, except for R-MAX: its value is 10, because with 3 it gave up in RiverSwim in a first run.
`--tune` measures other values, with other seeds.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping, Sequence
from itertools import product
from typing import Any

import numpy as np

from experiments.kit.experiment import Experiment
from experiments.kit.learning.exploration import newest
from experiments.kit.learning.rivals import CountBonus, Curious, EpsilonGreedy, PosteriorSampling, RewardedPlant, RMax, random_world, rooms
from experiments.kit.plots import draw_points, finish, new_figure
from experiments.kit.statistics import interquartile_mean, interval
from experiments.kit.sweep import Cells, Condition, Sweep, grouped_by
from mobee import CuriousAgent, policy_iteration
from mobee.arrays import Array
from mobee.learning.explorers import Explorer
from mobee.learning.tabular import TabularPlant, TabularWorld, deep_sea, river_swim

WORLDS: dict[str, Callable[[int], TabularWorld]] = {
    "RiverSwim-6": lambda seed: river_swim(6),
    "RiverSwim-20": lambda seed: river_swim(20),
    "DeepSea-10": lambda seed: deep_sea(10),
    "four rooms": lambda seed: rooms(),
    "random": random_world,
}
STEPS = {"RiverSwim-6": 5000, "RiverSwim-20": 10_000, "DeepSea-10": 5000, "four rooms": 10_000, "random": 5000}  # of the return
MOST = 40  # transitions for each state-action, after which a run of the coverage ends
LEAST_MOST = 5000  # transitions
JUDGED = 20  # transitions for each state-action, after which the beliefs are compared with the truth
OFTEN = 5  # tries
NEAR_ONE = 0.99999  # discount of the best policy
DISCOUNT = 0.99  # of the agents that maximise rewards
COVERAGE = (
    "curious",
    "curious, debiased",
    "depleting",
    "count bonus",
    "R-MAX",
    "posterior of gains",
    "nearest untried",
    "least tried",
    "random",
)
RETURN: dict[str, tuple[float, ...]] = {  # the numbers of `--tune`
    "curious": (0.01, 0.1, 1.0),
    "count bonus": (0.03, 0.1, 0.3),
    "R-MAX": (3, 10, 30),
    "PSRL": (10, 30, 100),
    "epsilon-greedy": (0.03, 0.1, 0.3),
}
CHOSEN = {"curious": 0.1, "count bonus": 0.1, "R-MAX": 10, "PSRL": 30, "epsilon-greedy": 0.1}
TUNING_SEED = 1000

Runs = Sequence[Mapping[str, Any]]  # values by seed, of one condition


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the option --tune: instead of the usual runs, measure the return with three values of the parameter of each explorer."""
    parser.add_argument("--tune", action="store_true", help="instead: the return with every number of each explorer, with other seeds")


def conditions(arguments: argparse.Namespace) -> list[Condition]:
    """Return the settings of the runs: the tasks "coverage" and "return" with every explorer in every world.

    With --tune there is only "return", with other seeds, and each explorer has three values of its parameter, such as the weight of the
    reward or of the bonus.  With --quick there are only the two smallest worlds.
    """
    worlds = ["RiverSwim-6", "DeepSea-10"] if arguments.quick else list(WORLDS)
    if arguments.tune:
        seeds = tuple(range(TUNING_SEED, TUNING_SEED + arguments.seeds))
        tuned = [(name, number) for name, numbers in RETURN.items() for number in numbers]
        return [_condition("return", world, name, number, seeds) for world, (name, number) in product(worlds, tuned)]
    found = [_condition("coverage", world, name) for world, name in product(worlds, COVERAGE)]
    return found + [_condition("return", world, name, number) for world, (name, number) in product(worlds, CHOSEN.items())]


def _condition(task: str, world: str, explorer: str, number: float = 0.0, seeds: tuple[int, ...] = ()) -> Condition:
    settings = {"task": task, "world": world, "explorer": explorer, "number": number}
    name = f"{task}-{world}-{explorer}-{number:g}".replace(" ", "_").replace(",", "")
    return Condition(name, settings, 2.0 * STEPS[world] if task == "return" else 5000.0, seeds)


def trial(settings: dict[str, Any], seed: int) -> dict[str, Any]:
    """Explore one world, either until every action was tried ("coverage") or for rewards ("return").

    "coverage" returns `pairs`, the number of actions in reachable states; `once`, the number of transitions until all of them were tried
    once; `often`, the number until all were tried five times; `most`, the limit, which replaces `once` or `often` if that did not happen;
    `finished`, two booleans, whether all were tried once, and five times; and `error`, the result of `distance`.  "return" returns `best`,
    the mean reward per action under the best policy; `share`, the mean reward divided by it; and `earned`, the sum of rewards at 100 times.
    `settings`: "task", "coverage" or "return"; "world", a key of WORLDS; "explorer", the rule by which the agent chooses actions, one of
    COVERAGE or, for "return", a key of RETURN; and for "return" the explorer's parameter "number".  `seed`: of agent and world.
    """
    world = WORLDS[settings["world"]](seed)
    plant = RewardedPlant(world, seed)
    if settings["task"] == "coverage":
        return _covering(plant, settings["explorer"], seed)
    explorer = _pursuing(plant, settings["explorer"], settings["number"])
    agent = CuriousAgent(plant.space, plant, explorer, seed, discount=DISCOUNT, beliefs="debiased")
    agent.run(STEPS[settings["world"]])
    earned = np.cumsum(plant.earned)
    best = best_reward(plant)
    return {"best": best, "share": float(earned[-1] / (best * len(earned))), "earned": earned[:: len(earned) // 100].astype(np.float32)}


def best_reward(plant: RewardedPlant) -> float:
    """Return the mean reward per action under the best policy, from the present state of the plant."""
    values, _ = policy_iteration(plant, plant.truth, NEAR_ONE)
    return float(values[plant.state] * (1.0 - NEAR_ONE))


def _pursuing(plant: RewardedPlant, name: str, number: float) -> Explorer:
    """Return the explorer `name` for the task "return", in which an agent maximises the rewards of the world.

    `number`: the parameter of this explorer, which the docstring of the module explains.
    """
    kinds: dict[str, Callable[[], Explorer]] = {
        "curious": lambda: Curious(plant, number),
        "count bonus": lambda: CountBonus(plant, number),
        "R-MAX": lambda: RMax(plant, int(number)),
        "PSRL": lambda: PosteriorSampling(plant, int(number)),
        "epsilon-greedy": lambda: EpsilonGreedy(plant, number),
    }
    return kinds[name]()


def _covering(plant: RewardedPlant, name: str, seed: int) -> dict[str, Any]:
    """Explore a world without rewards, and return the values that `trial` describes for the task "coverage".

    They are the numbers of transitions until every reachable action was tried, and the error of the beliefs.  `name`: explorer, one of
    COVERAGE.
    """
    plant.truth = np.zeros_like(plant.truth)
    plant.largest = 1.0  # unknown to the explorers: there could be rewards
    explorers: dict[str, str | Explorer] = {
        "curious, debiased": "curious",
        "count bonus": CountBonus(plant, 0.1),
        "R-MAX": RMax(plant, OFTEN),
        "posterior of gains": "posterior_sampling",
    }
    agent = CuriousAgent(
        plant.space,
        plant,
        explorers.get(name, name.replace(" ", "_")),
        seed,
        beliefs="counts" if name == "curious" else "debiased",
    )
    reachable = reached_from(plant)
    pairs = int(reachable.sum()) * plant.space.goals.shape[1]
    most, judged = max(LEAST_MOST, MOST * pairs), JUDGED * pairs
    left = {1: pairs, OFTEN: pairs}
    when: dict[int, int | None] = {1: None, OFTEN: None}
    error = 0.0
    for step in range(1, most + 1):
        agent.step()
        last = newest(agent)
        tries = int(agent.model.tries[last.s, last.a])
        if tries in left:
            left[tries] -= 1
            if left[tries] == 0:
                when[tries] = step
        if step == judged:
            error = distance(plant, agent, reachable)
        if step >= judged and when[OFTEN] is not None:
            break
    return {
        "pairs": pairs,
        "most": most,
        "once": when[1] or most,
        "often": when[OFTEN] or most,
        "finished": [*map(bool, when.values())],
    } | {"error": error}


def reached_from(plant: TabularPlant) -> Array:
    """Return which states can be reached from the present state of the plant, (S,) bool."""
    reached = np.zeros(len(plant.space), dtype=bool)
    reached[plant.state] = True
    while True:
        onward = plant.outcomes[reached][plant.probabilities[reached] > 0.0]
        if reached[onward].all():
            return reached
        reached[onward] = True


def distance(plant: TabularPlant, agent: CuriousAgent, reachable: Array) -> float:
    """Return the mean L1 distance, 0 to 2, of the outcome probabilities that the agent believes from the true ones of the plant.

    The beliefs are those of `TransitionModel.debiased`.  `reachable`: (S,) bool, the states over whose actions the mean is taken.
    """
    believed = agent.model.debiased()
    difference = _dense(plant) - _dense(believed)
    return float(np.abs(difference).sum(axis=2)[reachable].mean())


def _dense(model: Any) -> Array:
    states, actions, bins = model.outcomes.shape
    table = np.zeros((states, actions, states))
    s, a, _ = np.indices((states, actions, bins))
    np.add.at(table, (s, a, model.outcomes), model.probabilities)
    return table


def groups(found: Cells, task: str) -> dict[tuple[str, str, float], Runs]:
    """Return a dict from (world, explorer, value of its parameter) to the values of the finished runs of a task, "coverage" or "return"."""
    every = grouped_by(found, "task", "world", "explorer", "number")
    return {key[1:]: runs for key, runs in every.items() if key[0] == task}


def findings(found: Cells) -> dict[str, Any]:
    """Return the results as a dict with the keys "runs" and "mean_share_of_the_best_return".

    "runs" is a dict from "task, world, explorer" to a row; each measure in it is a list of the interquartile mean and its interval.  A row
    of the task "coverage" has the measures "once", "often" and "error" of `trial`, the number of runs ("seeds"), and the numbers of runs in
    which every action was tried once ("finished_once") and five times ("finished_often").  A row of "return" has the measure "share", the
    reward as a share of the best policy's reward, and "seeds".  "mean_share_of_the_best_return" is a dict from the explorer and the value
    of its parameter to this share, as a mean over the worlds.
    """
    rows: dict[str, Any] = {}
    for (world, explorer, _), runs in groups(found, "coverage").items():
        rows[f"coverage, {world}, {explorer}"] = {name: _summary(runs, name) for name in ("once", "often", "error")} | {
            "seeds": len(runs),
            "finished_once": sum(run["finished"][0] for run in runs),
            "finished_often": sum(run["finished"][1] for run in runs),
        }
    shares: dict[str, list[float]] = {}
    for (world, explorer, number), runs in groups(found, "return").items():
        rows[f"return, {world}, {explorer} {number:g}"] = {"share": _summary(runs, "share"), "seeds": len(runs)}
        shares.setdefault(f"{explorer} {number:g}", []).append(interquartile_mean([run["share"] for run in runs]))
    return {"runs": rows, "mean_share_of_the_best_return": {name: float(np.mean(values)) for name, values in shares.items()}}


def _summary(runs: Runs, name: str) -> list[float]:
    """Return [mean, low, high], rounded: the interquartile mean of the number `name` over the runs, and its confidence interval."""
    values = [run[name] for run in runs]
    return [float(f"{number:.4g}") for number in (interquartile_mean(values), *interval(values))]


def plot(found: Cells) -> Any:
    """Draw, for each world, how many transitions each explorer needs to try everything, and its share of the best policy's reward.

    Returns a matplotlib figure.
    """
    covered, earned = groups(found, "coverage"), groups(found, "return")
    worlds = [world for world in WORLDS if any(key[0] == world for key in (*covered, *earned))]
    drawing = new_figure(3.4 * len(worlds), 6.4)
    for column, world in enumerate(worlds):
        above = drawing.add_subplot(2, len(worlds), column + 1)
        _draw_coverage(above, {name: runs for (where, name, _), runs in covered.items() if where == world}, first=column == 0)
        above.set_title(world, fontsize=10)
        below = drawing.add_subplot(2, len(worlds), len(worlds) + column + 1)
        shares = {name: [run["share"] for run in runs] for (where, name, _), runs in earned.items() if where == world}
        names = [name for name in RETURN if name in shares]
        draw_points(below, names, [shares[name] for name in names], fmt="o", color="k", markersize=4, capsize=2)
        below.tick_params(axis="x", labelrotation=60, labelsize=8)
        finish(below, ylim=(-0.02, 1.02), ylabel="" if column else "reward over that of the best policy")
    return drawing


def _draw_coverage(axes: Any, runs: Mapping[str, Runs], first: bool) -> None:
    names = [name for name in COVERAGE if name in runs]
    for key, label, color in (("once", "tried once", "tab:blue"), ("often", f"tried {OFTEN} times", "tab:red")):
        times = [[run[key] / run["pairs"] for run in runs[name]] for name in names]
        draw_points(axes, names, times, fmt="o", color=color, markersize=4, capsize=2, label=label)
    axes.axhline(1.0, color="tab:blue", linewidth=0.6, linestyle=":")
    axes.axhline(float(OFTEN), color="tab:red", linewidth=0.6, linestyle=":")
    axes.tick_params(axis="x", labelrotation=60, labelsize=8)
    finish(axes, legend=7 if first else 0, yscale="log", ylabel="transitions for each state-action" if first else "")


EXPERIMENT = Experiment(
    claim="how soon 'Kail' curiosity has tried everything, and what reward it finds, beside count bonus, R-MAX and posterior sampling",
    source="our own study",
    method=Sweep(conditions, trial, findings, plot, add_options=add_options),
)
