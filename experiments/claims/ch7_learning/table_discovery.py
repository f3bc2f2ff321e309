# SPDX-License-Identifier: Apache-2.0
"""Let three independent agents, of torso and arms, explore near a table that an arm reaches only when the torso bends forward.

Claim: over time the agents bend the torso forward, lower the arms and touch the table more and more often, in cycles.  They try most
often the actions whose outcomes depend on another part; both arms try the same actions most often.  Such an action ends in a handful of
states.
Source: paper 3.2 and 4.4, figs. 8 to 10; thesis 6.4, 7.4, figs. 7.10 to 7.12; one run of 18 000 transitions a learner in "a little more
than two full days".  Run time: 9 minutes on 2 cores; with --part more than twice as long.

Torso (27 states, 8 neighbours) and arms (81 states, 16 neighbours, both the same graph) learn at a table 50 cm thick.  Counts of tries
alone prove little, because on a graph of 16 neighbours some actions are tried more often than others even without a table, and all runs
share one graph.  So each explorer also runs with a ghost of the table, which exerts no force, and tries are compared with those at the
ghost.  An action of an arm touches the table if a field of the arm is within 2 cm of the table, or of the ghost, when it ends.
--part: a contact force acts only on the motors of the part that touches, as in the original program; so a contact of an arm with the table
exerts no force on the torso.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from functools import partial
from itertools import product
from typing import Any

import numpy as np

from experiments.claims.ch7_learning import table_measures as measures
from experiments.claims.ch7_learning.table_measures import (
    ARMS,
    EXPLORERS,
    LEARNERS,
    PARTS,
    PROPAGATIONS,
    WINDOW,
    WORLDS,
    Run,
    Runs,
    agreement,
    by_goal,
    judged_of,
    low,
    of_arms,
    runs_of,
    second_peak,
    with_ghosts,
)
from experiments.kit.experiment import Claim, Experiment, Measured, Rule, claim, judged
from experiments.kit.learning.arm import table_agents, table_plant
from experiments.kit.learning.exploration import explore_together
from experiments.kit.plots import new_figure
from experiments.kit.rules import all_hold, decides, of_each, row, stands_above, texts
from experiments.kit.statistics import estimate, interquartile_mean, interval, mean_over
from experiments.kit.sweep import Cells, Condition, Sweep
from mobee.arrays import Array
from mobee.errors import InvalidValue

TRANSITIONS, QUICK = 18_000, 2_000  # per learner
WHERE = {"tree": "the whole tree", "part": "the part alone"}  # contact forces act
HANDFUL = 5  # states
TIMES_CHANCE = 2.0  # precision over that of chance, from which a learner finds the actions that depend on other parts
SIMILAR = 0.3  # rank correlation from which the arms' choices are similar
DAYS, TOLERANCE = (2.0, 2.4), 0.1  # of plant time: "a little more than two", and the share by which it may differ


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the option --part: also run with contact forces that act only on the motors of the part that touches."""
    parser.add_argument("--part", action="store_true", help="also with contact forces that act only up to the root of a part")


def conditions(arguments: argparse.Namespace) -> list[Condition]:
    """Return the settings of the runs: every explorer at the table and at its ghost, which exerts no force.

    With --part the same runs are made again with contact forces that act only on the motors of the part that touches.  With --quick the
    runs have 2000 instead of 18 000 transitions per part.
    """
    transitions, name = (QUICK, "quick-") if arguments.quick else (TRANSITIONS, "")
    return [
        Condition(
            f"{name}{propagate}-{explorer}-{world}",
            {"explorer": explorer, "world": world, "propagate": propagate, "transitions": transitions},
            2.0 if world == "table" else 1.0,
        )
        for propagate, explorer, world in product(PROPAGATIONS if arguments.part else PROPAGATIONS[:1], EXPLORERS, WORLDS)
    ]


