# SPDX-License-Identifier: Apache-2.0
"""Compare roadmap planners (PRM) with the learned MDP planner on the same noisy robot, of which the roadmaps have a wrong model.

Claim: "a plan first, act later approach, such as PRM planning, will never work well on robots such as the iCub", and the roadmap's
"simple graph is insufficient"; an MDP is needed.  Source: paper 2.3, 3.1 (which announce this comparison); thesis 4.2.
Published: no numbers.  Run time: four minutes on 2 cores.

The left arm of the published robot among four balls; 60 queries from rest to a cell of the rank 3 lattice, at most 120 s each.  Half of the
queries are hard: a straight motion does not reach the goal.  The roadmaps' model of the robot lacks the shoulder's cables ("no cables"), or
its balls are wrong by 1 cm and its joints by 3 degrees ("miscalibrated"), or both; "gross" has three times these errors.  The MDP has no
such model: it learns by curiosity before the queries, or from the queries alone.  A roadmap is planned once, or repaired after a failed
motion for the present query ("repairs") or for all later queries too ("remembers").  A roadmap does not work well if it succeeds in less
than 95 % of the hard queries and less often than the MDP.  The seeds draw balls, noise and queries; all runs share the lattice's graph.
"""

from __future__ import annotations

import argparse
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from experiments.claims.ch8_reaching.arm_queries import BELIEFS, Scene, answer, believed, make_scene, space, world_of
from experiments.kit.experiment import Claim, Experiment
from experiments.kit.learning.arm import arm_plant
from experiments.kit.learning.arm_planners import Learned, PlannedOnce, Repaired, Rival, Straight
from experiments.kit.learning.arm_roadmap import KINDS, NEIGHBOURS, make_roadmap, with_goals
from experiments.kit.plots import new_figure
from experiments.kit.statistics import interquartile_mean, interval
from experiments.kit.sweep import Cells, Condition, Sweep
from mobee import CuriousAgent, Lattice
from mobee.arrays import Array
from mobee.errors import InvalidValue
from mobee.roadmap.ompl import require_ompl

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

FAILS = Claim(
    "paper 3.1", "planning first and acting later, as with a PRM, does not work well: plans of a wrong model fail at run time", "no number"
)
INSUFFICIENT = Claim(
    "paper 2.3",
    "the PRM's simple graph is insufficient, even if it is repaired: where the model is wrong, a learned MDP is needed",
    "no number",
)
CLAIMS = (FAILS, INSUFFICIENT)

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
    """Return straight motions, the MDP after different numbers of transitions, and the roadmaps under each belief."""
    shared = {"queries": 20 if arguments.quick else QUERIES}
    learned = [Condition(f"mdp-{n}", {**shared, "learned": n}, 1.0 + n / 1000) for n in LEARNED]
    roadmaps = [Condition(f"roadmaps-{belief.replace(' ', '-')}", {**shared, "belief": belief}, 8.0) for belief in BELIEFS]
    return [Condition("straight", shared), *learned, *roadmaps]


def trial(settings: dict[str, Any], seed: int) -> dict[str, Any]:
    """Send the rivals of a condition to all goals; returns arrays by "rival|measure"."""
    scene, lattice = make_scene(seed, settings["queries"]), space()
    values: dict[str, Any] = {"hard": scene.is_hard}
    for name, rival, cost in _rivals(settings, seed, scene, lattice):
        got = answer(scene, rival, seed)
        for measure in ("success", "seconds", "actions", "repairs"):
            values[f"{name}|{measure}"] = np.asarray(getattr(got, measure))
        values[f"{name}|cost"] = np.array(cost)
    return values


def _rivals(settings: dict[str, Any], seed: int, scene: Scene, lattice: Lattice) -> Iterator[tuple[str, Rival, float]]:
    """Yield rivals with their names and costs before the first query: hours of plant time, or thousands of poses checked."""
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


