"""What came of the cells, in numbers with intervals, and what that says of the claims."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from experiments.kit.cells import CellResult
from experiments.kit.claims import Claim
from experiments.kit.statistics import interval, told
from mobee import TransitionModel
from mobee.robot.robot import Array

ENTERS = (1.0, 0.9)  # forgetting of the model while a table enters
OF_ALL = ("success", "actions", "touched", "met")  # measures of roadmaps too
MEASURES = (*OF_ALL, "promised", "kept", "through")
TRIES, SURE = 2, 0.8  # a state-action tried as often, and an outcome as likely as that, are looked at and held for certain
ROADMAPS = ("planned once", "repairs", "remembers")
OPERABLE = 0.9  # success of a planner that works
CLAIMS = (
    Claim(
        "paper 3.1, fig. 7",
        "most state-actions take the arm where they aim; of the few that do not, some lead elsewhere always and some sometimes",
        "7 lead elsewhere: 4 always, 3 sometimes",
    ),
    Claim("paper 2, 3.2", "no static workspace is required: the learned planner adapts to a table that enters", "no number"),
    Claim("paper 3.2", "a non-static environment renders the PRM planner inoperable", "no number"),
    Claim("paper 3.2.1, thesis 7.4.1", "trained with dynamic obstacles, the planner avoids unpredictable state-actions", "no number"),
    Claim("paper 3.2.1, thesis 7.4.1", "trained with dynamic obstacles, the planner plans around where they tend to be", "no number"),
)


def fates(model: TransitionModel) -> dict[str, int]:
    """How many state-actions reach their goal, or something else, always or sometimes, among those tried TRIES times."""
    beliefs, space = model.debiased(), model.space
    tried = model.tries >= TRIES
    probabilities = np.array(beliefs.probabilities)
    at_goal = (probabilities * (beliefs.outcomes == space.goals[..., None])).sum(axis=-1)
    likeliest = probabilities.max(axis=-1)
    always = tried & (at_goal >= SURE)
    elsewhere = tried & ~always & (likeliest >= SURE)
    counted = {"tried": tried, "goal": always, "elsewhere": elsewhere, "sometimes": tried & ~always & ~elsewhere}
    return {name: int(which.sum()) for name, which in counted.items()}


def claims(done: Mapping[str, CellResult]) -> list[Claim]:
    """The claims with our numbers."""
    return [_fates_claim(done), _enters_claim(done), _roadmap_claim(done), *_moving_claims(done)]


def summary(done: Mapping[str, CellResult]) -> dict[str, Any]:
    """The tables of the results, as text."""
    who = [("plans", "still", "MDP, trained without the table"), ("plans", "moving", "MDP, trained while it moved")]
    who += [(mode, "roadmap", f"roadmap, {mode}") for mode in ROADMAPS]
    tried = [
        {
            "who": name,
            "table": test,
            **{m: told(tested(done, way, test, m, mode)) for m in (OF_ALL if way == "roadmap" else MEASURES)},
        }
        for mode, way, name in who
        for test in ("down", "moving", "up")
    ]
    entered = []
    for forgetting in ENTERS:
        after, rows = entering(done, forgetting)
        entered += [
            {"forgetting": forgetting, "transitions since": n, **{m: told(rows[m][:, i]) for m in MEASURES}} for i, n in enumerate(after)
        ]
    return {"carried out": tried, "since the table entered": entered}


def tested(done: Mapping[str, CellResult], way: str, test: str, measure: str, mode: str = "plans") -> Array:
    """One value a seed, in the order of the seeds; `mode`: "plans" of the MDP, or one of the ROADMAPS."""
    found = sorted((r for r in done.values() if r.cell.settings["way"] == way), key=lambda r: r.cell.seed)
    return np.array([result.values["tests"][mode][test][measure] for result in found])


def entering(done: Mapping[str, CellResult], forgetting: float) -> tuple[list[int], dict[str, Array]]:
    """Transitions since the table entered, and each measure (seeds, points)."""
    found = [r for r in done.values() if r.cell.settings.get("forgetting") == forgetting]
    rows = {m: np.array([[point[m] for point in result.values["rows"]] for result in found]) for m in MEASURES}
    return list(found[0].values["after"]), rows


def _fates_claim(done: Mapping[str, CellResult]) -> Claim:
    counts = [r.values["fates"] for r in done.values() if r.cell.settings["way"] == "still"]
    share = np.array([c["goal"] / c["tried"] for c in counts])
    elsewhere, sometimes = (np.array([float(c[name]) for c in counts]) for name in ("elsewhere", "sometimes"))
    text = f"{told(share)} of those tried {TRIES} times reach their goal, {told(elsewhere)} lead elsewhere, {told(sometimes)} sometimes"
    return CLAIMS[0].measured(text, interval(share)[0] > 0.5 and interval(elsewhere)[0] > 0.0 and interval(sometimes)[0] > 0.0)


def _enters_claim(done: Mapping[str, CellResult]) -> Claim:
    after, rows = entering(done, ENTERS[0])
    gain = rows["success"][:, -1] - rows["success"][:, 0]
    fewer = rows["actions"][:, 0] - rows["actions"][:, -1]
    text = (
        f"success {told(rows['success'][:, 0])} when it enters, {told(rows['success'][:, -1])} {after[-1]} transitions later;"
        f" actions a query {told(rows['actions'][:, 0])} and {told(rows['actions'][:, -1])}"
    )
    return CLAIMS[1].measured(text, interval(gain)[0] > 0.0 and interval(fewer)[0] > 0.0)


def _roadmap_claim(done: Mapping[str, CellResult]) -> Claim:
    once, repairs = (tested(done, "roadmap", "moving", "success", mode) for mode in ("planned once", "repairs"))
    text = (
        f"success with the moving table: planned once {told(once)}, repaired when a motion fails {told(repairs)};"
        f" the MDP trained while it moved {told(tested(done, 'moving', 'moving', 'success'))}"
    )
    low, high = interval(repairs)
    return CLAIMS[2].measured(text, False if low > OPERABLE else True if high < OPERABLE else None)


def _moving_claims(done: Mapping[str, CellResult]) -> list[Claim]:
    """What an arm that learned with the moving table does better there than one that learned without: actions, and queries that meet it."""
    found = []
    for claim, measure, what in ((CLAIMS[3], "actions", "actions a query"), (CLAIMS[4], "met", "share of queries that meet it")):
        moving, still = (tested(done, way, "moving", measure) for way in ("moving", "still"))
        low, high = interval(still - moving)
        text = f"{what} with the moving table: {told(moving)}, trained without it {told(still)}; less by {told(still - moving)}"
        found.append(claim.measured(text, True if low > 0.0 else False if high < 0.0 else None))
    return found
