"""What the runs say about the models learnt."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from experiments.accuracy.worlds import WORLDS, space_of, truths
from experiments.claims import Claim
from experiments.learning.model_error import CERTAIN, l1, most_likely
from experiments.statistics import interquartile_mean, interval, ratio, ratio_interval
from experiments.sweep import CellResult
from mobee import TransitionModel
from mobee.learning.explorers import EXPLORERS
from mobee.learning.value_iteration import OutcomeModel
from mobee.robot.robot import Array, Ints

EXPLORED_BY = tuple(
    name for name in ("curious", "least_tried", "random", "depleting", "count_bonus", "posterior_sampling") if name in EXPLORERS
)
LOOKS = (500, 1000, 1500, 2000, 3000, 4000)  # transitions
MOST, BETTER, AIM, TEN = 0.04, 1.6, 2.0, 8.0  # L1; times; times; times

_AIM = "aim of this reproduction"
OVERALL = {
    world: Claim(_AIM, f"L1 of the model at most {MOST} after 4000 curious transitions with debiased counts ({text})", f"at most {MOST}")
    for world, text in (("half-space", "half-space"), ("equidistant", "arm, equidistant neighbours"))
}
STOCHASTIC = Claim(_AIM, "on stochastic actions curiosity's model is truer than least-tried's (half-space)", f"at least {BETTER} x")
DEPLETING = Claim(_AIM, "and the depleting explorer's is twice as true", f"at least {AIM} x")
DEBIASED = Claim(_AIM, "without the imagined counts the model is many times truer (arm, equidistant neighbours)", f"at least {TEN:.0f} x")
CLAIMS = (*OVERALL.values(), STOCHASTIC, DEPLETING, DEBIASED)

Errors = dict[tuple[str, str], Array]  # world and explorer -> (seeds, looks, 4): counts and debiased, over all and over stochastic actions


def errors(found: Mapping[str, CellResult]) -> Errors:
    """The model errors at every look of every explorer in every world."""
    known = truths(found)
    grouped: dict[tuple[str, str], list[Array]] = {}
    for result in sorted(found.values(), key=lambda result: result.cell.seed):
        world, explorer = result.cell.settings["world"], result.cell.settings["explorer"]
        if explorer != "walk" and world in known:
            grouped.setdefault((world, explorer), []).append(error_curve(world, known[world], result.values["seen"]))
    return {key: np.array(curves) for key, curves in grouped.items()}


def error_curve(world: str, truth: OutcomeModel, seen: Ints) -> Array:
    """Learn again from a record (T, 3); the errors at the looks, shape (looks, 4), NaN beyond the record."""
    model = TransitionModel(space_of(world))
    beliefs, stochastic = (model, model.debiased()), most_likely(truth) < CERTAIN
    curve = np.full((len(LOOKS), 4), np.nan)
    for n, transition in enumerate(seen.tolist(), 1):
        model.observe(*transition)
        if n in LOOKS:
            each = [l1(one, truth) for one in beliefs]
            curve[LOOKS.index(n)] = [
                value for error in each for value in (np.nanmean(error), error[stochastic].mean() if stochastic.any() else np.nan)
            ]
    return curve


def findings(found: Mapping[str, CellResult]) -> dict[str, Any]:
    """A row a world and explorer after the last look, and the claims."""
    found_errors = errors(found)
    last = {key: curves[:, -1] for key, curves in found_errors.items()}
    stochastic = {world: int((most_likely(truth) < CERTAIN).sum()) for world, truth in truths(found).items()}
    rows = {
        f"{world}, {explorer}": _row(last[world, explorer], stochastic[world])
        for world in WORLDS
        for explorer in EXPLORED_BY
        if (world, explorer) in last
    }
    return {"runs": rows, "claims": [claim.record() for claim in _claims(last)]}


def _row(last: Array, stochastic: int) -> dict[str, Any]:
    names = ("counts", "counts_stochastic", "debiased", "debiased_stochastic")
    numbers = {name: interquartile_mean(column) if np.isfinite(column).all() else None for name, column in zip(names, last.T, strict=True)}
    return {"seeds": len(last), "stochastic_actions": stochastic, **numbers}


def _claims(last: Mapping[tuple[str, str], Array]) -> list[Claim]:
    def columns(world: str, explorer: str) -> Array | None:
        rows = last.get((world, explorer))
        return None if rows is None or not np.isfinite(rows[:, [0, 2]]).all() else rows

    claims = []
    for world, claim in OVERALL.items():
        mine = columns(world, "curious")
        claims.append(claim if mine is None else claim.measured(_said(mine[:, 2]), interval(mine[:, 2])[1] <= MOST))
    rival = columns("half-space", "least_tried")
    for claim, explorer, times in ((STOCHASTIC, "curious", BETTER), (DEPLETING, "depleting", AIM)):
        mine = columns("half-space", explorer)
        claims.append(claim if mine is None or rival is None else _ratio(claim, rival[:, 3], mine[:, 3], times))
    mine = columns("equidistant", "curious")
    claims.append(DEBIASED if mine is None else _ratio(DEBIASED, mine[:, 0], mine[:, 2], TEN))
    return claims


def _ratio(claim: Claim, above: Array, below: Array, times: float) -> Claim:
    low, high = ratio_interval(above, below)
    holds = True if low >= times else False if high < times else None
    said = f"{ratio(above, below):.2f} x [{low:.2f}, {high:.2f}] ({interquartile_mean(above):.3f} against {interquartile_mean(below):.3f})"
    return claim.measured(said, holds)


def _said(values: Array) -> str:
    low, high = interval(values)
    return f"{interquartile_mean(values):.4f} [{low:.4f}, {high:.4f}]"