@dataclass(frozen=True, slots=True)
class Number:
    """The interquartile mean over the seeds and its 95 % interval."""

    mean: float
    low: float
    high: float

    @classmethod
    def of(cls, values: Array) -> Number:
        """Summarise one value per seed, (n,)."""
        return cls(interquartile_mean(values), *interval(values))

    def __str__(self) -> str:
        digits = 1 if abs(self.mean) >= 2.0 else 2
        return f"{self.mean:.{digits}f} [{self.low:.{digits}f}, {self.high:.{digits}f}]"


@dataclass(frozen=True, slots=True, eq=False)
class Row:
    """A rival under a belief ("" for rivals without a model)."""

    rival: str
    belief: str
    success: Number
    hard: Number
    """Success in hard queries."""
    seconds: Number
    """Plant time per query; the limit for queries that failed."""
    actions: Number
    repairs: Number
    cost: float
    """Hours of plant time, or thousands of poses checked, before the first query."""
    curve: Array
    """(blocks, 3): mean, low and high of the plant time per query, over blocks of queries."""


@dataclass(frozen=True, slots=True, eq=False)
class Summary:
    """All rows, in the order of the cells."""

    rows: tuple[Row, ...]

    def row(self, rival: str, belief: str) -> Row:
        """Return the row of a rival; raises InvalidValue if it has not run."""
        for row in self.rows:
            if (row.rival, row.belief) == (rival, belief):
                return row
        raise InvalidValue(f"no finished cell of {rival!r} with belief {belief!r}: continue the run with --resume.")

    def table(self) -> list[dict[str, Any]]:
        """Return the rows with texts, for the results."""
        return [
            {
                "planner": row.rival,
                "its model": row.belief or "none",
                **{label: str(getattr(row, name)) for name, label in NUMBERS.items()},
                "before the first query": f"{row.cost:.2f} {'thousand poses checked' if row.belief else 'h of robot time'}",
            }
            for row in self.rows
        ]


def summary_of(found: Cells) -> Summary:
    """Summarise the seeds of each rival and belief."""
    values: dict[tuple[str, str], dict[str, list[Array]]] = defaultdict(lambda: defaultdict(list))
    for result in found.values():
        belief = str(result.cell.settings.get("belief", ""))
        hard = result.values["hard"]
        for key, array in result.values.items():
            rival, _, measure = key.partition("|")
            if measure:
                values[rival, belief][measure].append(array)
                if measure == "success":
                    values[rival, belief]["hard"].append(array[hard])
    return Summary(tuple(_row(rival, belief, measures) for (rival, belief), measures in sorted(values.items())))


def _row(rival: str, belief: str, measures: dict[str, list[Array]]) -> Row:
    numbers = {name: Number.of(np.array([values.mean() for values in measures[name]])) for name in NUMBERS}
    seconds = measures["seconds"]  # of each seed; a scene may have fewer queries than the settings ask for
    firsts = range(0, max(map(len, seconds)), BLOCK_SIZE)
    blocks = [Number.of(np.array([one[first : first + BLOCK_SIZE].mean() for one in seconds if len(one) > first])) for first in firsts]
    curve = np.array([(b.mean, b.low, b.high) for b in blocks])
    return Row(rival, belief, **numbers, cost=float(np.mean(measures["cost"])), curve=curve)


def findings(found: Cells) -> dict[str, Any]:
    """Return the claims, and a row per rival and belief."""
    summary = summary_of(found)
    return {"claims": [claim.record() for claim in measured(summary)], "rivals": summary.table()}


def measured(summary: Summary) -> list[Claim]:
    """Return the claims with our numbers."""
    once, learned = summary.row("OMPL, planned once", "both"), summary.row("MDP, 4000 learned", "")
    remembers = summary.row("OMPL, remembers", "both")
    learning = 3600.0 * learned.cost / QUERIES
    first = FAILS.measured(
        f"success of a PRM without cables, 1 cm and 3 degrees wrong: {once.success}, in hard queries {once.hard};"
        f" of the MDP after 4000 transitions: {learned.success}, in hard queries {learned.hard}",
        _falls_short(once, learned),
    )
    second = INSUFFICIENT.measured(
        f"success of a PRM that removes failed edges, and remembers them: {remembers.success}, in hard queries {remembers.hard},"
        f" {remembers.seconds} s per query; of the MDP: {learned.success}, in hard queries {learned.hard}, {learned.seconds} s per query,"
        f" after {learned.cost:.1f} h of learning, which is {learning:.0f} s for each of {QUERIES} queries",
        _falls_short(remembers, learned),
    )
    return [first, second]


