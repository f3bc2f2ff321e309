# SPDX-License-Identifier: Apache-2.0
"""Measure after how many transitions an explorer has tried every state-action.

Claim: the curious agent (AC in the paper) has tried all state-actions in about half the time of the agent that takes the action least tried
(LT); the random agent (RAND) needs far longer.  At first, AC and LT try only new actions.
Source: paper 3.1, fig. 4; thesis 7.2.1, fig. 7.5.
Published number: AC/LT about 1/2, on the lattice of 81 states and their 16 nearest neighbours.
Run time: 4 minutes on 2 cores.

The left arm explores, with its cable constraints and self-contacts ("constrained") and without both ("free"), on the published graph
(actions to the 16 nearest states) and, with the first 10 seeds, on the graph of equidistant neighbours (states one level away along one
joint).  If several states are equally near, a draw decides which of them are among the 16 nearest; this draw depends on the seed, but not
on the explorer, so that 50 seeds have 50 graphs.  Each explorer makes its own draws among equally good actions.  The texts do not name the
discount of figure 4, so the curious agent also runs with 0.5 and 0.99.  For comparison, the shortest walk needs the fewest actions to try
every action, if all succeed (open Chinese postman problem).  A run stops after 20 000 transitions.  Two explorers are not published but
ours: "nearest untried" moves to the nearest untried action; "depleting" is a curious agent that expects the reward of an action to decrease
with each try of this action in its own plan.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from itertools import product
from typing import Any

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.sparse import csr_array
from scipy.sparse.csgraph import shortest_path

from experiments.kit.experiment import OUR_AIM, Claim, Experiment, Measured, claim, in_settings, judged
from experiments.kit.learning.arm import ARM_NEIGHBOURS, Neighbours, arm_plant, arm_space
from experiments.kit.learning.exploration import LeastTries, begin_anywhere, explore
from experiments.kit.learning.outcomes import first_places, first_tries, goals_of
from experiments.kit.plots import finish, new_figure
from experiments.kit.rules import (
    about,
    all_hold,
    decides,
    equivalent,
    is_above,
    of_each,
    ratio_within,
    texts,
    within,
)
from experiments.kit.statistics import estimate, interval, mean_over, probability_of_improvement, ratio, ratio_estimate, ratio_interval
from experiments.kit.sweep import Cells, Condition, Sweep, grouped_by
from mobee import CuriousAgent
from mobee.arrays import Array, Ints
from mobee.errors import InvalidValue
from mobee.learning.explorers import EXPLORERS
from mobee.learning.neighbours import NO_ACTION

LABELS = {
    "curious": "curious (AC)",
    "least_tried": "least tried (LT)",
    "random": "random (RAND)",
    "nearest_untried": "nearest untried",
    "depleting": "depleting (ours)",
}
EXPLORED_BY = tuple(name for name in LABELS if name in EXPLORERS)
GRAPHS: dict[str, Neighbours] = {"nearest": ARM_NEIGHBOURS, "equidistant": "equidistant"}
WORLDS = ("constrained", "free")
MAX_TRANSITIONS = 20_000  # half of the random walks in the constrained world need more
DISCOUNT = 0.9  # of all explorers that plan, as in thesis 7.3
OTHER_DISCOUNTS = (0.5, 0.99)  # of the curious agent on the published graph
GRAPH_SEEDS, FEW_SEEDS = 50, 10  # graphs of the 16 nearest neighbours; runs on the one graph of equidistant neighbours
COST = {"random": 30.0, "least_tried": 5.0}  # relative computing time of a run; 1 for the other explorers
EARLY = 220  # transitions, before which the published figure shows no difference in actions
ABOUT_HALF = (0.4, 0.6)
SAME_STATES = 1.0  # states, by which two agents differ at most that visit equally many
FLOORS = {"free": 1.05, "constrained": 1.08}  # our aims: transitions over those of the shortest walk
SLACK = 0.01  # share by which "depleting" may need more transitions than "nearest untried"

Runs = Sequence[Mapping[str, Any]]  # values by seed, of one condition
Published = Mapping[tuple[str, str], Runs]  # runs on the published graph, by world and agent


def conditions(arguments: argparse.Namespace) -> list[Condition]:
    """Return the settings of the runs: every explorer on both graphs, for the arm with and without constraints.

    On the published graph ("nearest") the curious agent also runs with the discounts 0.5 and 0.99.  With --quick only the graph of
    equidistant neighbours is explored; its actions lead to the states one level away along one joint.
    """
    few = tuple(range(arguments.seed, arguments.seed + min(arguments.seeds, FEW_SEEDS)))
    published = [("nearest", *one, DISCOUNT) for one in product(WORLDS, EXPLORED_BY)]
    published += [("nearest", world, "curious", discount) for world, discount in product(WORLDS, OTHER_DISCOUNTS)]
    other = [("equidistant", *one, DISCOUNT) for one in product(WORLDS, EXPLORED_BY)]
    return [
        Condition(
            f"{graph}-{world}-{explorer}-g{discount:g}",
            {"graph": graph, "world": world, "explorer": explorer, "discount": discount},
            COST.get(explorer, 1.0) * (3.0 if graph == "nearest" else 1.0) * (2.0 if world == "constrained" else 1.0),
            few if graph == "equidistant" else (),
        )
        for graph, world, explorer, discount in (other if arguments.quick else published + other)
    ]


def trial(settings: dict[str, Any], seed: int) -> dict[str, Any]:
    """Let an agent explore with the left arm until it has tried every action of every state, for at most 20 000 transitions.

    `settings`: dict with four keys.  "explorer": one of the strings in EXPLORED_BY, such as "curious"; it names the rule by which the agent
    chooses actions.  "graph": "nearest" or "equidistant"; the actions of a state lead to its 16 nearest states, or to the states one level
    away along one joint.  "world": "constrained" or "free", the arm with or without cable constraints and self-contacts.  "discount": the
    discount factor of future rewards in the agent's plan, at least 0 and below 1.  `seed`: of the random numbers of agent, graph and plant
    (the simulated robot).

    Returns a dict.  "state_actions": number of actions, summed over the states.  "floor": number of actions in the shortest walk that takes
    each of them (`shortest_walk`).  "new_actions" (E,): the indices (from 1) of the transitions that tried an action for the first time.
    "new_states": 0 for the state at the start, then the indices (from 1) of the transitions that reached a state for the first time.
    "transitions": number of transitions.  "failed": share of the transitions that did not end in the goal state of their action.
    """
    space = arm_space(neighbours=GRAPHS[settings["graph"]], tie_seed=seed)
    plant = arm_plant(seed, free=settings["world"] == "free")
    begin_anywhere(space, plant, seed)
    draws = 10_000 * EXPLORED_BY.index(settings["explorer"]) + seed  # with the same draws the first new actions would be the same
    agent = CuriousAgent(space, plant, settings["explorer"], draws, discount=settings["discount"])
    start = agent.state
    seen = explore(agent, MAX_TRANSITIONS, LeastTries(1, space.state_actions))
    return {
        "state_actions": space.state_actions,
        "floor": shortest_walk(space.goals),
        "new_actions": first_tries(space, seen).astype(np.uint16),
        "new_states": first_places([start, *seen[:, 2]]).astype(np.uint16),
        "transitions": len(seen),
        "failed": float((seen[:, 2] != goals_of(space, seen)).mean()),
    }


def shortest_walk(goals: Ints) -> int:
    """Return the smallest number of actions of a walk that takes every action of a graph at least once, if all actions succeed.

    The walk may begin and end in any states.  `goals` (S, A): goal state of each action, -1 where there is no action.  Raises InvalidValue
    unless every state can be reached from every other state.

    This is the open directed Chinese postman problem.  If a state has more actions into it than out of it, the walk must repeat actions to
    leave it: it takes a shortest path to a state with more actions out of it than into it.  An assignment of minimal total length pairs the
    states of the first kind with those of the second kind.  Because the walk is open, one state of each kind needs no partner: the walk
    ends in the one of the first kind, and begins in the one of the second kind.
    """
    from_state, action = np.nonzero(goals != NO_ACTION)
    to_state, states = goals[from_state, action], len(goals)
    distance = _distances(from_state, to_state, states)
    surplus = np.bincount(to_state, minlength=states) - np.bincount(from_state, minlength=states)
    leave = np.repeat(np.arange(states), np.maximum(surplus, 0))
    arrive = np.repeat(np.arange(states), np.maximum(-surplus, 0))
    cost = np.zeros((len(leave) + 1, len(arrive) + 1))  # the last row and column are the ends: they cost nothing
    cost[:-1, :-1] = distance[np.ix_(leave, arrive)]
    return len(from_state) + round(float(cost[linear_sum_assignment(cost)].sum()))


def _distances(from_state: Ints, to_state: Ints, states: int) -> Array:
    graph = csr_array((np.ones(len(from_state)), (from_state, to_state)), shape=(states, states))
    distance: Array = shortest_path(graph, unweighted=True)
    if not np.isfinite(distance).all():
        raise InvalidValue("some state cannot be reached from another: no walk tries every action.")
    return distance


def findings(found: Cells) -> dict[str, Any]:
    """Return the results as a dict with the keys "runs" and "claims".

    "runs" is a dict from the names of graph, world and agent, as "nearest free curious", to the numbers that `row` returns.  "claims" is a
    list with the judged claims, as dicts (`Claim.record`).  The claims are about the published graph, "nearest"; if it was not run, there
    is no key "claims".
    """
    grouped = by_agent(found)
    results: dict[str, Any] = {"runs": {" ".join(key): row(runs) for key, runs in sorted(grouped.items())}}
    published = {key[1:]: runs for key, runs in grouped.items() if key[0] == "nearest"}
    return results | ({"claims": judged(CLAIMS, published)} if published else {})


def by_agent(found: Cells) -> dict[tuple[str, str, str], Runs]:
    """Return a dict from (graph, world, agent) to the values of the finished runs, sorted by seed.

    The agent is the name of its explorer, followed by the discount if this is not 0.9: "curious", "curious 0.5".
    """
    grouped = grouped_by(found, "graph", "world", "explorer", "discount")
    return {(graph, world, _agent(explorer, discount)): runs for (graph, world, explorer, discount), runs in grouped.items()}


def _agent(explorer: str, discount: float) -> str:
    return explorer if discount == DISCOUNT else f"{explorer} {discount:g}"


def summary(values: dict[str, Any]) -> dict[str, Any]:
    """Reduce the values of `trial` for the raw record: `gaps` replaces `new_actions`.

    `gaps` (E,) is, for each first try of an action, the number of transitions since the previous first try, or since the start.  Most gaps
    are 1, so they take little space.
    """
    kept = {name: value for name, value in values.items() if name != "new_actions"}
    return kept | {"gaps": np.diff(values["new_actions"].astype(np.intp), prepend=0).astype(np.uint16)}


def covered(runs: Runs) -> Array:
    """Return, for each of the N runs, the number of transitions until every action was tried, (N,).

    For a run in which some action was never tried, this is the number of all its transitions.
    """
    return np.array([run["transitions"] for run in runs], dtype=np.float64)


def unfinished(runs: Runs) -> int:
    """Return the number of runs that ended before every action was tried."""
    return sum(len(run["gaps"]) < run["state_actions"] for run in runs)


def first_repeat(run: Mapping[str, Any]) -> int:
    """Return the number, counted from 1, of the first transition of a run with an action that had already been tried."""
    later = np.flatnonzero(run["gaps"] != 1)
    return int(later[0]) + 1 if len(later) else len(run["gaps"]) + 1


def states_seen(run: Mapping[str, Any], transitions: int) -> int:
    """Return the number of states that a run visited in its first `transitions` transitions, including the state at the start."""
    return int((run["new_states"] <= transitions).sum())


def row(runs: Runs) -> dict[str, Any]:
    """Summarise runs with the same settings.  Returns a dict from a label to a number.

    The labels are "seeds", the number of runs; "unfinished", the number of runs that ended before every action was tried; "transitions",
    the mean length of a run, with its confidence interval "low" to "high"; "over_shortest_walk", the mean length divided by that of the
    shortest walk; "first_repeat", the number of the first transition that repeats an action; "states_seen_after_220" transitions; and
    "share_of_failed_actions".  Means are interquartile means.
    """
    low, high = interval(covered(runs))
    return {
        "seeds": len(runs),
        "unfinished": unfinished(runs),
        "transitions": round(mean_over(runs, lambda run: run["transitions"])),
        "low": round(low),
        "high": round(high),
        "over_shortest_walk": mean_over(runs, lambda run: run["transitions"] / run["floor"]),
        "first_repeat": mean_over(runs, first_repeat),
        f"states_seen_after_{EARLY}": mean_over(runs, lambda run: states_seen(run, EARLY)),
        "share_of_failed_actions": mean_over(runs, lambda run: run["failed"]),
    }


_WHERE = "paper 3.1, fig. 4; thesis 7.2.1, fig. 7.5"


def _by_discount(rule: Callable[[Runs, Published], Measured], world: str, published: Published) -> Measured | None:
    """Judge the curious agent by a rule, separately for each discount for which there are runs in this world.

    Returns text and outcomes as `in_settings` does, or None if no discount has runs.  `published`: the runs by (world, agent).
    """
    agents = {f"{discount:g}": _agent("curious", discount) for discount in (DISCOUNT, *OTHER_DISCOUNTS)}
    known = {text: published[world, agent] for text, agent in agents.items() if (world, agent) in published}
    return in_settings("discount", lambda runs: rule(runs, published), known)


def _half(world: str) -> Callable[[Runs, Published], Measured]:
    def rule(runs: Runs, published: Published) -> Measured:
        curious, least = covered(runs), covered(published[world, "least_tried"])
        return ratio_estimate(curious, least), about(ratio_interval(curious, least), *ABOUT_HALF, stronger_below=True)

    return rule


half = {
    world: Claim(
        _WHERE,
        f"the curious agent has tried every action in about half (0.4 to 0.6) of the transitions of the least-tried agent ({text})",
        "about 1/2",
        rule=partial(_by_discount, _half(world), world),
    )
    for world, text in (("constrained", "arm with cable constraints and self-contacts"), ("free", "arm without constraints and contacts"))
}


@claim(
    _WHERE, "the curious agent tries every action far sooner than the least-tried and the random agent (at most 0.6 times)", "figure only"
)
def best(published: Published) -> Measured:
    pairs = {
        (world, rival): (covered(published[world, "curious"]), covered(published[world, rival]))
        for world in FLOORS
        for rival in ("least_tried", "random")
    }
    worst = min(probability_of_improvement(slower, curious) for curious, slower in pairs.values())
    by_random = ratio(*pairs["constrained", "random"])
    bound = "at most " if unfinished(published["constrained", "random"]) else ""
    text = f"probability that a curious run is sooner: at least {worst:.2f}; transitions over the random agent's: {bound}{by_random:.2f}"
    return text, all_hold(decides(ratio_interval(curious, slower), most=ABOUT_HALF[1]) for curious, slower in pairs.values())


@claim(
    _WHERE,
    f"in the first {EARLY} transitions the curious and the least-tried agent try only new actions; the random agent repeats actions",
    "up to about 220 transitions",
)
def novel(published: Published) -> Measured:
    repeats = of_each({name: published["constrained", name] for name in ("curious", "least_tried", "random")}, first_repeat)
    early = [decides(interval(repeats[name]), least=EARLY) for name in ("curious", "least_tried")]
    text = f"transition of the first repeated action: {texts(repeats, 0)}"
    return text, all_hold([*early, decides(interval(repeats["random"]), most=EARLY)])


def _more_states(runs: Runs, published: Published) -> Measured:
    """Judge whether the curious agent visits more states than the least-tried agent in the first 220 transitions, with constraints.

    If neither is significantly ahead, and the difference is surely less than one state, the outcome is False.
    """
    curious, least = ([states_seen(run, EARLY) for run in group] for group in (runs, published["constrained", "least_tried"]))
    text = f"of 81 states visited: curious {estimate(curious, 1)}, least tried {estimate(least, 1)}"
    found = is_above(curious, least)
    return text, False if found is None and equivalent(curious, least, SAME_STATES) else found


aggressive = Claim(
    _WHERE,
    f"in the first {EARLY} transitions the curious agent visits more new states than the least-tried agent",
    "figure only",
    rule=partial(_by_discount, _more_states, "constrained"),
)


def _near_floor(world: str, published: Published) -> Measured:
    return within([run["transitions"] / run["floor"] for run in published[world, "curious"]], 3, most=FLOORS[world])


near_floor = {
    world: Claim(
        OUR_AIM,
        f"to try every action the curious agent needs at most {most} times the transitions of the shortest possible walk ({world} arm)",
        f"at most {most}",
        rule=partial(_near_floor, world),
    )
    for world, most in FLOORS.items()
}


@claim(
    OUR_AIM,
    "curiosity that uses up rewards along its plan needs no more transitions than going to the nearest untried action: their ratio",
    "at most 1.01",
)
def depletes(published: Published) -> Measured | None:
    """Judge whether "depleting" needs at most 1.01 times the transitions of "nearest_untried" to try every action.

    Both explorers are ours (see the module's docstring).  `published`: runs on the graph of the 16 nearest neighbours, by (world, agent).
    Worlds: "constrained" and "free", the arm with and without constraints and contacts; both are judged.  Returns the ratio of these
    numbers of transitions in each world as text, and the verdict.  Returns None if one of the two explorers was not run.
    """
    if any((world, name) not in published for world in FLOORS for name in ("depleting", "nearest_untried")):
        return None
    times = {world: [covered(published[world, name]) for name in ("depleting", "nearest_untried")] for world in FLOORS}
    each = {world: ratio_within(ours, nearest, digits=3, most=1.0 + SLACK) for world, (ours, nearest) in times.items()}
    return ", ".join(f"{text} {world}" for world, (text, _) in each.items()), all_hold(holds for _, holds in each.values())


CLAIMS = (*half.values(), best, novel, aggressive, *near_floor.values(), depletes)


COLORS = dict(zip(LABELS, ("tab:red", "tab:blue", "0.5", "tab:green", "tab:purple"), strict=True))
TITLES = {"nearest": "16 nearest neighbours", "equidistant": "equidistant neighbours"}
MIN_DETOUR = 1e-3  # that is drawn


def plot(found: Cells) -> Any:
    """Draw untried actions over transitions (fig. 4), states visited early, and by how much each run exceeds the shortest walk.

    The figure has a row of panels for each graph.  Returns a matplotlib figure.
    """
    grouped = by_agent(found)
    graphs = [graph for graph in TITLES if any(key[0] == graph for key in grouped)]
    drawing = new_figure(16.0, 3.8 * len(graphs))
    for row, graph in zip(drawing.subplots(len(graphs), 4, squeeze=False), graphs, strict=True):
        for axes, world in zip(row, WORLDS, strict=False):
            _untried(axes, {key[2]: runs for key, runs in grouped.items() if key[:2] == (graph, world)})
            axes.set_title(f"{TITLES[graph]}, {world}", fontsize=10)
        _states(row[2], {key[2]: runs for key, runs in grouped.items() if key[:2] == (graph, "constrained")})
        row[2].set_title("states visited at first, constrained", fontsize=10)
        _detours(row[3], {key[1:]: runs for key, runs in grouped.items() if key[0] == graph})
        row[0].legend(fontsize=7)
    return drawing


def _untried(axes: Any, group: Mapping[str, Runs]) -> None:
    """Draw how many state-actions are still untried after each number of transitions: the median and the range over the seeds.

    The axis ends shortly after the slower of the least-tried and the curious agent; the random agent may need more transitions.
    """
    ends = [covered(group[name]) for name in ("least_tried", "curious") if name in group]
    last = 1.15 * max((float(end.max()) for end in ends), default=1000.0)
    times = np.linspace(0.0, last, 600)
    for name in [name for name in COLORS if name in group]:
        left = np.array([run["state_actions"] - np.searchsorted(np.cumsum(run["gaps"]), times, side="right") for run in group[name]])
        axes.plot(times, np.median(left, axis=0), color=COLORS[name], linewidth=1.2, label=LABELS[name])
        axes.fill_between(times, left.min(axis=0), left.max(axis=0), color=COLORS[name], alpha=0.15, linewidth=0.0)
    floor = np.median([run["floor"] for runs in group.values() for run in runs])
    axes.axvline(floor, color="k", linestyle=":", linewidth=0.8, label="shortest walk")
    finish(axes, xlabel="transitions", ylabel="state-actions never tried", xlim=(0.0, last), ylim=(0.0, None))


def _states(axes: Any, group: Mapping[str, Runs]) -> None:
    times = np.arange(0, 2 * EARLY)
    for name in [name for name in COLORS if name in group]:
        seen = np.array([np.searchsorted(run["new_states"], times, side="right") for run in group[name]])
        axes.plot(times, seen.mean(axis=0), color=COLORS[name], linewidth=1.2, label=LABELS[name])
    axes.axvline(EARLY, color="k", linestyle=":", linewidth=0.8)
    finish(axes, xlabel="transitions", ylabel="states visited, mean", xlim=(0.0, times[-1]), ylim=(0.0, None))


def _detours(axes: Any, group: Mapping[tuple[str, ...], Runs]) -> None:
    """Draw a dot for each run: by how many percent its number of transitions exceeds that of the shortest walk.

    The number is that until every action was tried.  `group`: runs on one graph, by (world, agent).
    """
    names = [name for name in COLORS if any(key[1] == name for key in group)]
    for shift, (world, marker) in zip((-0.12, 0.12), (("constrained", "o"), ("free", "^")), strict=True):
        for place, name in enumerate(names):
            runs = group.get((world, name), [])
            detours = 100.0 * np.maximum(covered(runs) / [run["floor"] for run in runs] - 1.0, MIN_DETOUR)
            label = world if place == 0 else None
            axes.plot(np.full(len(detours), place + shift), detours, marker, color=COLORS[name], markersize=4.0, alpha=0.6, label=label)
    axes.set_yscale("log")
    axes.set_yticks(ticks := (0.1, 1, 10, 100, 1000), [f"{tick:g} %" for tick in ticks])
    axes.set_xticks(range(len(names)), ["\n".join(LABELS[name].rsplit(" ", 1)) for name in names], fontsize=7)
    axes.set_title("transitions beyond the shortest walk", fontsize=10)
    finish(axes, legend=7)


EXPERIMENT = Experiment(
    claim="the curious agent tries every action in about half the transitions of the least-tried agent",
    source="paper 3.1 and fig. 4, thesis 7.2.1 and fig. 7.5",
    method=Sweep(conditions, trial, findings, plot, seeds=GRAPH_SEEDS, summary=summary),
    claims=CLAIMS,
)