def trial(settings: dict[str, Any], seed: int) -> dict[str, Any]:
    """Let the three agents explore with one explorer until each has made its transitions, at the table or its ghost (without forces).

    Returns for each part `seen_PART` (T, 3), the transitions: state, action, state reached; `settled_PART` (T,), False after a timeout;
    `durations_PART` (T,) [s]; and `ends_PART` (T,) [s], the plant time at the end.  For each arm also `touch_ARM` (T,), whether an action
    ended within 2 cm of the table or ghost, and `forward_ARM` (T,), whether the torso was bent forward then.  `settings`: "explorer", the
    rule by which the agents choose actions, one of EXPLORERS; "world", "table" or "ghost"; "propagate", "tree" if a contact force acts on
    all motors from the link down to the base, "part" if only on those of the link's part; "transitions", the number for each agent.
    `seed`: of agents and plant.
    """
    count = settings["transitions"]
    plant = table_plant(seed, settings["world"] == "ghost", settings["propagate"])
    logs = explore_together(table_agents(plant, settings["explorer"], seed), plant, count)
    values: dict[str, Any] = {}
    for part, log in logs.items():
        values |= log.arrays(part, count)
    for arm in ARMS:
        poses = np.array(logs[arm].poses[:count])
        values |= {f"touch_{arm}": measures.near_table(poses, arm), f"forward_{arm}": measures.is_forward(poses)}
    return values


Number = Callable[[Run], float]


def findings(found: Cells) -> dict[str, Any]:
    """Return the results as a dict of tables, and a list with the judged claims, as dicts (`Claim.record`), under "claims".

    Each table is a dict.  "conditions": a row for each explorer at the table and at its ghost, which exerts no force: "seeds", and the
    means over the runs of the numbers that ROW defines.  "tries at the table over those at the ghost": for each explorer, how this ratio of
    the left arm's actions correlates with that of the right arm's, and the share of the actions with the largest ratios that have a low
    goal (a state in which the arm is below the table's top if the torso is bent forward).  "number of actions by number of outcomes": for
    each condition the number of actions of a run, by the number of states in which they ended.  "precision of finding actions that depend
    on other parts": the result of `detector`.  If not every explorer was run in full at table and ghost, all claims stay unmeasured and are
    not judged.
    """
    forces = runs_of(found)
    tree = forces.get(PROPAGATIONS[0], {})
    whole = {(explorer, world) for explorer in EXPLORERS for world in WORLDS} <= set(tree)
    whole = whole and next(iter(tree.values()))[0].number("transitions") >= TRANSITIONS
    every = [(propagate, runs) for propagate, runs in forces.items() if set(runs) == set(tree)]
    return {
        "conditions": {_label(propagate, *key): row(group, ROW) for propagate, runs in forces.items() for key, group in runs.items()},
        "tries at the table over those at the ghost": {
            f"{NAMES[explorer]}, forces on the {propagate}": _interest(pairs)
            for (propagate, runs), explorer in product(forces.items(), EXPLORERS)
            if (pairs := with_ghosts(runs, explorer))
        },
        "number of actions by number of outcomes": {
            _label(propagate, *key): _histogram(group) for propagate, runs in forces.items() for key, group in runs.items()
        },
        "precision of finding actions that depend on other parts": detector(tree),
        "claims": judged(CLAIMS, {WHERE[propagate]: runs for propagate, runs in every}, whole),
    }


ROW: dict[str, Number] = {  # numbers of a run by their labels
    "share_of_arm_actions_at_table": lambda run: run.touch,
    "growth_of_contact_rate": lambda run: run.growth,
    "relative_tries_of_leaning_forward": lambda run: run.torso_forward,
    "share_of_low_arm_actions_with_torso_bent": lambda run: run.low_and_forward,
    "relative_tries_of_low_arm_goals": lambda run: run.arms_low,
    "arm_actions_that_sometimes_fail": lambda run: run.half_failing,
    "timeouts_of_torso": lambda run: run.timeouts["torso"],
    "timeouts_of_arms": lambda run: 0.5 * sum(run.timeouts[arm] for arm in ARMS),
    "robot_hours": lambda run: run.hours,
    "computing_seconds": lambda run: run.result.seconds,
}


def _label(propagate: str, explorer: str, world: str) -> str:
    return f"{NAMES[explorer]} at the {world}, forces on the {propagate}"


