# SPDX-License-Identifier: Apache-2.0
"""Compare graphs with different numbers of neighbours per state, by learning time and by the plans of the learned models.

Claim: the published 16 neighbours per state are more than necessary; fewer connections would shorten the learning time.
Source: paper 4.1 (an impression, no numbers).  Run time: 4 minutes on 2 cores.

The left arm with its cable constraints and self-contacts learns by curiosity on graphs of 81 states (postures of four joints), with actions
to the 4 to 32 nearest states (among equally near ones a draw decides, anew for every seed) or to the equidistant neighbours (states one
level away along one joint).  After fixed numbers of transitions, the learned model is tested in 60 tasks, random pairs of states, which are
the same for all graphs: follow the plan until the arm is in the goal state, with at most 12 actions.  The plant of the tests has other
random noise than the plant of the learning.  A task is solved directly if it takes the fewest actions that its graph allows.  The learning
time is the number of transitions until every state-action was tried once.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from functools import partial
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from experiments.kit.cells import CellResult
from experiments.kit.experiment import Experiment, Measured, claim, judged
from experiments.kit.learning.arm import arm_plant, arm_space
from experiments.kit.learning.exploration import LeastTries, begin_anywhere, explore
from experiments.kit.plots import draw_points, finish, new_figure
from experiments.kit.rules import all_hold, decides, is_above, of_each, texts
from experiments.kit.statistics import difference_interval, estimate, interquartile_mean, level_of_each, mean_over
from experiments.kit.sweep import Cells, Condition, Sweep, runs_by
from mobee import CuriousAgent, OfflinePlant, Space, TransitionModel, value_iteration

GRAPHS: tuple[int | str, ...] = (4, 6, 8, 12, 16, 24, 32, "equidistant")
BUDGETS = (250, 500, 1000, 2000, 4000)  # transitions
JUDGED = 1000  # transitions after which the graphs are compared
TASKS, MAX_ACTIONS = 60, 12
DISCOUNT, TOLERANCE = 0.9, 1e-6  # of plans
PUBLISHED = 16  # neighbours
MARGIN = 0.02  # of success: a share at most this much lower counts as equal

Run = dict[str, Any]  # the values of a cell, and its budgets
Groups = Mapping[int | str, list[Run]]  # by graph


def conditions(arguments: argparse.Namespace) -> list[Condition]:
    """Return the settings of the runs: one for each graph, with 4 to 32 nearest or with equidistant neighbours.

    Equidistant neighbours of a state are one level away along one joint.  With --quick the agents learn for 1000 instead of 4000
    transitions.
    """
    budgets = list(BUDGETS[:3] if arguments.quick else BUDGETS)
    return [Condition(f"k{graph}-n{budgets[-1]}", {"graph": graph, "budgets": budgets, "tasks": TASKS}) for graph in GRAPHS]


def trial(settings: dict[str, Any], seed: int) -> dict[str, Any]:
    """Learn on one graph, and test the learned model in the tasks after each number of transitions in "budgets".

    Returns for each task whether it was solved, `reached` (budgets, tasks), by how many `actions` (budgets, tasks), and the `fewest`
    actions that the graph allows (tasks,); `covered`, the number of transitions until every action was tried, or None if some action was
    not tried; and `state_actions`, the number of actions of the graph.  `settings`: "graph", number of neighbours or "equidistant";
    "tasks", their number; "budgets".  `seed`: of agent, graph, tasks and plant.
    """
    space, plant = arm_space(neighbours=settings["graph"], tie_seed=seed), arm_plant(seed)
    begin_anywhere(space, plant, seed)
    agent = CuriousAgent(space, plant, seed=seed)
    once, covered = LeastTries(1, space.state_actions), None
    tasks = drawn_tasks(space, settings["tasks"], seed)
    reached, actions = [], []
    for budget in settings["budgets"]:
        if covered is None:
            explore(agent, budget - agent.transitions, once)
            covered = agent.transitions if agent.model.tries[space.goals >= 0].all() else None
        explore(agent, budget - agent.transitions)
        other = arm_plant(seed + 1000)
        attempts = [attempt(agent.model, other, start, goal, MAX_ACTIONS) for start, goal in tasks]
        reached.append([one.reached for one in attempts])
        actions.append([one.actions for one in attempts])
    return {
        "reached": np.array(reached),
        "actions": np.array(actions, dtype=np.uint8),
        "fewest": np.array([fewest_actions(space, start, goal) for start, goal in tasks], dtype=np.uint8),
        "covered": covered,
        "state_actions": space.state_actions,
    }


def drawn_tasks(space: Space, count: int, seed: int) -> list[tuple[int, int]]:
    """Draw `count` random tasks: pairs of a start state and a goal state, which differ.

    `seed`: of the draw.
    """
    rng = np.random.default_rng(seed)
    return [(int(a), int(b)) for a, b in (rng.choice(len(space), 2, replace=False) for _ in range(count))]


def fewest_actions(space: Space, start: int, goal: int) -> int:
    """Return the smallest number of actions from the state `start` to the state `goal` if all actions succeed; 0 if there is no path."""
    reached, count = {start}, 0
    while goal not in reached:
        further = {int(to) for state in reached for to in space.actions(state)} | reached
        if further == reached:
            return 0
        reached, count = further, count + 1
    return count


class Attempt(NamedTuple):
    """The result of one task: whether the goal state was reached, and by how many actions."""

    reached: bool
    actions: int


def attempt(model: TransitionModel, plant: OfflinePlant, start: int, goal: int, most: int) -> Attempt:
    """Move the arm to the state `start`, and follow the model's plan to the state `goal` by at most `most` actions.

    The plan maximises the discounted probability of entering the goal state.  It uses the debiased counts: observed counts and a weak
    prior, without the imagined outcomes that the model assumes before the first try.  The model does not learn from these actions.
    """
    space = model.space
    beliefs = model.debiased()
    arriving = np.where(beliefs.outcomes == goal, beliefs.probabilities, 0.0).sum(axis=-1)
    reward = np.where(beliefs.probabilities.any(axis=-1), arriving, -np.inf)
    scores = value_iteration(beliefs, reward, DISCOUNT, TOLERANCE)[1]
    state = space.state_of(plant.act(space.part, space.target(start)).q)
    for done in range(most + 1):
        if state == goal:
            return Attempt(True, done)
        if done < most:
            action = int(np.argmax(scores[state]))
            state = space.state_of(plant.act(space.part, space.target(space.goal(state, action))).q)
    return Attempt(False, most)


def groups(found: Cells) -> Groups:
    """Group the finished runs by graph (number of neighbours per state, or "equidistant"); each group is sorted by seed."""

    def of(result: CellResult) -> Run:
        return {**result.values, "budgets": result.cell.settings["budgets"]}

    by_graph = runs_by(found, of, "graph")
    return {graph: by_graph[graph,] for graph in GRAPHS if (graph,) in by_graph}


def success(run: Run, budget: int) -> float:
    """Return the share of tasks that a run solved after it had learned for `budget` transitions."""
    return float(np.mean(run["reached"][run["budgets"].index(budget)]))


def direct(run: Run, budget: int) -> float:
    """Return the share of tasks that a run solved directly, after it had learned for `budget` transitions.

    Directly means: with the smallest number of actions that its graph allows.
    """
    place = run["budgets"].index(budget)
    return float(np.mean(run["reached"][place] & (run["actions"][place] <= run["fewest"])))


def length(run: Run) -> float:
    """Return the mean number of actions of the solved tasks, in the last test of a run, which follows its last transition."""
    return float(run["actions"][-1][run["reached"][-1]].mean())


def learning_times(runs: list[Run]) -> list[int]:
    """Return the number of transitions until every action was tried once, for the runs in which every action was tried."""
    return [run["covered"] for run in runs if run["covered"] is not None]


def findings(found: Cells) -> dict[str, Any]:
    """Return the results as a dict with two keys, "runs" and "claims".

    "runs" is a dict from each graph to a row: "seeds", "state_actions", "transitions_until_all_tried", the shares of tasks solved after
    numbers of transitions, and "actions_per_solved_task".  "claims" is a list with the claims, their measured values and their verdicts, as
    dicts (`Claim.record`).  If not all graphs were run, all claims stay unmeasured and are not judged.
    """
    grouped = groups(found)
    rows = {f"{graph} neighbours": _row(runs) for graph, runs in grouped.items()}
    return {"runs": rows, "claims": judged(CLAIMS, grouped, set(GRAPHS) <= set(grouped))}


def _row(runs: list[Run]) -> dict[str, Any]:
    times = learning_times(runs)
    row: dict[str, Any] = {"seeds": len(runs), "state_actions": runs[0]["state_actions"]}
    row["transitions_until_all_tried"] = round(interquartile_mean(times)) if times else None
    for budget in runs[0]["budgets"]:
        row[f"solved_after_{budget}"] = mean_over(runs, partial(success, budget=budget))
        row[f"solved_directly_after_{budget}"] = mean_over(runs, partial(direct, budget=budget))
    return row | {"actions_per_solved_task": mean_over(runs, length)}


def _fewer(grouped: Groups) -> dict[int, list[Run]]:
    """Return the runs of the published graph and of sparser ones."""
    return {graph: runs for graph, runs in grouped.items() if isinstance(graph, int) and graph <= PUBLISHED}


@claim("paper 4.1", "fewer neighbours shorten learning: transitions until every action was tried once", "qualitative")
def sooner(grouped: Groups) -> Measured:
    """Judge whether the learning time decreases with the number of neighbours per state, from 16 downwards.

    The learning time is the number of transitions until every action was tried once.  Returns the learning times by graph as text, and the
    verdict.  The verdict is None (open) if some runs ended before every action was tried, because the learning times of these slow runs are
    unknown.
    """
    times = {graph: learning_times(runs) for graph, runs in _fewer(grouped).items()}
    middle = {graph: interquartile_mean(found) for graph, found in times.items() if found}
    text = ", ".join(f"{graph} neighbours: {time:.0f}" for graph, time in middle.items())
    unfinished = sum(len(grouped[PUBLISHED]) - len(found) for found in times.values())
    if unfinished:
        return f"{text}; {unfinished} runs had not tried every action", None
    return text, all_hold(is_above(more, fewer) for fewer, more in pairwise(times.values()))


@claim(
    "paper 4.1",
    "16 neighbours are more than necessary: after 1000 transitions plans in a sparser graph succeed as often and as directly",
    "an impression",
)
def denser(grouped: Groups) -> Measured:
    """Judge whether plans in one of the graphs with fewer than 16 neighbours are as good as plans in the graph with 16.

    Plans are as good if the share of tasks that are solved, and the share that is solved directly (with the fewest actions that the graph
    allows), are each at most 0.02 lower.  Returns these shares by graph as text, and the verdict.  The intervals are widened for the number
    of comparisons (Bonferroni).
    """
    fewer = _fewer(grouped)
    shares, straight = (of_each(fewer, partial(share, budget=JUDGED)) for share in (success, direct))
    level = level_of_each(len(fewer) - 1)
    sparser = [
        all_hold(decides(difference_interval(values[graph], values[PUBLISHED], level), least=-MARGIN) for values in (shares, straight))
        for graph in fewer
        if graph < PUBLISHED
    ]
    enough = True if True in sparser else None if None in sparser else False
    each = (f"{graph} neighbours: solved {estimate(shares[graph])}, directly {estimate(straight[graph])}" for graph in fewer)
    return "; ".join(each), enough


@claim("paper 4.1", "with fewer neighbours plans are longer: actions per solved task, after the last transition", "-")
def longer(grouped: Groups) -> Measured:
    lengths = of_each(_fewer(grouped), length)
    return texts(lengths, form="{} neighbours: {}"), all_hold(is_above(less, more) for less, more in pairwise(lengths.values()))


CLAIMS = (sooner, denser, longer)


def plot(found: Cells) -> Any:
    """Draw the share of tasks solved directly, the number of actions and the learning time over the number of neighbours.

    Returns a matplotlib figure.
    """
    grouped = groups(found)
    budgets = next(iter(grouped.values()))[0]["budgets"]
    drawing = new_figure(13.0, 4.0)
    (left, middle, right) = drawing.subplots(1, 3)
    names = [str(graph) for graph in grouped]
    style = {"marker": "o", "markersize": 3, "capsize": 2}
    for budget in budgets:
        shares = [[100.0 * direct(run, budget) for run in runs] for runs in grouped.values()]
        draw_points(left, names, shares, label=f"after {budget} transitions", **style)
    left.set(ylabel="tasks solved directly [%]", xlabel="neighbours per state", ylim=(None, 100.5))
    lengths = [[length(run) for run in runs] for runs in grouped.values()]
    draw_points(middle, names, lengths, label=f"after {budgets[-1]} transitions", **style)
    middle.set(ylabel="actions per solved task", xlabel="neighbours per state")
    times = {name: group for name, runs in zip(names, grouped.values(), strict=True) if (group := learning_times(runs))}
    draw_points(right, list(times), list(times.values()), label="until every action was tried once", **style)
    right.set(ylabel="transitions", xlabel="neighbours per state")
    for axes in (left, middle, right):
        finish(axes, legend=8)
        axes.tick_params(axis="x", labelrotation=30)
    return drawing


EXPERIMENT = Experiment(
    claim="16 neighbours per state are more than necessary: with fewer the robot learns sooner and plans as well",
    source="paper 4.1",
    method=Sweep(conditions, trial, findings, plot),
    claims=CLAIMS,
)