def _falls_short(roadmap: Row, learned: Row) -> bool | None:
    """Return whether the roadmap does not work well in hard queries, and the MDP does better; False where the roadmap works well."""
    if roadmap.hard.high < min(MIN_SUCCESS, learned.hard.low):
        return True
    return False if roadmap.hard.low >= MIN_SUCCESS else None


def plot(found: Cells) -> Any:
    """Draw success and time of all rivals under each belief, and the time per query over the number of queries."""
    summary = summary_of(found)
    drawing = new_figure(15.0, 5.0)
    success, seconds, curves = drawing.subplots(1, 3)
    _points(success, summary, "hard", "success in hard queries")
    _points(seconds, summary, "seconds", "robot time per query [s]")
    _curves(curves, summary)
    handles, labels = success.get_legend_handles_labels()
    drawing.legend(handles, labels, loc="outside lower center", ncols=5, fontsize=8)
    return drawing


def _points(axes: Any, summary: Summary, name: str, label: str) -> None:
    roadmaps = [rival for rival in COLORS if any(row.rival == rival and row.belief for row in summary.rows)]
    for rival, color in COLORS.items():
        rows = [row for row in summary.rows if row.rival == rival]
        if rival in roadmaps:
            shift = 0.11 * (roadmaps.index(rival) - (len(roadmaps) - 1) / 2)
            at = np.array([BELIEFS.index(row.belief) for row in rows]) + shift
            _bars(axes, at, rows, name, color, rival)
        elif rows:  # without a model: the same under all beliefs
            number = getattr(rows[0], name)
            axes.axhline(number.mean, color=color, linewidth=1.0, label=f"{rival} ({rows[0].cost:.1f} h)" if "MDP" in rival else rival)
            axes.axhspan(number.low, number.high, color=color, alpha=0.12, linewidth=0.0)
    axes.set_xticks(range(len(BELIEFS)), BELIEFS, fontsize=8)
    axes.set(xlabel="the roadmaps' model of the robot", ylabel=label, ylim=(0.0, None))
    axes.grid(alpha=0.2, axis="y")


def _bars(axes: Any, at: Any, rows: list[Row], name: str, color: str, label: str) -> None:
    numbers = [getattr(row, name) for row in rows]
    means = np.array([number.mean for number in numbers])
    spread = np.array([[number.mean - number.low for number in numbers], [number.high - number.mean for number in numbers]])
    axes.errorbar(at, means, np.maximum(spread, 0.0), fmt="o", color=color, markersize=4, capsize=2, linewidth=1.0, label=label)


def _curves(axes: Any, summary: Summary) -> None:
    for rival, color in COLORS.items():
        for row in summary.rows:
            if row.rival == rival and row.belief in ("", SHOWN) and rival != "straight" and "once" not in rival:
                at = BLOCK_SIZE * (np.arange(len(row.curve)) + 0.5)
                axes.plot(at, row.curve[:, 0], ".-", color=color, linewidth=1.2)
                axes.fill_between(at, row.curve[:, 1], row.curve[:, 2], color=color, alpha=0.1, linewidth=0.0)
    axes.set(xlabel="queries so far", ylabel=f"robot time per query [s], roadmaps' model “{SHOWN}”", ylim=(0.0, None))
    axes.grid(alpha=0.2)


EXPERIMENT = Experiment(
    name="prm-vs-mdp",
    claim="planning first in a roadmap and acting later does not work well on a noisy robot; a learned MDP is needed",
    source="paper 2.3, 3.1; thesis 4.2",
    notes=__doc__,
    method=Sweep(conditions, trial, findings, plot, require=require_ompl),
    claims=CLAIMS,
)