def _interest(pairs: Sequence[tuple[Run, Run]]) -> dict[str, float]:
    ratios = [of_arms(*pair) for pair in pairs]
    aims_low = low()[measures.spaces()[ARMS[0]].goals]
    return {
        "correlation_of_arms_by_action": mean_over(ratios, agreement),
        "correlation_of_arms_by_goal": interquartile_mean([agreement(by_goal(ratio)) for ratio in ratios]),
        "share_of_low_goals_in_top_5_percent": mean_over(ratios, partial(measures.share_of_top, chosen=aims_low)),
        "share_of_low_goals_in_all": float(aims_low.mean()),
        "correlation_of_arms_without_ghost": mean_over(pairs, lambda pair: agreement(np.array([pair[0].tries[arm] for arm in ARMS]))),
    }


def _histogram(runs: Sequence[Run]) -> dict[str, float]:
    """Return the number of actions of a run by the number of states in which they ended."""
    most = max(int(run.outcome_numbers.max()) for run in runs)
    counts = np.mean([np.bincount(run.outcome_numbers, minlength=most + 1) for run in runs], axis=0)
    return {str(number): float(counts[number]) for number in range(1, most + 1)}


def detector(runs: Runs) -> dict[str, dict[str, float]]:
    """Return how well a high number of tries indicates that an action depends on poses of other parts.

    If k actions really depend on other parts, the detector names the k actions with the highest scores; its precision is then equal to its
    recall.  The keys are "learner, explorer".  Each value is a dict: "tries", the precision if the score is the number of tries at the
    table; "beside_ghost", the precision if the score compares this number with that at the table's ghost (`log_ratios`); "chance", the
    precision of a random choice.
    """
    table: dict[str, dict[str, float]] = {}
    for learner, explorer in product(LEARNERS, EXPLORERS):
        found = {score: judged_of(runs, explorer, learner, score) for score in measures.SCORES}
        if all(found.values()):
            table[f"{learner}, {NAMES[explorer]}"] = {
                **{score: mean_over(group, lambda one: one.at_all) for score, group in found.items()},
                "chance": mean_over(found["tries"], lambda one: one.chance),
            }
    return table


_PAPER = "paper 3.2, thesis 7.4"
_FORCES = "where contact forces act"
_UNTESTED = "the settle speed and the cable force"


def _against(number: Number, digits: int = 2, least: float = -np.inf) -> Rule:
    """Return a rule: a number is larger for the curious agents at the table than for every other group of runs, and above `least`.

    The other groups are the curious agents at the ghost (a table without forces), and the other explorers at the table and at the ghost.
    `number`: function that computes it from a run.  `digits`: decimals in the text.
    """

    def of_runs(runs: Runs) -> Measured:
        values = of_each(runs, number)
        text = ", ".join(f"{NAMES[explorer]} at the {world} {estimate(group, digits)}" for (explorer, world), group in values.items())
        return text, stands_above(values, ("curious", "table"), least)

    return of_runs


touch = Claim(
    _PAPER,
    "three curious agents of torso and arms begin to touch the table frequently: share of the arms' actions that end at it, second half",
    "qualitative",
    varies=_FORCES,
    untested=_UNTESTED,
    rule=_against(lambda run: run.touch),
)
grows = Claim(
    _PAPER,
    "contact with the table becomes more frequent over time: contact rate of the last third minus that of the first",
    "qualitative",
    varies=_FORCES,
    untested=_UNTESTED,
    rule=_against(lambda run: run.growth, least=0.0),
)
forward = Claim(
    "paper 3.2, fig. 10",
    "the torso tries actions that lean forward most: mean tries over those of other actions, second half",
    "qualitative",
    varies=_FORCES,
    untested=_UNTESTED,
    rule=_against(lambda run: run.torso_forward),
)
low_arms = Claim(
    "paper 3.2, fig. 10",
    "the arms try actions with low goals most: mean tries over those of other actions, second half",
    "qualitative",
    varies=_FORCES,
    untested=_UNTESTED,
    rule=_against(lambda run: run.arms_low),
)


