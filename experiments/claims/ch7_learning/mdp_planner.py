"""The learned MDP as a planner: its state-actions, and its plans around a table that comes, or comes and goes.

Claim: most learned state-actions reliably take the arm where they aim, a few lead elsewhere, always or sometimes (fig. 7); no static
workspace is needed, which a PRM planner cannot do without; and a planner trained with dynamic obstacles plans around the regions
where they tend to be.
Source: paper 2, 3.1, 3.2.1, fig. 7; thesis 7.4.1.  Published: no numbers but the figure's seven state-actions that lead elsewhere.
Run time: two minutes on 2 cores.

The left arm of the published robot, 81 states with 16 neighbours, 4000 curious transitions: without the table, or with one that
is set up or down at random after every ten actions; or 2000 without it, then it enters.  Plans are made from debiased counts, anew
after each action, and learn nothing from the 60 queries; in the straight path between start and goal, and there only, is the raised table.
Beside them: the lattice as a roadmap that was verified without the table, planned once or repaired when a motion fails.
The seeds draw noise and queries; all runs share one graph.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from typing import Any

import numpy as np

from experiments.claims.ch7_learning.model_arrows import draw_arrows
from experiments.claims.ch7_learning.planned_queries import TESTS, UP, Queries, TablePlant, roadmaps
from experiments.kit.experiment import Claim, Experiment
from experiments.kit.learning.arm import ARM_NEIGHBOURS, RANK3, arm_space
from experiments.kit.learning.exploration import explore
from experiments.kit.plots import draw_curve, draw_points, new_figure
from experiments.kit.statistics import estimate, interval
from experiments.kit.sweep import Cells, Condition, Sweep, grouped_by
from mobee import CuriousAgent, TransitionModel
from mobee.arrays import Array
from mobee.errors import InvalidValue

LEARNED, BEFORE = 4000, 2000  # transitions, in all and before the table enters
AFTER = (0, 250, 500, 1000, 2000, 4000)  # transitions with the table that has entered
QUERIES = 60
ENTERS = (1.0, 0.9)  # forgetting of the model while a table enters
ROADMAPS = ("planned once", "repairs", "remembers")
PLANNERS = {  # condition and mode: name
    ("still", "plans"): "MDP, trained without the table",
    ("moving", "plans"): "MDP, trained while it moved",
    **{("roadmap", mode): f"roadmap, {mode}" for mode in ROADMAPS},
}
OF_ALL = ("success", "actions", "touched", "met")  # measures of roadmaps too
MEASURES = (*OF_ALL, "promised", "kept", "through")
TRIES, SURE = 2, 0.8  # tries from which a state-action counts, and probability from which an outcome is certain
OPERABLE = 0.9  # success of a planner that works

FATES = Claim(
    "paper 3.1, fig. 7",
    "most state-actions take the arm where they aim; of the few that do not, some lead elsewhere always and some sometimes",
    "7 lead elsewhere: 4 always, 3 sometimes",
)
ADAPTS = Claim("paper 2, 3.2", "no static workspace is required: the learned planner adapts to a table that enters", "no number")
INOPERABLE = Claim("paper 3.2", "a non-static environment renders the PRM planner inoperable", "no number")
PREDICTABLE = Claim(
    "paper 3.2.1, thesis 7.4.1", "trained with dynamic obstacles, the planner avoids unpredictable state-actions", "no number"
)
AROUND = Claim("paper 3.2.1, thesis 7.4.1", "trained with dynamic obstacles, the planner plans around where they tend to be", "no number")
CLAIMS = (FATES, ADAPTS, INOPERABLE, PREDICTABLE, AROUND)


def conditions(arguments: argparse.Namespace) -> list[Condition]:
    """Learned without the table, with one that moves, and one that enters, with and without forgetting; and the roadmaps."""
    settings: dict[str, Any] = {"queries": 10, "share": 0.25} if arguments.quick else {"queries": QUERIES, "share": 1.0}
    lasting = [Condition(condition, settings | {"way": condition}) for condition in ("still", "moving", "roadmap")]
    return lasting + [Condition(f"enters-{f:g}", settings | {"way": "enters", "forgetting": f}, 2.0) for f in ENTERS]


def trial(settings: dict[str, Any], seed: int) -> dict[str, Any]:
    """Learn, and follow plans; the means over the queries by name."""
    condition, share, space = settings["way"], settings["share"], arm_space(RANK3, ARM_NEIGHBOURS)
    plant = TablePlant(seed, moves=condition == "moving")
    queries = Queries.of_seed(plant, space, settings["queries"], seed)
    if condition == "roadmap":
        return {"tests": {mode: queries.in_all_worlds(rival) for mode, rival in roadmaps(plant, space).items()}}
    agent = CuriousAgent(space, plant, seed=seed, forgetting=settings.get("forgetting", 1.0))
    return _entered(agent, plant, queries, share) if condition == "enters" else _learned(agent, queries, share)


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
    """The numbers of state-actions that reach their goal, or something else, always or sometimes, among those tried TRIES times."""
    beliefs, space = model.debiased(), model.space
    tried = model.tries >= TRIES
    probabilities = np.array(beliefs.probabilities)
    at_goal = (probabilities * (beliefs.outcomes == space.goals[..., None])).sum(axis=-1)
    likeliest = probabilities.max(axis=-1)
    always = tried & (at_goal >= SURE)
    elsewhere = tried & ~always & (likeliest >= SURE)
    counted = {"tried": tried, "goal": always, "elsewhere": elsewhere, "sometimes": tried & ~always & ~elsewhere}
    return {name: int(which.sum()) for name, which in counted.items()}


Runs = Mapping[tuple[str, float | None], list[dict[str, Any]]]  # the values by condition and forgetting, if it has one


def runs_of(found: Cells) -> Runs:
    """The values of the finished runs of each condition, by seed."""
    runs: dict[tuple[str, float | None], list[dict[str, Any]]] = {}
    for (condition,), results in grouped_by(found, "way").items():
        for result in results:
            runs.setdefault((condition, result.cell.settings.get("forgetting")), []).append(result.values)
    return runs


def tested(runs: Runs, condition: str, test: str, measure: str, mode: str = "plans") -> Array:
    """A measure of each seed; `mode`: "plans" of the MDP, or one of the ROADMAPS."""
    return np.array([run["tests"][mode][test][measure] for run in runs[condition, None]])


def entering(runs: Runs, forgetting: float) -> tuple[list[int], dict[str, Array]]:
    """Transitions since the table entered, and each measure (seeds, points)."""
    mine = runs["enters", forgetting]
    return list(mine[0]["after"]), {m: np.array([[point[m] for point in run["rows"]] for run in mine]) for m in MEASURES}


def findings(found: Cells) -> dict[str, Any]:
    """The claims, and the tables of plans that were carried out."""
    runs = runs_of(found)
    return {"claims": [claim.record() for claim in measured(runs)], **tables(runs)}


def tables(runs: Runs) -> dict[str, Any]:
    """A row for each planner and world, and for each time since the table entered."""
    tried = [
        {
            "who": name,
            "table": test,
            **{m: estimate(tested(runs, condition, test, m, mode)) for m in (OF_ALL if condition == "roadmap" else MEASURES)},
        }
        for (condition, mode), name in PLANNERS.items()
        for test in TESTS
    ]
    entered = []
    for forgetting in ENTERS:
        after, rows = entering(runs, forgetting)
        entered += [
            {"forgetting": forgetting, "transitions since": n, **{m: estimate(rows[m][:, i]) for m in MEASURES}}
            for i, n in enumerate(after)
        ]
    return {"carried out": tried, "since the table entered": entered}


def measured(runs: Runs) -> list[Claim]:
    """The claims with our numbers, of the runs of all conditions."""
    return [
        _fates(runs),
        _adapts(runs),
        _inoperable(runs),
        _less(PREDICTABLE, runs, "actions", "actions a query"),
        _less(AROUND, runs, "met", "share of queries that meet it"),
    ]


def _fates(runs: Runs) -> Claim:
    counts = [run["fates"] for run in runs["still", None]]
    share = np.array([c["goal"] / c["tried"] for c in counts])
    elsewhere, sometimes = (np.array([float(c[name]) for c in counts]) for name in ("elsewhere", "sometimes"))
    text = f"{estimate(share)} of those tried {TRIES} times reach their goal, "
    text += f"{estimate(elsewhere)} lead elsewhere, {estimate(sometimes)} sometimes"
    return FATES.measured(text, interval(share)[0] > 0.5 and interval(elsewhere)[0] > 0.0 and interval(sometimes)[0] > 0.0)


def _adapts(runs: Runs) -> Claim:
    after, rows = entering(runs, ENTERS[0])
    success, actions = rows["success"], rows["actions"]
    text = (
        f"success {estimate(success[:, 0])} when it enters, {estimate(success[:, -1])} {after[-1]} transitions later;"
        f" actions a query {estimate(actions[:, 0])} and {estimate(actions[:, -1])}"
    )
    return ADAPTS.measured(text, interval(success[:, -1] - success[:, 0])[0] > 0.0 and interval(actions[:, 0] - actions[:, -1])[0] > 0.0)


def _inoperable(runs: Runs) -> Claim:
    once, repairs = (tested(runs, "roadmap", "moving", "success", mode) for mode in ("planned once", "repairs"))
    text = (
        f"success with the moving table: planned once {estimate(once)}, repaired when a motion fails {estimate(repairs)};"
        f" the MDP trained while it moved {estimate(tested(runs, 'moving', 'moving', 'success'))}"
    )
    low, high = interval(repairs)
    return INOPERABLE.measured(text, False if low > OPERABLE else True if high < OPERABLE else None)


def _less(claim: Claim, runs: Runs, measure: str, what: str) -> Claim:
    """Whether an arm that learned with the moving table has less of something there than one that learned without."""
    moving, still = (tested(runs, condition, "moving", measure) for condition in ("moving", "still"))
    low, high = interval(still - moving)
    text = f"{what} with the moving table: {estimate(moving)}, trained without it {estimate(still)}; less by {estimate(still - moving)}"
    return claim.measured(text, True if low > 0.0 else False if high < 0.0 else None)


COLORS = dict(zip(PLANNERS, ("tab:gray", "tab:red", "0.75", "tab:cyan", "tab:blue"), strict=True))
TITLES = {"still": "learned without the table", "moving": "learned while the table goes up and down"}


def plot(found: Cells) -> Any:
    """The learned models as in fig. 7, the plans with a moving table, and how they recover when it has entered."""
    runs = runs_of(found)
    if not runs.keys() >= {*((condition, None) for condition in ("still", "moving", "roadmap")), *(("enters", f) for f in ENTERS)}:
        raise InvalidValue("some conditions lack finished cells: go on with --resume.")
    drawing = new_figure(19.0, 13.0)
    above, below = drawing.subfigures(2, 1, height_ratios=(2.0, 1.0))
    for axes, (condition, title) in zip(above.subplots(1, 2), TITLES.items(), strict=True):
        values = runs[condition, None][0]
        draw_arrows(axes, arm_space(RANK3, ARM_NEIGHBOURS), values["outcomes"], values["probabilities"])
        axes.set_title(title, fontsize=10)
    success, met, recovering, plans = below.subplots(1, 4)
    _moving(success, runs, "success", "share of queries that succeed")
    success.legend(fontsize=7)
    _moving(met, runs, "met", "share of queries that meet the table")
    _entering(recovering, runs, "success", "share of queries that succeed")
    _entering(plans, runs, "actions", "actions a query")
    return drawing


def _moving(axes: Any, runs: Runs, measure: str, label: str) -> None:
    for number, ((condition, mode), name) in enumerate(PLANNERS.items()):
        values = [tested(runs, condition, test, measure, mode) for test in TESTS]
        style = {"fmt": "o", "color": COLORS[condition, mode], "capsize": 3, "markersize": 5}
        draw_points(axes, np.arange(3) + 0.1 * (number - 2), values, label=name, **style)
    axes.set_xticks(range(3), [f"table {test}" for test in TESTS])
    axes.set(ylabel=label, xlabel="while plans are carried out")
    axes.grid(alpha=0.2)


def _entering(axes: Any, runs: Runs, measure: str, label: str) -> None:
    for forgetting, color in zip(ENTERS, ("tab:blue", "tab:orange"), strict=True):
        after, rows = entering(runs, forgetting)
        draw_curve(axes, after, rows[measure], color, "all is remembered" if forgetting == 1.0 else f"counts fade by {forgetting:g}")
    axes.set(xlabel="transitions since the table entered", ylabel=label)
    axes.legend(fontsize=8)
    axes.grid(alpha=0.2)


EXPERIMENT = Experiment(
    name="mdp-planner",
    claim="the learned planner needs no static workspace, and trained with a moving obstacle it plans around where that tends to be",
    source="paper 3.1, 3.2.1, fig. 7; thesis 7.4.1",
    notes=__doc__,
    method=Sweep(conditions, trial, findings, plot),
    claims=CLAIMS,
)
