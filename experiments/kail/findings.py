"""What rewards on paper and runs of the robot say about the two divergences."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from experiments.kail.on_paper import told_apart
from experiments.kail.spaces import space_of
from experiments.kit.cells import CellResult
from experiments.kit.claims import Claim
from experiments.kit.outcomes import Explored, Groups, constraint_actions, explored, relative_tries_of
from experiments.kit.statistics import interquartile_mean, interval, told
from mobee.robot.robot import Array

DIVERGENCES = ("kail", "kl")
PARTS = ("left_arm", "torso")
EARLY = 100  # transitions, whose mean pay is compared between the parts

FIRST = Claim("thesis 6.4.2, 6.4.3", "tries until a failing action is told from a sound one: 'Kail' against plain KL", "many with KL")
SECOND = Claim("thesis 6.4.2", "tries until an uncertain action is told from a sound one: 'Kail' against plain KL", "many with KL")
SPIKES = Claim(
    "thesis 6.4.3", "with 'Kail' the agent tries failing actions more than sound ones, more so than with plain KL", "qualitative"
)
SIZE = Claim(
    "thesis 6.4.2",
    "plain KL pays a 27-state learner more than an 81-state one: ratio of what the first tries pay",
    "eqs. 6.6-6.9: falls with size",
)
COMPARABLE = Claim("thesis 6.4.3", "with 'Kail' rewards of learners of different size are comparable: the same ratio", "1")
CLAIMS = (FIRST, SECOND, SPIKES, SIZE, COMPARABLE)


def groups(found: Mapping[str, CellResult]) -> Groups:
    """The runs of each part and divergence, by seed."""
    return explored(found, space_of, "part", "divergence")


def at_constraints(grouped: Groups) -> Array:
    """Which of the arm's state-actions fail, by all tries with both divergences."""
    return constraint_actions(_of_arm(grouped))


def _of_arm(grouped: Groups) -> list[Explored]:
    return [run for divergence in DIVERGENCES for run in grouped.get(("left_arm", divergence), [])]


def spikes(grouped: Groups, divergence: str) -> list[float]:
    """Mean tries of failing actions over those of the others, of each run of the arm: those that fail in all the other runs' tries."""
    return relative_tries_of(grouped["left_arm", divergence], _of_arm(grouped))


def findings(found: Mapping[str, CellResult]) -> dict[str, Any]:
    """A row a part and divergence, and the claims."""
    grouped = groups(found)
    rows = {f"{part}, {divergence}": _row(runs) for (part, divergence), runs in grouped.items()}
    complete = all((part, divergence) in grouped for part in PARTS for divergence in DIVERGENCES)
    claims = _claims(grouped) if complete else list(CLAIMS)
    return {"runs": rows, "claims": [claim.record() for claim in claims]}


def _row(runs: list[Explored]) -> dict[str, Any]:
    untried = [float((run.tries == 0).sum()) for run in runs]
    return {
        "seeds": len(runs),
        "promised_first": round(runs[0].values["first_reward"], 5),
        "paid_first_100": round(interquartile_mean([_early_pay(run) for run in runs]), 5),
        "paid_last_100": round(interquartile_mean([float(run.values["paid"][-EARLY:].mean()) for run in runs]), 5),
        "untried": interquartile_mean(untried),
    }


def _claims(grouped: Groups) -> list[Claim]:
    dearer = {divergence: spikes(grouped, divergence) for divergence in DIVERGENCES}
    ratios = {divergence: _sizes(grouped, divergence) for divergence in DIVERGENCES}
    kl_ratio, kail_ratio = interval(ratios["kl"]), interval(ratios["kail"])
    return [
        _apart(FIRST, "failing"),
        _apart(SECOND, "uncertain"),
        _spikes(dearer),
        SIZE.measured(told(ratios["kl"]), kl_ratio[0] > 1.5),
        COMPARABLE.measured(told(ratios["kail"]), 0.8 < kail_ratio[0] and kail_ratio[1] < 1.25),
    ]


def _spikes(dearer: Mapping[str, list[float]]) -> Claim:
    if not all(dearer.values()):
        return SPIKES.measured("no action fails in more than half of its tries", None)
    text = f"tries over those of the others: {told(dearer['kail'])}, plain KL {told(dearer['kl'])}"
    return SPIKES.measured(text, interval(dearer["kail"])[0] > max(interval(dearer["kl"])[1], 1.0))


def _apart(claim: Claim, kind: str) -> Claim:
    """Tries on paper, in the arm's space."""
    kail, plain = told_apart("left_arm", "kail", kind), told_apart("left_arm", "kl", kind)
    return claim.measured(f"{_tries(kail)} against {_tries(plain)}", kail < plain)


def _tries(count: float) -> str:
    return f"{count:.1f}" if np.isfinite(count) else "never"


def _sizes(grouped: Groups, divergence: str) -> list[float]:
    """What the torso's first tries pay over what the arm's do, of each seed that both have."""
    torso, arm = ({run.seed: _early_pay(run) for run in grouped[part, divergence]} for part in ("torso", "left_arm"))
    return [torso[seed] / arm[seed] for seed in sorted(torso.keys() & arm.keys())]


def _early_pay(run: Explored) -> float:
    return float(run.values["paid"][:EARLY].mean())
