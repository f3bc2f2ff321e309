"""What the runs say about the models learnt."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from experiments.accuracy.worlds import WORLDS, space_of, truths
from experiments.kit.cells import CellResult
from experiments.kit.claims import Claim
from experiments.kit.statistics import decides, interquartile_mean, interval, ratio, ratio_interval, told
from experiments.kit.truth import CERTAIN, Truth, l1, most_likely, sampling_error
from mobee import TransitionModel
from mobee.learning.value_iteration import OutcomeModel
from mobee.robot.robot import Array, Ints

SHARES = (0.125, 0.25, 0.375, 0.5, 0.75, 1.0)  # of a world's transitions, after which its models are looked at
MOST, BETTER, AIM, TEN = 0.04, 1.6, 2.0, 8.0  # L1; times; times; times

_AIM = "aim of this reproduction"
OVERALL = {
    world: Claim(_AIM, f"L1 of the model at most {MOST} after 4000 curious transitions with debiased counts ({text})", f"at most {MOST}")
    for world, text in (("half-space", "half-space"), ("rank3", "arm, 81 states"))
}
STOCHASTIC = {
    (world, explorer): Claim(
        _AIM, f"on stochastic actions the {explorer} agent's model is truer than least-tried's ({text})", f"at least {times} x"
    )
    for world, text in (("half-space", "half-space"), ("rank4", "arm, 256 states"))
    for explorer, times in (("curious", BETTER), ("depleting", AIM))
}
WITHOUT = Claim(_AIM, "without the imagined counts the model is many times truer (arm, 81 states)", f"at least {TEN:.0f} x")
CLAIMS = (*OVERALL.values(), *STOCHASTIC.values(), WITHOUT)

COLUMNS = ("counts", "counts_stochastic", "debiased", "debiased_stochastic")
COUNTS, DEBIASED, DEBIASED_STOCHASTIC = 0, 2, 3
Errors = dict[tuple[str, str], Array]  # world and explorer -> (seeds, looks, columns)


def errors(found: Mapping[str, CellResult]) -> Errors:
    """The model errors at every look of every explorer in every world."""
    known = truths(found)
    grouped: dict[tuple[str, str], list[Array]] = {}
    for result in sorted(found.values(), key=lambda result: result.cell.seed):
        world, explorer = result.cell.settings["world"], result.cell.settings["explorer"]
        if explorer != "walk" and world in known:
            grouped.setdefault((world, explorer), []).append(error_curve(world, known[world], result.values["seen"]))
    return {key: np.array(curves) for key, curves in grouped.items()}


def looks(world: str) -> list[int]:
    """The transitions after which the models of a world are looked at."""
    return [round(share * WORLDS[world].transitions) for share in SHARES]


def error_curve(world: str, truth: OutcomeModel, seen: Ints) -> Array:
    """Learn again from a record (T, 3); the errors at the looks, shape (looks, columns), NaN beyond the record."""
    model, at = TransitionModel(space_of(world)), looks(world)
    beliefs, stochastic = (model, model.debiased()), most_likely(truth) < CERTAIN
    curve = np.full((len(at), len(COLUMNS)), np.nan)
    for n, transition in enumerate(seen.tolist(), 1):
        model.observe(*transition)
        if n in at:
            each = [l1(one, truth) for one in beliefs]
            curve[at.index(n)] = [
                value for error in each for value in (np.nanmean(error), error[stochastic].mean() if stochastic.any() else np.nan)
            ]
    return curve


def findings(found: Mapping[str, CellResult]) -> dict[str, Any]:
    """A row a world and explorer after the last look, and the claims."""
    found_errors = errors(found)
    last = {key: curves[:, -1] for key, curves in found_errors.items()}
    known = truths(found)
    floors = {world: truth_error(truth) for world, truth in known.items()}
    rows = {" ".join(key): _row(mine, known[key[0]], floors[key[0]]) for key, mine in last.items()}
    return {"runs": rows, "claims": [claim.record() for claim in _claims(last, floors)]}


def truth_error(truth: OutcomeModel) -> float | None:
    """The error of the truth itself on the stochastic actions, below which no model is seen to get: 0 for a table; None without any."""
    stochastic = most_likely(truth) < CERTAIN
    if not stochastic.any():
        return None
    return float(sampling_error(truth)[stochastic].mean()) if isinstance(truth, Truth) else 0.0


def _row(last: Array, truth: OutcomeModel, floor: float | None) -> dict[str, Any]:
    numbers = {
        name: interquartile_mean(column) if np.isfinite(column).all() else None for name, column in zip(COLUMNS, last.T, strict=True)
    }
    return {"seeds": len(last), "stochastic_actions": int((most_likely(truth) < CERTAIN).sum()), **numbers, "truth_stochastic": floor}


def _claims(last: Mapping[tuple[str, str], Array], floors: Mapping[str, float | None]) -> list[Claim]:
    def column(world: str, explorer: str, number: int) -> Array | None:
        rows = last.get((world, explorer))
        return None if rows is None or not np.isfinite(rows[:, number]).all() else rows[:, number]

    claims = []
    for world, claim in OVERALL.items():
        mine = column(world, "curious", DEBIASED)
        claims.append(claim if mine is None else claim.measured(told(mine, 4), decides(interval(mine), most=MOST)))
    for (world, explorer), claim in STOCHASTIC.items():
        times = BETTER if explorer == "curious" else AIM
        rival, mine = (column(world, name, DEBIASED_STOCHASTIC) for name in ("least_tried", explorer))
        floor = floors.get(world)
        claims.append(_ratio(claim, rival, mine, times, f"; the truth's own error, a floor to both, is {floor:.3f}" if floor else ""))
    claims.append(_ratio(WITHOUT, column("rank3", "curious", COUNTS), column("rank3", "curious", DEBIASED), TEN))
    return claims


def _ratio(claim: Claim, above: Array | None, below: Array | None, times: float, note: str = "") -> Claim:
    """Whether what is above is that many times what is below; open if one is not known, or the interval holds the number."""
    if above is None or below is None:
        return claim
    low, high = ratio_interval(above, below)
    said = f"{ratio(above, below):.2f} x [{low:.2f}, {high:.2f}] ({interquartile_mean(above):.3f} against {interquartile_mean(below):.3f})"
    return claim.measured(said + note, decides((low, high), times))