@claim(
    "paper 3.2, fig. 10",
    "the two arms choose very similar actions: rank correlation of tries over those at a table without forces (ghost), by goal",
    "qualitative",
    varies=_FORCES,
    untested=_UNTESTED,
)
def similar(runs: Runs) -> Measured:
    found = {NAMES[e]: [agreement(by_goal(of_arms(*pair))) for pair in with_ghosts(runs, e)] for e in EXPLORERS}
    return texts(found), stands_above(found, "curious", least=SIMILAR)


@claim(
    _PAPER,
    "contact with the table alternates in cycles with other exploration: second peak of the contact rate's autocorrelation",
    "cyclic",
    varies=_FORCES,
    untested=_UNTESTED,
)
def cycles(runs: Runs) -> Measured:
    pairs = with_ghosts(runs, "curious")
    if len(pairs) < 2:
        return "two seeds are needed", None
    ours, theirs = (measures.correlations([pair[which] for pair in pairs]) for which in (0, 1))
    here, there = measures.at_second_peak(ours, theirs)
    text = (
        f"autocorrelation near a lag of {WINDOW * second_peak(ours)} transitions {estimate(here)}, at the ghost {estimate(there)}; "
        f"at a lag of {WINDOW} (contacts come in bouts) {estimate(ours[:, 1])}, at the ghost {estimate(theirs[:, 1])}"
    )
    return text, measures.is_cyclic(ours, theirs)


richer = Claim(
    "paper fig. 9, thesis 7.4",
    "at the table actions have more outcomes than static constraints cause: number of actions with 3 or more",
    "qualitative",
    varies=_FORCES,
    untested=_UNTESTED,
    rule=_against(lambda run: float((run.outcome_numbers >= 3).sum()), 0),
)


@claim(
    "thesis 6.4",
    "at the table no action has more than a handful (5) of outcomes",
    "a handful",
    varies=_FORCES,
    untested=_UNTESTED,
)
def few(runs: Runs) -> Measured:
    curious = runs["curious", "table"]
    most = max(int(run.outcome_numbers.max()) for run in curious)
    many = mean_over(curious, lambda run: float((run.outcome_numbers > HANDFUL).mean()))
    return f"at most {most}; {100.0 * many:.2f} % of the actions have more than {HANDFUL}", most <= HANDFUL


@claim(
    "paper 4.4",
    "actions whose tries most exceed those at a table without forces (ghost) depend on other parts, twice as often as by chance: "
    "precision, equal to recall",
    "qualitative",
    varies=_FORCES,
    untested=_UNTESTED,
)
def detects(runs: Runs) -> Measured:
    parts, holds = list[str](), list[bool | None]()
    for learner in LEARNERS:
        hits = {NAMES[explorer]: judged_of(runs, explorer, learner, "beside_ghost") for explorer in EXPLORERS}
        if not all(hits.values()):
            alone = len({run.seed for group in runs.values() for run in group}) == 1
            return "two seeds are needed" if alone else f"{learner}: no action depends on other parts", None
        values, chance = of_each(hits, lambda one: one.at_all), mean_over(hits["curious"], lambda one: one.chance)
        parts.append(f"{learner}: {texts(values)}, chance {chance:.2f}")
        holds.append(stands_above(values, "curious", least=TIMES_CHANCE * chance))
    return "; ".join(parts), all_hold(holds)


@claim(
    "paper 3.2",
    "18 000 transitions per learner at the table take 2.0 to 2.4 days of robot time, within 10 %",
    "a little more than 2",
    varies=_FORCES,
    untested=_UNTESTED,
)
def days(runs: Runs) -> Measured:
    curious = runs["curious", "table"]
    took = [run.hours / 24.0 for run in curious]
    text = f"{estimate(took)} days; computed in {estimate([run.result.seconds for run in curious], 0)} s"
    return text, decides(interval(took), (1.0 - TOLERANCE) * DAYS[0], (1.0 + TOLERANCE) * DAYS[1])


CLAIMS = (touch, grows, forward, low_arms, similar, cycles, richer, few, detects, days)


LAGS = 30  # windows, of the drawn autocorrelation
NAMES = {"curious": "curious", "least_tried": "least tried", "random": "random"}
COLORS = dict(zip(EXPLORERS, ("C3", "C0", "C2"), strict=True))
STYLES = {"table": "-", "ghost": ":"}


