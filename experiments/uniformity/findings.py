"""What the runs say about uniformity."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import Any

from experiments.kit.arm_learning import ARM_NEIGHBOURS, arm_space
from experiments.kit.cells import CellResult
from experiments.kit.claims import Claim
from experiments.kit.outcomes import Explored, Groups, constraint_actions, explored, relative_tries_of
from experiments.kit.statistics import decides, gini, interquartile_mean, interval, ratio, ratio_interval, relative_spread, told
from mobee import Lattice
from mobee.robot.robot import Array

EXPLORERS = ("curious", "least_tried", "random")
GRAPHS = ("nearest", "equidistant")
SPIKE = 1.5  # times the tries of the others
AS_EVEN = 1.1  # times the Gini coefficient: no less even

VISITS = Claim(
    "paper 3.1, fig. 5", "visits over states are more uniform than with least-tried and random exploration (one graph)", "qualitative"
)
TRIES = Claim(
    "paper 3.1, fig. 5", "tries over state-actions are more uniform than with least-tried and random exploration (one graph)", "qualitative"
)
SPIKES = Claim(
    "paper 3.1, fig. 5",
    "the curious agent tries actions at constraints more often than the others: ratio of mean tries (one graph)",
    "spikes",
)
NONE = Claim("paper 3.1, fig. 5", "least-tried and random exploration have no such spikes", "none visible")
SAME = Claim(
    "aim of this reproduction", "with equidistant neighbours least-tried tries as evenly as curiosity: fig. 5 depends on its graph", "-"
)
CLAIMS = (VISITS, TRIES, SPIKES, NONE, SAME)


@cache
def space_of(graph: str) -> Lattice:
    """The lattice of a graph."""
    return arm_space(neighbours=ARM_NEIGHBOURS if graph == "nearest" else "equidistant")


def groups(found: Mapping[str, CellResult]) -> Groups:
    """The runs of each graph and explorer, by seed."""
    return explored(found, space_of, "graph", "explorer")


def at_constraints(grouped: Groups, graph: str) -> Array:
    """Which state-actions (E,) fail, by all explorers' tries on a graph."""
    return constraint_actions(_all_runs(grouped, graph))


def _all_runs(grouped: Groups, graph: str) -> list[Explored]:
    return [run for explorer in EXPLORERS for run in grouped.get((graph, explorer), [])]


def findings(found: Mapping[str, CellResult]) -> dict[str, Any]:
    """A row a graph and explorer, and the claims."""
    grouped = groups(found)
    rows = {f"{graph}, {explorer}": _row(grouped, graph, explorer) for graph, explorer in grouped}
    complete = all((graph, explorer) in grouped for graph in GRAPHS for explorer in EXPLORERS)
    claims = _claims(grouped) if complete else list(CLAIMS)
    return {"runs": rows, "claims": [claim.record() for claim in claims]}


def _row(grouped: Groups, graph: str, explorer: str) -> dict[str, Any]:
    runs, spikes = grouped[graph, explorer], _spikes(grouped, graph, explorer)
    return {
        "seeds": len(runs),
        "tries_spread": interquartile_mean([relative_spread(run.tries) for run in runs]),
        "tries_gini": interquartile_mean([gini(run.tries) for run in runs]),
        "fewest": min(int(run.tries.min()) for run in runs),
        "most": max(int(run.tries.max()) for run in runs),
        "visits_spread": interquartile_mean([relative_spread(run.visits) for run in runs]),
        "at_constraints": interquartile_mean(spikes) if spikes else None,
        "constraint_actions": int(at_constraints(grouped, graph).sum()),
    }


def _spikes(grouped: Groups, graph: str, explorer: str) -> list[float]:
    """Mean tries of actions at constraints over those of the others, of each run: those that fail in all the other runs' tries."""
    return relative_tries_of(grouped[graph, explorer], _all_runs(grouped, graph))


def _claims(grouped: Groups) -> list[Claim]:
    visits = {e: [relative_spread(run.visits) for run in grouped["nearest", e]] for e in EXPLORERS}
    tries = {e: [gini(run.tries) for run in grouped["nearest", e]] for e in EXPLORERS}
    even = {e: [gini(run.tries) for run in grouped["equidistant", e]] for e in EXPLORERS}
    spikes = {e: _spikes(grouped, "nearest", e) for e in EXPLORERS}
    return [
        VISITS.measured(f"standard deviation over mean: {_each(visits)}", _lowest(visits)),
        TRIES.measured(f"Gini coefficient: {_each(tries)}", _lowest(tries)),
        *_spike_claims(spikes),
        SAME.measured(f"Gini coefficient: {_each(even)}", decides(ratio_interval(even["least_tried"], even["curious"]), most=AS_EVEN)),
    ]


def _spike_claims(spikes: Mapping[str, list[float]]) -> list[Claim]:
    """Open where no action fails, so that there is nothing to compare."""
    if not all(spikes.values()):
        return [claim.measured("no action fails in more than half of its tries", None) for claim in (SPIKES, NONE)]
    others = "; ".join(f"{e} {told(spikes[e])}" for e in EXPLORERS[1:])
    return [
        SPIKES.measured(told(spikes["curious"]), interval(spikes["curious"])[0] > SPIKE),
        NONE.measured(others, all(interval(spikes[e])[1] < SPIKE for e in EXPLORERS[1:])),
    ]


def _lowest(values: Mapping[str, list[float]]) -> bool:
    """Whether the curious agent's is below both others', the interval of the ratio included."""
    return all(ratio_interval(values["curious"], values[e])[1] < 1.0 and ratio(values["curious"], values[e]) < 1.0 for e in EXPLORERS[1:])


def _each(values: Mapping[str, list[float]]) -> str:
    return ", ".join(f"{explorer} {told(values[explorer])}" for explorer in EXPLORERS)
