"""What came of the cells, in numbers with intervals, and what that says of the claims."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from experiments.kit.cells import CellResult
from experiments.kit.claims import Claim
from experiments.kit.reaching.arm import reach_space
from experiments.kit.statistics import decides, interval, told
from experiments.learning.model_error import l1
from experiments.learning.truth import Truth, truth_of
from experiments.simultaneous.trial import CONTACT, FIRST, WAYS
from mobee import TransitionModel
from mobee.robot.robot import Array, Ints

SHARE = 0.9  # of the score that model first ends with: the score that both are to come to
EVEN = 0.05  # of that score: as much below still counts as equal

_SOURCE = "thesis 9.4.1"
SOONER = {
    way: Claim(_SOURCE, f"model and reaches at once need no more actions to {SHARE:.0%} of the final score of {told_of} first", "no number")
    for way, told_of in (("first-3000", "3000 curious transitions"), ("first-1000", "1000 curious transitions"))
}
LEVEL = Claim(
    _SOURCE,
    f"with the same total of actions they end with no lower score than the better of these (at most {EVEN:.0%} below)",
    "no number",
)
CLEAN = Claim(_SOURCE, "contact keeps the model clean: its error is smaller than if all failures are the model's", "no number")
HEARD = Claim(_SOURCE, "the reaches are better than if all failures are the target's", "no number")
CLAIMS = (*SOONER.values(), LEVEL, CLEAN, HEARD)


@dataclass(frozen=True, slots=True, eq=False)
class Runs:
    """The N runs of one way, by seed: `scores` and `errors` (N, L) of the looks, after so many `actions` (L,); NaN: not looked at.

    `observed`: as `errors`, of those transitions alone that the model was told of.  `tries`, `failed`: (N,) problem-tries and failed
    transitions.
    """

    actions: Ints
    scores: Array
    errors: Array
    observed: Array
    tries: Ints
    failed: Ints


@dataclass(frozen=True, slots=True, eq=False)
class _Beliefs:
    outcomes: Ints
    probabilities: Array


def findings(found: Mapping[str, CellResult]) -> dict[str, Any]:
    """A row a way, and the claims once every way has runs."""
    runs = runs_of(found)
    results: dict[str, Any] = {"ways": [_row(way, mine) for way, mine in runs.items()]}
    if set(runs) == set(WAYS):
        results["claims"] = [claim.record() for claim in judged(runs)]
    return results


def runs_of(found: Mapping[str, CellResult]) -> dict[str, Runs]:
    """The runs by way, in the order of the seeds."""
    walks = [one.values["seen"] for one in found.values() if one.cell.settings["way"] == "walk"]
    truth = truth_of(reach_space(), np.concatenate(walks).astype(np.intp)) if walks else None
    ordered = sorted(found.values(), key=lambda one: one.cell.seed)
    runs = {}
    for way in WAYS:
        mine = [one for one in ordered if one.cell.settings["way"] == way]
        if mine:
            errors = np.array([_errors(one, truth) for one in mine])
            runs[way] = Runs(
                np.array(mine[0].cell.settings["looks"]),
                np.array([one.values["scores"].mean(axis=-1) for one in mine]),
                errors[..., 0],
                errors[..., 1],
                np.array([one.values["tries"][-1] for one in mine]),
                np.array([one.values["failed"][-1] for one in mine]),
            )
    return runs


def judged(runs: Mapping[str, Runs]) -> list[Claim]:
    """The claims with our numbers."""
    contact = runs[CONTACT]
    ends = {way: mine.scores[:, -1] for way, mine in runs.items()}
    found = []
    for way, claim in SOONER.items():
        least = SHARE * float(ends[way].mean())
        ours, theirs = (actions_to(least, one.actions, one.scores) for one in (contact, runs[way]))
        text = f"{_told_actions(ours)} against {_told_actions(theirs)} actions to a score of {least:.1f}"
        found.append(claim.measured(text, no_more(ours, theirs)))
    text = "score " + ", ".join(f"{way} {told(ends[way])}" for way in (CONTACT, *FIRST))
    found.append(LEVEL.measured(text, level(ends[CONTACT], [ends[way] for way in FIRST])))
    errors = {way: runs[way].errors[:, -1] for way in (CONTACT, "model", "target")}
    text = "L1 " + ", ".join(f"{way} {told(values, 3)}{_of_observed(runs[way])}" for way, values in errors.items())
    found.append(CLEAN.measured(text, above(errors["model"], errors[CONTACT])))
    text = "score " + ", ".join(f"{way} {told(ends[way])}" for way in (CONTACT, "target", "model"))
    found.append(HEARD.measured(text, above(ends[CONTACT], ends["target"])))
    return found


def _told_actions(needed: Array) -> str:
    never = int(np.isinf(needed).sum())
    return f"never in {never} of {len(needed)} runs" if never else told(needed, 0)


def _of_observed(mine: Runs) -> str:
    last = mine.observed[:, -1]
    return f" ({told(last, 3)} of transitions observed)" if np.isfinite(last).all() else ""


def actions_to(least: float, actions: Ints, scores: Array) -> Array:
    """After how many actions each run's scores (N, L) have come to that, on straight lines between the looks, (N,); inf if never."""
    found = np.full(len(scores), np.inf)
    for n, mine in enumerate(scores):
        enough = np.flatnonzero(mine >= least)
        if len(enough):
            at = enough[0]
            known = at > 0 and np.isfinite(mine[at - 1])
            found[n] = np.interp(least, mine[at - 1 : at + 1], actions[at - 1 : at + 1]) if known else actions[at]
    return found