def plot(found: Cells) -> Any:
    """Draw how the three learners explore at the table and at its ghost, which exerts no force, in a figure of nine panels.

    The panels show the tries of the three learners as in paper fig. 10; how often the torso leans forward; contact with the table over
    time; how similar the preferences of both arms are; cycles of contact; how many different outcomes the actions have; and how well one
    can find the actions that depend on other parts by their numbers of tries.  Returns a matplotlib figure.  Raises InvalidValue if no seed
    has runs of the curious agents both at the table and at the ghost.
    """
    runs = runs_of(found).get(PROPAGATIONS[0], {})
    pairs = with_ghosts(runs, "curious")
    if not pairs:
        raise InvalidValue("there are no curious runs at the table and at the ghost: continue the run with --resume.")
    drawing = new_figure(17.0, 13.0)
    grid = drawing.add_gridspec(4, 6)
    for part, place in zip(PARTS, (grid[0, :2], grid[0, 2:], grid[1, 2:]), strict=True):
        _tries(drawing.add_subplot(place), pairs, part)
    _ratio_by_pitch(drawing.add_subplot(grid[1, :2]), runs)
    _touch(drawing.add_subplot(grid[2, :3]), runs)
    _arms(drawing.add_subplot(grid[2, 3:]), pairs)
    _autocorrelations(drawing.add_subplot(grid[3, :2]), runs)
    _outcomes(drawing.add_subplot(grid[3, 2:4]), runs)
    _detector(drawing.add_subplot(grid[3, 4:]), runs)
    return drawing


def _tries(axes: Any, pairs: list[tuple[Run, Run]], part: str) -> None:
    """Draw how often each state-action of a part was tried, at the table and at its ghost (a table without forces).

    The state-actions are in the order of their states; each number is the mean over the runs.  `pairs`: (run at the table, run at the
    ghost).
    """
    table, ghost = (np.mean([pair[which].tries[part].ravel() for pair in pairs], axis=0) for which in (0, 1))
    numbers = np.arange(len(table))
    axes.bar(numbers, table, width=1.0, color="C3", label="table")
    axes.step(numbers, ghost, where="mid", color="k", linewidth=0.5, label="ghost")
    if part == "torso":
        per_state, forward = measures.spaces()[part].goals.shape[1], measures.FORWARD_STATES
        axes.axvspan(forward.start * per_state, forward.stop * per_state, color="0.9", zorder=0, label="torso leans forward")
    axes.set(title=f"{part.replace('_', ' ')}: tries of each state-action", xlabel="state-action", xlim=(-0.5, len(table) - 0.5))
    axes.legend(loc="upper left", fontsize=7)


def _ratio_by_pitch(axes: Any, runs: Runs) -> None:
    for place, ((explorer, world), group) in enumerate(runs.items()):
        values = [run.torso_forward for run in group]
        axes.bar(place, np.mean(values), color=COLORS[explorer], alpha=1.0 if world == "table" else 0.4)
        axes.plot([place] * len(values), values, "k.", markersize=4)
    axes.axhline(1.0, color="k", linewidth=0.5)
    axes.set_xticks(range(len(runs)), [f"{NAMES[explorer]}\n{world}" for explorer, world in runs], fontsize=7)
    axes.set_title("torso: tries of leaning forward over other tries, second half")


def _touch(axes: Any, runs: Runs) -> None:
    for (explorer, world), group in runs.items():
        rates = np.array([_smooth(run.touch_rate) for run in group])
        at = WINDOW * (np.arange(rates.shape[1]) + 0.5 * (len(group[0].touch_rate) - rates.shape[1] + 1))
        axes.plot(at, rates.mean(axis=0), STYLES[world], color=COLORS[explorer], label=f"{NAMES[explorer]}, {world}")
        if world == "table":
            axes.fill_between(at, rates.min(axis=0), rates.max(axis=0), color=COLORS[explorer], alpha=0.15, linewidth=0)
    axes.set(title="arm actions that end within 2 cm of the table (mean and range)", xlabel="transitions of an arm", ylabel="share")
    axes.set_ylim(0.0, None)
    axes.legend(fontsize=7, ncols=3, loc="lower right")


