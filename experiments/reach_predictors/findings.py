"""What the runs say: fractions of the oracle's score."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from experiments.kit.cells import CellResult
from experiments.kit.claims import Claim
from experiments.kit.statistics import decides, interquartile_mean, interval, ratio, ratio_interval, told
from experiments.reach_predictors.learners import LEARNERS, ORACLE, PUBLISHED, RECOMMENDED
from mobee.robot.robot import Array

GRID, BETWEEN = "grid", "between"
AIMS = {(GRID, 200): 0.80, (GRID, 400): 0.90, (GRID, 1600): 0.97, (BETWEEN, 800): 0.80}  # set and problem-tries -> fraction of the oracle
_SETS = {GRID: "on the 27 targets", BETWEEN: "on 8 targets never tried"}
AIMED = {
    (name, look): Claim(
        "aim of this reproduction",
        f"the recommended predictor reaches at least {least:.2f} of the oracle's score after {look} problem-tries {_SETS[name]}",
        f"at least {least:.2f}",
    )
    for (name, look), least in AIMS.items()
}
TIMES = 2.0
ABOVE = Claim(
    "thesis 8.5",
    "a more powerful function approximator benefits the system greatly: at least twice the published one's score after 400 tries",
    "no numbers",
)
CLAIMS = (*AIMED.values(), ABOVE)

Fractions = dict[tuple[str, str], Array]  # learner and set -> (seeds, looks)


def oracle_scores(found: Mapping[str, CellResult], name: str) -> Array:
    """The oracle's cumulative rewards on a set of targets, mean of a seed's evaluations, (seeds,)."""
    mine = [one.values for one in found.values() if one.cell.settings["what"] == ORACLE]
    return np.array([one[f"rewards_{name}"].sum(axis=-1).mean() for one in mine])


def fractions(found: Mapping[str, CellResult]) -> Fractions:
    """The scores of the learners, in the order of the seeds, over the oracle's mean."""
    ordered = sorted(found.values(), key=lambda result: result.cell.seed)
    curves: Fractions = {}
    for name in (GRID, BETWEEN):
        best = oracle_scores(found, name)
        for learner in LEARNERS:
            mine = [one.values for one in ordered if one.cell.settings["what"] == learner]
            if mine and len(best):
                curves[learner, name] = np.array([one[f"rewards_{name}"].sum(axis=-1).mean(axis=-1) for one in mine]) / best.mean()
    return curves


def looks(found: Mapping[str, CellResult]) -> list[int]:
    """The problem-tries after which the learners were evaluated."""
    given = [one.cell.settings["looks"] for one in found.values() if "looks" in one.cell.settings]
    return list(given[0]) if given else []


def findings(found: Mapping[str, CellResult]) -> dict[str, Any]:
    """A row a learner and set, and the claims."""
    curves, at = fractions(found), looks(found)
    rows = {
        f"{learner}, {_SETS[name]}": {str(look): told(column) for look, column in zip(at, curve.T, strict=True)}
        for (learner, name), curve in curves.items()
    }
    best = {_SETS[name]: told(oracle_scores(found, name)) for name in (GRID, BETWEEN) if len(oracle_scores(found, name))}
    seconds = {
        learner: interquartile_mean([one.seconds for one in found.values() if one.cell.settings["what"] == learner])
        for learner in {one.cell.settings["what"] for one in found.values()}
    }
    return {
        "oracle": best,
        "fractions": rows,
        "seconds": dict(sorted(seconds.items())),
        "claims": [claim.record() for claim in judged(curves, at)],
    }


def judged(curves: Fractions, at: list[int]) -> list[Claim]:
    """The claims with our numbers; open where the learner or the look is missing."""
    claims = []
    for (name, look), claim in AIMED.items():
        mine, published = (_column(curves, at, learner, name, look) for learner in (RECOMMENDED, PUBLISHED))
        beside = "" if published is None else f"; the published predictor {told(published)}"
        claims.append(
            claim
            if mine is None
            else claim.measured(f"{RECOMMENDED} {told(mine)}{beside}", decides(interval(mine), least=AIMS[name, look]))
        )
    mine, published = (_column(curves, at, learner, GRID, 400) for learner in (RECOMMENDED, PUBLISHED))
    if mine is None or published is None:
        return [*claims, ABOVE]
    low, high = ratio_interval(mine, published)
    text = f"{ratio(mine, published):.2f} x [{low:.2f}, {high:.2f}] ({RECOMMENDED} {told(mine)}, published {told(published)})"
    return [*claims, ABOVE.measured(text, decides((low, high), least=TIMES))]


def _column(curves: Fractions, at: list[int], learner: str, name: str, look: int) -> Array | None:
    return curves[learner, name][:, at.index(look)] if (learner, name) in curves and look in at else None
