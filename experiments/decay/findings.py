"""What the snapshots say about the decay."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from experiments.claims import Claim
from experiments.statistics import interquartile_mean, interval, ratio_interval, told
from experiments.sweep import CellResult

EXPLORERS = ("curious", "least_tried", "random")
TIMES = (250, 500, 1000, 2000, 4000)  # transitions

UNIFORM = Claim("paper 3.1, fig. 6", "the reward decays uniformly: largest over mean reward once everything was tried", "qualitative")
GETS_IT = Claim(
    "paper 3.1, fig. 6", "wherever the reward is high the curious agent goes and gets it: largest reward left at the end", "qualitative"
)
FASTER = Claim("paper 3.1", "curiosity leaves less to learn than the others: mean reward at the end, over theirs", "qualitative")
CLAIMS = (UNIFORM, GETS_IT, FASTER)

Groups = dict[str, list[dict[str, Any]]]


def groups(found: Mapping[str, CellResult]) -> Groups:
    """The values of each explorer's runs, by seed."""
    grouped: Groups = {}
    for result in sorted(found.values(), key=lambda result: (EXPLORERS.index(result.cell.settings["explorer"]), result.cell.seed)):
        grouped.setdefault(result.cell.settings["explorer"], []).append(result.values)
    return grouped


def findings(found: Mapping[str, CellResult]) -> dict[str, Any]:
    """A row an explorer, and the claims."""
    grouped = groups(found)
    rows = {f"{name}, {explorer}": _row(runs, number) for explorer, runs in grouped.items() for name, number in _NUMBERS.items()}
    claims = _claims(grouped) if all(explorer in grouped for explorer in EXPLORERS) else list(CLAIMS)
    return {"runs": rows, "claims": [claim.record() for claim in claims]}


_NUMBERS = {"mean": lambda rewards: rewards.mean(), "largest": lambda rewards: rewards.max()}


def _row(runs: list[dict[str, Any]], number: Any) -> dict[str, Any]:
    row: dict[str, Any] = {"seeds": len(runs)}
    for place, time in enumerate(runs[0]["times"]):
        row[f"after_{time}"] = round(interquartile_mean([float(number(run["rewards"][place])) for run in runs]), 5)
    return row


def _claims(grouped: Groups) -> list[Claim]:
    last = {explorer: [run["rewards"][-1] for run in runs] for explorer, runs in grouped.items()}
    peak = {explorer: [float(rewards.max() / rewards.mean()) for rewards in last[explorer]] for explorer in EXPLORERS}
    largest = {explorer: [float(rewards.max()) for rewards in last[explorer]] for explorer in EXPLORERS}
    mean = {explorer: [float(rewards.mean()) for rewards in last[explorer]] for explorer in EXPLORERS}
    others = [ratio_interval(mean["curious"], mean[explorer]) for explorer in EXPLORERS[1:]]
    against = ", ".join(
        f"{interquartile_mean(mean['curious']) / interquartile_mean(mean[explorer]):.2f} [{low:.2f}, {high:.2f}] of {explorer}'s"
        for explorer, (low, high) in zip(EXPLORERS[1:], others, strict=True)
    )
    calmer = all(interval(peak["curious"])[1] < interval(peak[explorer])[0] for explorer in EXPLORERS[1:])
    gone = all(interval(largest["curious"])[1] < interval(largest[explorer])[0] for explorer in EXPLORERS[1:])
    return [
        UNIFORM.measured(_each(peak, 1), calmer),
        GETS_IT.measured(_each(largest, 4), gone),
        FASTER.measured(against, all(high < 1.0 for _, high in others)),
    ]


def _each(values: Mapping[str, list[float]], digits: int) -> str:
    return ", ".join(f"{explorer} {told(values[explorer], digits)}" for explorer in EXPLORERS)