def _smooth(rate: Array) -> Array:
    """Return moving means over a tenth of the run."""
    width = max(1, len(rate) // 10)
    return np.convolve(rate, np.full(width, 1.0 / width), mode="valid")


def _arms(axes: Any, pairs: list[tuple[Run, Run]]) -> None:
    ratios = np.mean([by_goal(of_arms(*pair)) for pair in pairs], axis=0)
    for chosen, color, label in ((~low(), "0.6", "other goals"), (low(), "C3", "goals below the table's top if the torso is bent")):
        axes.plot(ratios[0, chosen], ratios[1, chosen], "o", color=color, markersize=4, label=label)
    for state in np.argsort(-ratios.sum(axis=0))[:8]:
        axes.annotate(str(state), ratios[:, state], fontsize=7, xytext=(3, 3), textcoords="offset points")
    axes.set(title="curious: log ratio of tries, table over ghost, by goal state", xlabel="left arm", ylabel="right arm")
    axes.legend(fontsize=7)


def _autocorrelations(axes: Any, runs: Runs) -> None:
    for world in ("table", "ghost"):
        group = runs.get(("curious", world), [])
        most = min(LAGS, len(group[0].touch_rate) - 2)
        curves = np.array([measures.autocorrelation(run.touch_rate, most) for run in group])
        axes.plot(WINDOW * np.arange(most + 1), curves.mean(axis=0), STYLES[world], color="C3", label=world)
        axes.fill_between(WINDOW * np.arange(most + 1), curves.min(axis=0), curves.max(axis=0), color="C3", alpha=0.12, linewidth=0)
    axes.axhline(0.0, color="k", linewidth=0.5)
    axes.set(title="curious: autocorrelation of the contact rate", xlabel="lag (transitions of an arm)")
    axes.legend(fontsize=7)


def _outcomes(axes: Any, runs: Runs) -> None:
    for place, ((explorer, world), group) in enumerate((key, runs[key]) for key in runs if key[1] == "table" or key[0] == "curious"):
        most = max(int(run.outcome_numbers.max()) for run in group)
        counts = np.mean([np.bincount(run.outcome_numbers, minlength=most + 1) for run in group], axis=0)[1:]
        at = np.arange(1, most + 1) + 0.2 * (place - 1.5)
        hatch = "//" if world == "ghost" else None
        axes.bar(at, counts, 0.2, color=COLORS[explorer], hatch=hatch, label=f"{NAMES[explorer]}, {world}")
    axes.set(title="number of states in which an action ended (all parts)", xlabel="different outcomes", ylabel="actions", yscale="log")
    axes.legend(fontsize=7)


def _detector(axes: Any, runs: Runs) -> None:
    """Draw how well the actions that depend on other parts are found by their tries at the table over those at the ghost.

    One curve shows the precision over the recall, for a learner and an explorer; a dotted line is the precision of a random choice.
    """
    for learner, style in zip(LEARNERS, ("-", "--"), strict=True):
        for explorer in EXPLORERS:
            group = judged_of(runs, explorer, learner, "beside_ghost")
            if group:
                recall, precision = (np.mean([getattr(one, name) for one in group], axis=0) for name in ("recall", "precision"))
                axes.plot(recall, precision, style, color=COLORS[explorer], label=f"{learner}, {NAMES[explorer]}")
                axes.axhline(group[0].chance, color="k", linestyle=":", linewidth=0.5)
    axes.set(title="tries over those at the ghost: finding dependent actions", xlabel="recall", ylabel="precision", ylim=(0.0, 1.02))
    if axes.lines:
        axes.legend(fontsize=7)


EXPERIMENT = Experiment(
    claim="three independent agents of torso and arms become interested in the table: they lean forward and touch it more and more often",
    source="paper 3.2 and 4.4, thesis 7.4",
    method=Sweep(conditions, trial, findings, plot, seeds=6, add_options=add_options, summary=measures.summary),
    claims=CLAIMS,
)
