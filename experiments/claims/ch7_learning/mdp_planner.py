# SPDX-License-Identifier: Apache-2.0
"""Plan with the learned MDP: without obstacles, around a table that appears after training, and around one that moves up and down.

Claim: most learned state-actions reliably take the arm to their goal; a few end elsewhere, always or sometimes (fig. 7).  The MDP does not
need a static workspace, while a PRM planner does.  A planner trained with dynamic obstacles plans around the regions where they tend to be.
Source: paper 2, 3.1, 3.2.1, fig. 7; thesis 7.4.1.  Published: no numbers but the figure's seven state-actions that lead elsewhere.
Run time: two minutes on 2 cores.

The left arm of the published robot learns on 81 states with 16 neighbours: 4000 transitions of a curious agent without the table ("still")
or with a table that is moved up or down at random after every ten actions ("moving"); or 2000 transitions without the table before it is
raised ("enters").  Then the model is tested in 60 queries, pairs of a start and a goal state.  It learns nothing from them, and plans again
after each action, with debiased counts (observed counts and a weak prior, weaker than that of learning).  In each query the arm would touch
the raised table on the straight path from start to goal, but not in the start or in the goal.  For comparison the same lattice is used as a
roadmap that was verified without the table.  Its path is planned once, or the roadmap is repaired when a motion fails, only for this query
("repairs") or for all later queries too ("remembers").  The seeds draw noise and queries; all runs share one graph.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from experiments.claims.ch7_learning.planned_queries import TESTS, UP, Queries, TablePlant, roadmaps
from experiments.kit.experiment import Claim, Envelope, Experiment, Measured, Rule, claim, judged
from experiments.kit.learning.arm import ARM_NEIGHBOURS, RANK3, arm_space
from experiments.kit.learning.exploration import explore
from experiments.kit.learning.outcomes import in_order
from experiments.kit.plots import draw_curve, draw_points, finish, new_figure
from experiments.kit.rules import all_hold, decides, rises, texts
from experiments.kit.statistics import estimate, interval
from experiments.kit.sweep import Cells, Condition, Sweep
from mobee import CuriousAgent, Lattice, TransitionModel
from mobee.arrays import Array, Ints
from mobee.errors import InvalidValue
from mobee.learning.neighbours import NO_ACTION

LEARNED, BEFORE = 4000, 2000  # transitions, in all and before the table enters
AFTER = (0, 250, 500, 1000, 2000, 4000)  # transitions after the table has entered
QUERIES = 60
ENTERS = (1.0, 0.9)  # factors of forgetting of the models for which a table enters
ROADMAPS = ("planned once", "repairs", "remembers")
PLANNERS = {  # condition and mode: name
    ("still", "plans"): "MDP, trained without the table",
    ("moving", "plans"): "MDP, trained with the moving table",
    **{("roadmap", mode): f"roadmap, {mode}" for mode in ROADMAPS},
}
ROADMAP_MEASURES = {
    "success": "share of queries that succeed",
    "actions": "actions per query",
    "touched": "share of actions that end at the table",
    "met": "share of queries that meet the table",
}
MEASURES = ROADMAP_MEASURES | {
    "promised": "predicted probability that the plan is followed",
    "kept": "share of plans that are followed",
    "through": "share of states on the path in which the raised table is",
}
MIN_TRIES, CERTAIN = 2, 0.8  # tries from which a state-action counts, and probability from which an outcome is certain
OPERABLE = 0.9  # success from which a planner works
MOST = 0.5  # share of the state-actions


def conditions(arguments: argparse.Namespace) -> list[Condition]:
    """Return the settings of the runs: three kinds of training of the agent, and the roadmaps, which need no training.

    The agent learns without the table ("still"), with a table that moves ("moving"), or with one that enters ("enters"); in the last case
    it forgets nothing, or forgets with the factor 0.9.  With --quick there are 10 queries instead of 60, and a quarter of the transitions.
    """
    settings: dict[str, Any] = {"queries": 10, "share": 0.25} if arguments.quick else {"queries": QUERIES, "share": 1.0}
    lasting = [Condition(condition, settings | {"training": condition}) for condition in ("still", "moving", "roadmap")]
    return lasting + [Condition(f"enters-{f:g}", settings | {"training": "enters", "forgetting": f}, 2.0) for f in ENTERS]


def trial(settings: dict[str, Any], seed: int) -> dict[str, Any]:
    """Train an agent with or without a table in its workspace, and let it plan for queries; or let roadmaps plan for the same queries.

    `settings`: "training": "still" (without the table), "moving" (the table moves up and down), "enters" (the table is raised after 2000
    transitions, and the agent continues to learn), or "roadmap" (no training); "queries", their number, each a start state and a goal
    state; "share", the factor by which the usual numbers of transitions are multiplied; for "enters" also "forgetting", the factor with
    which the agent forgets.

    `seed`: of agent, plant and queries.  The keys of the result depend on "training".  For "roadmap": "tests", a dict from the planner
    ("planned once", "repairs", "remembers") to a dict from the position of the table in the queries ("down", "moving", "up") to a dict of
    measures, as in `tested`.  For "still" and "moving": "tests", in the same form, with "plans" as the only planner; "seen", the
    transitions (T, 3); "fates", the counts that `fates` returns; and the learned model, "outcomes" and "probabilities" (S, A, B), with B
    possible outcomes of a state-action.  For "enters": "after", numbers of transitions since the table was raised; and "rows", a dict of
    measures with the raised table for each of them.
    """
    condition, share, space = settings["training"], settings["share"], arm_space(RANK3, ARM_NEIGHBOURS)
    plant = TablePlant(seed, moves=condition == "moving")
    queries = Queries.of_seed(plant, space, settings["queries"], seed)
    if condition == "roadmap":
        return {"tests": {mode: queries.in_all_worlds(rival) for mode, rival in roadmaps(plant, space).items()}}
    agent = CuriousAgent(space, plant, seed=seed, forgetting=settings.get("forgetting", 1.0))
    return _entered(agent, plant, queries, share) if condition == "enters" else _learned(agent, queries, share)


def summary(values: dict[str, Any]) -> dict[str, Any]:
    """Reduce the values of `trial` for the raw record (the archive of a run): the transitions `seen` are sorted.

    Only the number of transitions of each kind is needed.
    """
    return values | ({"seen": in_order(values["seen"]).astype(np.uint8)} if "seen" in values else {})


def _learned(agent: CuriousAgent, queries: Queries, share: float) -> dict[str, Any]:
    seen = explore(agent, round(LEARNED * share))
    beliefs = agent.model.debiased()
    return {
        "seen": seen,
        "tests": {"plans": {test: queries.of_model(beliefs, test) for test in TESTS}},
        "fates": fates(agent.model),
        "outcomes": np.array(beliefs.outcomes),
        "probabilities": np.array(beliefs.probabilities),
    }


def _entered(agent: CuriousAgent, plant: TablePlant, queries: Queries, share: float) -> dict[str, Any]:
    before, after = round(BEFORE * share), [round(n * share) for n in AFTER]
    rows = []
    for n in after:
        agent.run(before + n - agent.transitions)
        plant.set_top(UP)
        rows.append(queries.of_model(agent.model.debiased(), "up"))
    return {"after": after, "rows": rows}


def fates(model: TransitionModel) -> dict[str, int]:
    """Count where the state-actions end, for all state-actions that were tried at least twice.

    The keys are "tried", the number of all these state-actions; "goal", of those that end in their goal with a probability of at least 0.8;
    "elsewhere", of those that end in one other state (which may be their start) with a probability of at least 0.8; and "sometimes", of
    the rest.
    """
    beliefs, space = model.debiased(), model.space
    tried = model.tries >= MIN_TRIES
    probabilities = np.array(beliefs.probabilities)
    at_goal = (probabilities * (beliefs.outcomes == space.goals[..., None])).sum(axis=-1)
    likeliest = probabilities.max(axis=-1)
    always = tried & (at_goal >= CERTAIN)
    elsewhere = tried & ~always & (likeliest >= CERTAIN)
    counted = {"tried": tried, "goal": always, "elsewhere": elsewhere, "sometimes": tried & ~always & ~elsewhere}
    return {name: int(which.sum()) for name, which in counted.items()}


Runs = Mapping[tuple[str, float | None], list[dict[str, Any]]]  # values by condition, and by forgetting if it has one


def runs_of(found: Cells) -> Runs:
    """Group the values of the finished runs by (training, forgetting), each group sorted by seed.

    Training is "still", "moving", "enters" or "roadmap", as explained at `trial`; forgetting is None except for "enters".
    """
    runs: dict[tuple[str, float | None], list[dict[str, Any]]] = {}
    for result in sorted(found.values(), key=lambda result: result.cell.seed):
        settings = result.cell.settings
        runs.setdefault((settings["training"], settings.get("forgetting")), []).append(result.values)
    return runs


def tested(runs: Runs, condition: str, test: str, measure: str, mode: str = "plans") -> Array:
    """Return a measure of the queries of each run, (seeds,).

    `condition`: "still", "moving" or "roadmap".  `test`: position of the table, "down", "moving" or "up".  `measure`: "success", share of
    queries that reach their goal state; "actions", mean number of actions of a query; "touched", share of actions that end in contact with
    the table; "met", share of queries with such an action; and for the MDP "promised", the predicted probability that all actions of a plan
    end as planned, "kept", the share of queries that passed exactly the planned states, and "through", the share of states on the paths in
    which the arm would touch the raised table.  `mode`: "plans" for the MDP; for a roadmap "planned once", "repairs" or "remembers".
    """
    return np.array([run["tests"][mode][test][measure] for run in runs[condition, None]])


def entering(runs: Runs, forgetting: float) -> tuple[list[int], dict[str, Array]]:
    """Return when plans were tested after the table had been raised, and the measures of these tests.

    The times are a list of the numbers of transitions since the table was raised.  `forgetting`: the factor with which the agents forget;
    1: nothing is forgotten.  The measures are a dict from the name, as in `tested`, to values (seeds, points), a column for each number of
    transitions.
    """
    group = runs["enters", forgetting]
    return list(group[0]["after"]), {m: np.array([[point[m] for point in run["rows"]] for run in group]) for m in MEASURES}


def findings(found: Cells) -> dict[str, Any]:
    """Return the results as a dict with the keys "claims", "plans executed" and "after the table entered".

    "claims" is a list with the judged claims, as dicts (`Claim.record`); the others are lists of rows, each a dict of measures as text, as
    in `tables`.
    """
    runs = runs_of(found)
    return {"claims": judged(CLAIMS, runs), **tables(runs)}


def tables(runs: Runs) -> dict[str, Any]:
    """Return two tables of measures: "plans executed" and "after the table entered".

    The first has a row for each planner and position of the table.  The second has a row for each factor of forgetting and number of
    transitions since the table entered.
    """
    executed = [
        {"planner": name, "table": test}
        | {
            label: estimate(tested(runs, condition, test, measure, mode))
            for measure, label in (ROADMAP_MEASURES if condition == "roadmap" else MEASURES).items()
        }
        for (condition, mode), name in PLANNERS.items()
        for test in TESTS
    ]
    entered = []
    for forgetting in ENTERS:
        after, rows = entering(runs, forgetting)
        entered += [
            {"forgetting": forgetting, "transitions since the table entered": n}
            | {label: estimate(rows[measure][:, i]) for measure, label in MEASURES.items()}
            for i, n in enumerate(after)
        ]
    return {"plans executed": executed, "after the table entered": entered}


@claim(
    "paper 3.1, fig. 7",
    "most state-actions of the learned model end in their goal; of the few that do not, some always end elsewhere, some sometimes",
    "7 lead elsewhere: 4 always, 3 sometimes",
)
def ends(runs: Runs) -> Measured:
    counts = [run["fates"] for run in runs["still", None]]
    share = np.array([c["goal"] / c["tried"] for c in counts])
    elsewhere, sometimes = (np.array([float(c[name]) for c in counts]) for name in ("elsewhere", "sometimes"))
    text = f"of the state-actions tried {MIN_TRIES} times or more a share of {estimate(share)} reaches its goal; "
    text += f"{estimate(elsewhere)} state-actions always end elsewhere, {estimate(sometimes)} sometimes"
    return text, all_hold([decides(interval(share), least=MOST), rises(elsewhere), rises(sometimes)])


@claim("paper 2, 3.2", "the learned MDP planner needs no static workspace: it adapts to a table that enters", "no number")
def adapts(runs: Runs) -> Measured:
    after, rows = entering(runs, ENTERS[0])
    success, actions = rows["success"], rows["actions"]
    text = (
        f"success {estimate(success[:, 0])} when it enters, {estimate(success[:, -1])} {after[-1]} transitions later;"
        f" actions per query {estimate(actions[:, 0])} and {estimate(actions[:, -1])}"
    )
    return text, all_hold([rises(success[:, -1] - success[:, 0]), rises(actions[:, 0] - actions[:, -1])])


@claim(
    "paper 3.2",
    "a PRM planner does not work in an environment that moves (it succeeds in less than 0.9 of the queries)",
    "no number",
    untested="how the obstacle moves",
)
def inoperable(runs: Runs) -> Measured:
    success = {mode: tested(runs, "roadmap", "moving", "success", mode) for mode in ROADMAPS}
    text = f"success with the moving table: roadmap that is {texts(success, form='{} {}')};"
    text += f" MDP trained with the moving table {estimate(tested(runs, 'moving', 'moving', 'success'))}"
    return text, Envelope("when a motion fails", {mode: decides(interval(values), most=OPERABLE) for mode, values in success.items()})


def _less(measure: str) -> Rule:
    """Return the rule that a measure with the moving table is smaller for the MDP trained with that table than for the one without."""

    def of_runs(runs: Runs) -> Measured:
        moving, still = (tested(runs, condition, "moving", measure) for condition in ("moving", "still"))
        text = f"{MEASURES[measure]}, trained with the moving table {estimate(moving)}, without it {estimate(still)}; "
        return text + f"difference {estimate(still - moving)}", rises(still - moving)

    return of_runs


predictable = Claim(
    "paper 3.2.1, thesis 7.4.1",
    "an MDP planner trained with a moving obstacle avoids unpredictable state-actions: it needs fewer actions per query",
    "no number",
    rule=_less("actions"),
)
around = Claim(
    "paper 3.2.1, thesis 7.4.1",
    "an MDP planner trained with a moving obstacle plans around the region where it tends to be: fewer queries meet it",
    "no number",
    rule=_less("met"),
)
CLAIMS = (ends, adapts, inoperable, predictable, around)


COLORS = dict(zip(PLANNERS, ("tab:gray", "tab:red", "0.75", "tab:cyan", "tab:blue"), strict=True))
TITLES = {"still": "model learned without the table", "moving": "model learned while the table moves up and down"}

BLOCK_DISTANCE = 4.6  # between blocks of states, in units of the distance of states in a block
COLOURED, SHOWN = 0.3, 0.08  # probabilities of unexpected states: from which a state-action is coloured, and an arrow drawn
LEVEL_NAMES = ("123", "abc", ("I", "II", "III"), "ABC")  # of pitch, roll, yaw and elbow, as in the paper


def plot(found: Cells) -> Any:
    """Draw the learned models as in fig. 7, the success of plans with the table, and their recovery after a table has entered.

    Returns a matplotlib figure.  Raises InvalidValue if there are no finished runs of some kind of training.
    """
    runs = runs_of(found)
    if not runs.keys() >= {*((condition, None) for condition in ("still", "moving", "roadmap")), *(("enters", f) for f in ENTERS)}:
        raise InvalidValue("some cells are not finished: continue the run with --resume.")
    drawing = new_figure(19.0, 13.0)
    above, below = drawing.subfigures(2, 1, height_ratios=(2.0, 1.0))
    for axes, (condition, title) in zip(above.subplots(1, 2), TITLES.items(), strict=True):
        values = runs[condition, None][0]
        draw_arrows(axes, arm_space(RANK3, ARM_NEIGHBOURS), values["outcomes"], values["probabilities"])
        axes.set_title(title, fontsize=10)
    success, met, recovering, plans = below.subplots(1, 4)
    _moving(success, runs, "success")
    success.legend(fontsize=7)
    _moving(met, runs, "met")
    _entering(recovering, runs, "success")
    _entering(plans, runs, "actions")
    return drawing


def _moving(axes: Any, runs: Runs, measure: str) -> None:
    for number, ((condition, mode), name) in enumerate(PLANNERS.items()):
        values = [tested(runs, condition, test, measure, mode) for test in TESTS]
        style = {"fmt": "o", "color": COLORS[condition, mode], "capsize": 3, "markersize": 5}
        draw_points(axes, np.arange(3) + 0.1 * (number - 2), values, label=name, **style)
    axes.set_xticks(range(3), TESTS)
    finish(axes, ylabel=MEASURES[measure], xlabel="table while the plans are executed")


def _entering(axes: Any, runs: Runs, measure: str) -> None:
    for forgetting, color in zip(ENTERS, ("tab:blue", "tab:orange"), strict=True):
        after, rows = entering(runs, forgetting)
        draw_curve(axes, after, rows[measure], color, "no forgetting" if forgetting == 1.0 else f"forgetting {forgetting:g}")
    finish(axes, legend=8, xlabel="transitions since the table entered", ylabel=MEASURES[measure])


def draw_arrows(axes: Any, space: Lattice, outcomes: Ints, probabilities: Array) -> None:
    """Draw the transition model of an arm with three levels of each joint as in fig. 7 of the paper: states as points, outcomes as arrows.

    `outcomes`, `probabilities`: (S, A, B).  Pitch and elbow vary within a block, roll and yaw from block to block.  For each state-action a
    grey line joins its start and its goal.  A state-action is coloured if it ends with a probability of at least 0.3 in one state that is
    neither its goal nor its start.  Each coloured state-action has an arrow to every outcome with a probability of at least 0.08, except to
    its start; the width of an arrow is proportional to the probability.  `axes`: of Matplotlib.
    """
    from matplotlib import colormaps
    from matplotlib.collections import LineCollection
    from matplotlib.patches import FancyArrowPatch

    places = _places(len(space))
    states, actions = np.nonzero(space.goals != NO_ACTION)
    goals = space.goals[states, actions]
    axes.add_collection(
        LineCollection(list(np.stack([places[states], places[goals]], axis=1)), colors="0.5", linewidths=0.3, alpha=0.18, zorder=1)
    )
    colors = colormaps["turbo"]
    coloured = list(_unexpected(space, outcomes, probabilities))
    for number, (state, action) in enumerate(coloured):
        color = colors((number * 0.618) % 1.0)  # distant colours for neighbours in the list
        for outcome, probability in zip(outcomes[state, action], probabilities[state, action], strict=True):
            if probability >= SHOWN and outcome != state:
                arrow = FancyArrowPatch(
                    places[state],
                    places[outcome],
                    connectionstyle="arc3,rad=0.15",
                    arrowstyle="-|>",
                    mutation_scale=4.0 + 5.0 * probability,
                    linewidth=2.0 * probability,
                    color=color,
                    shrinkA=2.0,
                    shrinkB=2.0,
                    zorder=3,
                )
                axes.add_patch(arrow)
    axes.plot(*places.T, "o", color="0.2", markersize=2.2, zorder=2)
    _label(axes, places)
    axes.set(xlim=(-1.3, 2.0 * BLOCK_DISTANCE + 3.0), ylim=(-1.6, 2.0 * BLOCK_DISTANCE + 2.6))
    axes.set_axis_off()
    axes.text(BLOCK_DISTANCE + 1.0, -1.55, f"{len(coloured)} coloured of {len(states)} state-actions", ha="center", fontsize=8)


def _unexpected(space: Lattice, outcomes: Ints, probabilities: Array) -> Iterator[tuple[int, int]]:
    """Yield state-actions with a likely outcome that is neither their goal nor where they start."""
    for state in range(len(space)):
        for action, goal in enumerate(space.actions(state)):
            other = (outcomes[state, action] != goal) & (outcomes[state, action] != state)
            if probabilities[state, action][other].max(initial=0.0) >= COLOURED:
                yield state, action


def _places(count: int) -> Array:
    """Return drawing positions (S, 2): pitch and roll to the right, elbow and yaw up; tilted, so that arrows do not cover each other."""
    pitch, roll, yaw, elbow = (np.arange(count)[:, None] // 3 ** np.arange(4) % 3).T
    x = BLOCK_DISTANCE * roll + pitch + 0.18 * (elbow - 1)
    y = BLOCK_DISTANCE * yaw + elbow + 0.18 * (pitch - 1)
    return np.stack([x, y], axis=1)


def _label(axes: Any, places: Array) -> None:
    for level in range(3):
        axes.text(BLOCK_DISTANCE * level + 1.0, -1.1, f"roll {LEVEL_NAMES[1][level]}", ha="center", fontsize=8)
        axes.text(-0.9, BLOCK_DISTANCE * level + 1.0, f"yaw {LEVEL_NAMES[2][level]}", ha="center", va="center", rotation=90, fontsize=8)
        axes.text(places[level, 0], places[level, 1] - 0.45, LEVEL_NAMES[0][level], ha="center", fontsize=6, color="0.4")
        axes.text(places[27 * level, 0] - 0.4, places[27 * level, 1], LEVEL_NAMES[3][level], va="center", fontsize=6, color="0.4")


EXPERIMENT = Experiment(
    claim="the learned MDP planner needs no static workspace; trained with a moving obstacle, it plans around where that tends to be",
    source="paper 3.1, 3.2.1, fig. 7; thesis 7.4.1",
    method=Sweep(conditions, trial, findings, plot, summary=summary),
    claims=CLAIMS,
)
