"""What the runs with a change say about the claims."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from experiments.change.runs import BEFORE, CONDITIONS, EVERY, RELEARNED, Key, Run, runs_of
from experiments.change.worlds import CHANGES
from experiments.kit.cells import CellResult
from experiments.kit.claims import Claim
from experiments.kit.statistics import interquartile_mean, interval, told

VALUE = Claim("thesis 7.2.6", "the value of actions that suddenly end elsewhere shoots up: over that before", "shot up")
TRIED = Claim("thesis 7.2.6", "the agent becomes interested in them: tries over the mean of all in the next 500", "a few times")
MENDED = Claim("thesis 7.2.6", "so it improves its model: error (L1) where they changed, at the end over that at the change", "qualitative")
SOONER = Claim(
    "aim of this reproduction", "a curious agent that forgets (0.95) relearns sooner: transitions until the error is halved", "sooner"
)
FORGETTER = Claim("aim of this reproduction", "so does a least-tried agent that forgets (0.8)", "sooner")
CLAIMS = (VALUE, TRIED, MENDED, SOONER, FORGETTER)

Number = Callable[[Run], float]


def findings(found: Mapping[str, CellResult]) -> dict[str, Any]:
    """A row a condition; the claims if all were run in full."""
    runs = runs_of(found)
    keys = [(change, *condition) for change in CHANGES for condition in CONDITIONS]
    whole = all(runs.get(key) for key in keys) and len(runs[keys[0]][0].series) == 2 * BEFORE // EVERY
    rows = {f"{change}, {explorer}, forgetting {forgetting:g}": _row(runs[change, explorer, forgetting])
            for change, explorer, forgetting in keys if (change, explorer, forgetting) in runs}  # fmt: skip
    return {"agents": rows, "claims": [claim.record() for claim in (_claims(runs) if whole else CLAIMS)]}


def _row(runs: Sequence[Run]) -> dict[str, float]:
    numbers: dict[str, Number] = {
        "changed_actions": lambda run: float(run.changed.sum()),
        "tries_before": lambda run: run.eagerness_before,
        "tries_after": lambda run: run.eagerness,
        "value_jump": lambda run: run.value_jump,
        "error_left": lambda run: float(run.errors[-1]),
        "relearned_after": _censored,
    }
    return {"seeds": len(runs), **{name: interquartile_mean([number(run) for run in runs]) for name, number in numbers.items()}}


def _censored(run: Run) -> float:
    """Until it has relearned, or as long as was looked at."""
    return float(min(run.relearned, EVERY * (len(run.series) - run.looks_before)))


def _claims(runs: Mapping[Key, list[Run]]) -> list[Claim]:
    return [
        _value(runs),
        _against_least_tried(runs),
        _of_changes(MENDED, runs, lambda run: float(run.errors[-1]), lambda low, high: high <= RELEARNED),
        _sooner(SOONER, runs, "curious", 0.95),
        _sooner(FORGETTER, runs, "least_tried", 0.8),
    ]


def _of_changes(claim: Claim, runs: Mapping[Key, list[Run]], number: Number, holds: Callable[[float, float], bool]) -> Claim:
    values = {change: [number(run) for run in runs[change, "curious", 1.0]] for change in CHANGES}
    text = ", ".join(f"{change} {told(mine)}" for change, mine in values.items())
    return claim.measured(text, all(holds(*interval(mine)) for mine in values.values()))


def _value(runs: Mapping[Key, list[Run]]) -> Claim:
    parts, holds = [], True
    for change in CHANGES:
        jumps, before = zip(*((run.value_jump, run.value_jump_before) for run in runs[change, "curious", 1.0]), strict=True)
        parts.append(f"{change} {told(jumps)}, as long before {told(before)}")
        holds = holds and interval(jumps)[0] > max(1.0, interval(before)[1])
    return VALUE.measured("; ".join(parts), holds)


def _against_least_tried(runs: Mapping[Key, list[Run]]) -> Claim:
    parts, holds = [], True
    for change in CHANGES:
        ours, theirs = ([run.eagerness for run in runs[change, explorer, 1.0]] for explorer in ("curious", "least_tried"))
        parts.append(f"{change}: {told(ours)}, least tried {told(theirs)}")
        holds = holds and interval(ours)[0] > max(1.0, interval(theirs)[1])
    return TRIED.measured("; ".join(parts), holds)


def _sooner(claim: Claim, runs: Mapping[Key, list[Run]], explorer: str, forgetting: float) -> Claim:
    parts, holds = [], True
    for change in CHANGES:
        forgot, kept = runs[change, explorer, forgetting], runs[change, explorer, 1.0]
        values = [[_censored(run) for run in mine] for mine in (forgot, kept)]
        never = [sum(np.isinf(run.relearned) for run in mine) for mine in (forgot, kept)]
        said = [f"{told(mine, 0)} (not within the run: {count})" for mine, count in zip(values, never, strict=True)]
        parts.append(f"{change}: {said[0]}, without forgetting {said[1]}")
        holds = holds and interval(values[0])[1] < interval(values[1])[0]
    return claim.measured("; ".join(parts), holds)
