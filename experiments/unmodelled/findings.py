"""What came of the cells, in numbers with intervals, and what that says of the claims."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from experiments.kit.cells import CellResult
from experiments.kit.claims import Claim
from experiments.kit.reaching.planner_peer import MEMORIES
from experiments.kit.statistics import decides, interval, told
from experiments.unmodelled.contestants import FATES
from experiments.unmodelled.scene import WRONG
from mobee.robot.robot import Array

HIDDEN = WRONG[1:]
EVEN, ABOVE = 0.05, 0.2  # of success: as much below still counts as equal; that far above is the aim
EQUAL_BY, ABOVE_BY = 200, 800  # tries
PERFECT = 0.9  # of its tries: so many succeed with a perfect model, if it is all that is needed
_AIM = "aim of this reproduction"
_EQUAL = (
    f"at most {100.0 * EVEN:.0f} points of success below the re-planning peer, be that without memory or with memory of what was blocked"
)
_ABOVE = f"and at least {100.0 * ABOVE:.0f} points of success above both"
CLAIMS = (
    Claim(_AIM, f"with part of the truth hidden, the reach learner is equal: {_EQUAL}", f"by {EQUAL_BY} tries"),
    Claim(_AIM, _ABOVE, f"by {ABOVE_BY} tries"),
    Claim(_AIM, f"also where MoBeE is as mistaken as the peer it is {_EQUAL}", f"by {EQUAL_BY} tries"),
    Claim(_AIM, f"{_ABOVE} there", f"by {ABOVE_BY} tries"),
    Claim(
        "thesis 9.3",
        f"with nothing hidden planning is enough: the peer, whose model is perfect, succeeds in at least {PERFECT:.0%} of its tries",
        "-",
    ),
)


def claims(done: Mapping[str, CellResult]) -> list[Claim]:
    """The claims with our numbers."""
    found = []
    for number, wrong in enumerate(HIDDEN):
        found.append(_against(done, CLAIMS[2 * number], wrong, EQUAL_BY, -EVEN))
        found.append(_against(done, CLAIMS[2 * number + 1], wrong, ABOVE_BY, ABOVE))
    return [*found, _perfect(done)]


def verdict(leads: Mapping[str, Array], least: float) -> bool | None:
    """Whether the learner's lead (seeds,) over each of the peers is at least that; False if over one of them it is not."""
    each = [decides(interval(lead), least=least) for lead in leads.values()]
    return False if False in each else None if None in each else True


def success(done: Mapping[str, CellResult], who: str, wrong: str) -> tuple[list[int], Array]:
    """After how many tries, and the success of each seed then, (seeds, points)."""
    found = _of(done, who, wrong)
    points = list(found[0].cell.settings["tries"]) if found else []
    return points, np.array([[row["fates"][0] for row in one.values["rows"]] for one in found]).reshape(len(found), len(points))


def crossover(tries: list[int], learner: Array, peer: Array) -> Array:
    """After how many tries each seed's learner is not below the peer for good, (seeds,): inf where it is at the end."""
    ahead = learner >= peer
    for_good = np.flip(np.cumprod(np.flip(ahead, 1), axis=1), 1).astype(bool)
    return np.where(for_good.any(axis=1), np.array(tries)[for_good.argmax(axis=1)], np.inf)


def summary(done: Mapping[str, CellResult]) -> dict[str, Any]:
    """The tables of the results, as text."""
    rows, crossings = [], []
    for wrong in WRONG:
        for who in ("learner", *MEMORIES):
            found = _of(done, who, wrong)
            if not found:
                continue
            last = [one.values["rows"][-1] for one in found]
            points, values = success(done, who, wrong)
            row = {"hidden from": wrong, "who": who} | {f"success at {n}": told(values[:, i]) for i, n in enumerate(points)}
            row |= {fate: told([one["fates"][i] for one in last]) for i, fate in enumerate(FATES) if i}
            row |= {name: told([one[name] for one in last], 1) for name in ("seconds", "actions", "hours")}
            if who != "learner":
                row["planning a try [ms]"] = told([1000.0 * float(np.median(one.values["planning"])) for one in found], 1)
            rows.append(row)
        for memory in MEMORIES:
            tries, learner, peer = *success(done, "learner", wrong), success(done, memory, wrong)[1]
            if len(learner) and learner.shape == peer.shape:
                each = crossover(tries, learner, peer)
                text = ", ".join("never" if np.isinf(n) else f"{n:.0f}" for n in each)
                crossings.append({"hidden from": wrong, "peer remembers": memory, "learner no lower after [tries]": text})
    return {"success": rows, "crossover": crossings}


def _against(done: Mapping[str, CellResult], claim: Claim, wrong: str, by: int, least: float) -> Claim:
    """The learner's success after so many tries, and its lead over the peers without memory and with memory of what was blocked."""
    tries, learner = success(done, "learner", wrong)
    if by not in tries:
        return claim.measured("not measured", None)
    at = tries.index(by)
    theirs = {memory: success(done, memory, wrong)[1][:, at] for memory in MEMORIES}
    leads = {memory: learner[:, at] - values for memory, values in theirs.items()}
    text = f"learner {told(learner[:, at])}; peer that remembers " + "; ".join(
        f"{memory} {told(theirs[memory])}, lead {told(leads[memory])}" for memory in MEMORIES
    )
    return claim.measured(text, verdict({memory: leads[memory] for memory in ("none", "blocked")}, least))


def _perfect(done: Mapping[str, CellResult]) -> Claim:
    tries, learner = success(done, "learner", WRONG[0])
    values = success(done, "none", WRONG[0])[1]
    if not len(learner) or not len(values):
        return CLAIMS[4].measured("not measured", None)
    text = f"peer {told(values[:, -1])}, learner after {tries[-1]} tries {told(learner[:, -1])}"
    return CLAIMS[4].measured(text, decides(interval(values[:, -1]), least=PERFECT))


def _of(done: Mapping[str, CellResult], who: str, wrong: str) -> list[CellResult]:
    """In the order of the seeds; to the learner it is all the same whether the planners are wrong."""
    wanted = {"who": who, "wrong": HIDDEN[0] if who == "learner" and wrong == WRONG[0] else wrong}
    found = [one for one in done.values() if wanted.items() <= one.cell.settings.items()]
    return sorted(found, key=lambda one: one.cell.seed)