def no_more(ours: Array, theirs: Array) -> bool | None:
    """Whether our runs (N,) need at most as many actions as theirs of the same seeds.

    None where the interval leaves that open, and where a run never came to the score: how many it needs was not measured.
    """
    if not np.isfinite([ours, theirs]).all():
        return None
    return decides(interval(ours - theirs), most=0.0)


def above(higher: Array, lower: Array) -> bool | None:
    """Whether the first runs (N,) are above the second of the same seeds; False if they are below."""
    low, high = interval(higher - lower)
    return True if low > 0.0 else False if high < 0.0 else None


def level(ours: Array, theirs: Sequence[Array]) -> bool | None:
    """Whether our scores (N,) are at most EVEN below each of theirs; False if they are farther below one of them."""
    each = [decides(interval(ours - other), least=-EVEN * float(other.mean())) for other in theirs]
    return False if False in each else None if None in each else True


def _errors(one: CellResult, truth: Truth | None) -> Array:
    """At every look the mean L1 of what is believed, of all transitions and of those observed, (L, 2).

    NaN where nothing was kept, nothing is known to be true, or nothing was observed.
    """
    looks = range(len(one.cell.settings["looks"]))
    found = np.full((len(looks), 2), np.nan)
    for n in looks:
        if truth is not None and f"outcomes_{n}" in one.values:
            believed = _Beliefs(one.values[f"outcomes_{n}"].astype(np.intp), one.values[f"probabilities_{n}"])
            error, observed = l1(believed, truth), _observed(believed)
            found[n, 0] = np.nanmean(error)
            if np.isfinite(error[observed]).any():
                found[n, 1] = np.nanmean(error[observed])
    return found


def _observed(believed: _Beliefs) -> Array:
    """Which transitions (S, A) are not believed to be as they were before anything was observed."""
    before = TransitionModel(reach_space()).debiased().probabilities
    changed: Array = (believed.probabilities[..., : before.shape[2]] != before).any(axis=2)
    return changed


def _row(way: str, mine: Runs) -> dict[str, Any]:
    row: dict[str, Any] = {"way": way, "problem-tries": told(mine.tries, 0), "failed transitions": told(mine.failed, 0)}
    for n, look in enumerate(mine.actions.tolist()):
        if np.isfinite(mine.scores[:, n]).all():
            row[f"score at {look}"] = told(mine.scores[:, n])
    for n, look in enumerate(mine.actions.tolist()):
        if np.isfinite(mine.errors[:, n]).all():
            row[f"L1 at {look}"] = told(mine.errors[:, n], 3) + (_of_observed(mine) if n == len(mine.actions) - 1 else "")
    return row
