"""What the runs say about the number of neighbours."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from experiments.kit.cells import CellResult
from experiments.kit.claims import Claim
from experiments.kit.statistics import decides, interquartile_mean, interval, ratio_interval, told

GRAPHS: tuple[int | str, ...] = (4, 6, 8, 12, 16, 24, 32, "equidistant")
PUBLISHED = 16
MARGIN = 0.02  # of success, within which two graphs plan as well

SOONER = Claim("paper 4.1", "fewer neighbours shorten the time to learn: transitions until everything was tried once", "qualitative")
DENSER = Claim(
    "paper 4.1",
    "16 neighbours are more than necessary: a sparser graph reaches its goals as surely and as directly after 1000 transitions",
    "an impression",
)
LENGTH = Claim("paper 4.1", "what fewer neighbours cost: actions on the way, after the last budget", "-")
CLAIMS = (SOONER, DENSER, LENGTH)

Groups = dict[int | str, list[dict[str, Any]]]


def groups(found: Mapping[str, CellResult]) -> Groups:
    """The values of each graph's runs, with their budgets, by seed."""
    grouped: Groups = {}
    for result in sorted(found.values(), key=lambda result: (GRAPHS.index(result.cell.settings["graph"]), result.cell.seed)):
        values = {**result.values, "budgets": result.cell.settings["budgets"]}
        grouped.setdefault(result.cell.settings["graph"], []).append(values)
    return grouped


def success(run: Mapping[str, Any], budget: int) -> float:
    """Share of the tasks that succeeded after a budget."""
    return float(np.mean(run["reached"][run["budgets"].index(budget)]))


def direct(run: Mapping[str, Any], budget: int) -> float:
    """Share of the tasks that were solved with the fewest actions that the graph allows."""
    place = run["budgets"].index(budget)
    return float(np.mean(run["reached"][place] & (run["actions"][place] <= run["fewest"])))


def length(run: Mapping[str, Any]) -> float:
    """Mean number of actions of the tasks that succeeded, after the last budget."""
    return float(run["actions"][-1][run["reached"][-1]].mean())


def findings(found: Mapping[str, CellResult]) -> dict[str, Any]:
    """A row a graph, and the claims."""
    grouped = groups(found)
    rows = {f"{graph} neighbours": _row(runs) for graph, runs in grouped.items()}
    claims = _claims(grouped) if all(graph in grouped for graph in GRAPHS) else list(CLAIMS)
    return {"runs": rows, "claims": [claim.record() for claim in claims]}


def _row(runs: list[dict[str, Any]]) -> dict[str, Any]:
    covered = [run["covered"] for run in runs if run["covered"] is not None]
    row: dict[str, Any] = {"seeds": len(runs), "state_actions": runs[0]["state_actions"]}
    row["learned_after"] = round(interquartile_mean(covered)) if covered else None
    for budget in runs[0]["budgets"]:
        row[f"success_{budget}"] = interquartile_mean([success(run, budget) for run in runs])
        row[f"direct_{budget}"] = interquartile_mean([direct(run, budget) for run in runs])
    return row | {"actions": interquartile_mean([length(run) for run in runs])}


def _claims(grouped: Groups) -> list[Claim]:
    fewer = [graph for graph in GRAPHS if isinstance(graph, int) and graph <= PUBLISHED]
    times = {graph: [run["covered"] for run in grouped[graph] if run["covered"] is not None] for graph in fewer}
    middle = {graph: interquartile_mean(found) for graph, found in times.items() if found}
    budget = 1000
    shares = {graph: [success(run, budget) for run in grouped[graph]] for graph in fewer}
    ways = {graph: [direct(run, budget) for run in grouped[graph]] for graph in fewer}
    lengths = {graph: [length(run) for run in grouped[graph]] for graph in fewer}
    least = interquartile_mean(shares[PUBLISHED]) - MARGIN
    straight = interquartile_mean(ways[PUBLISHED]) - MARGIN
    sparser = [graph for graph in fewer if graph < PUBLISHED]
    enough = [graph for graph in sparser if interval(shares[graph])[0] >= least and interval(ways[graph])[0] >= straight]
    return [
        _sooner(times, middle, len(grouped[PUBLISHED])),
        DENSER.measured(
            ", ".join(f"{graph}: {told(shares[graph])}, direct {told(ways[graph])}" for graph in fewer),
            bool(enough),
        ),
        LENGTH.measured(", ".join(f"{graph}: {told(values)}" for graph, values in lengths.items()), None),
    ]


def _sooner(times: Mapping[int, list[int]], middle: Mapping[int, float], seeds: int) -> Claim:
    """Open while a run has not tried everything: those that have are the quicker ones."""
    text = ", ".join(f"{graph}: {time:.0f}" for graph, time in middle.items())
    unfinished = sum(seeds - len(found) for found in times.values())
    if unfinished:
        return SOONER.measured(f"{text}; {unfinished} runs had not tried everything", None)
    fewest, *_, most = times.values()
    ordered = list(middle.values())
    return SOONER.measured(text, decides(ratio_interval(fewest, most), most=1.0) if ordered == sorted(ordered) else False)
