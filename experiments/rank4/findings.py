"""What the runs on the two lattices of rank 4 say about the claims."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from experiments.kit.cells import CellResult
from experiments.kit.claims import Claim
from experiments.kit.outcomes import ends_of, outcome_counts
from experiments.kit.statistics import interquartile_mean, interval, told
from experiments.rank4.runs import ACTIONS, ASIDE, HARDLY, NEVER, Run, runs_of

MOST_VISITS, LEAST_ASIDE, HANDFUL = 10, 100, 10
MANY = 0.01  # of the actions, for self-contacts to be many

UNREACHED = Claim("thesis 7.3, fig. 7.8", "20-80 %: the states 60, 124, 188 and 252 are never reached", "never; 189 neither")
RARE = Claim("thesis 7.3", "20-80 %: 61, 125, 189 and 253 are reached at most 10 times each in 14 597 actions", "2, 3, 0 and 2 times")
TURNED = Claim(
    "thesis 7.3",
    "57->61 ends in 62, 121->125 in 126, 249->253 in 254, at least 100 times each with a handful of exceptions",
    "225 of 228, 238 of 244, 208 of 213",
)
RANDOM = Claim("thesis 7.3", "static constraints do not make outcomes deterministic: actions end in several states", "qualitative")
STRETCH = Claim("thesis 7.3, fig. 7.9", "12.5-87.5 %: many more states are out of reach", "far too many to discuss")
CONTACTS = Claim(
    "thesis 7.3", "many self-collisions occur between arm and body on both lattices (more than 1 % of the actions)", "qualitative"
)
MORE = Claim("thesis 7.3", "the stretched lattice produces many more of them", "qualitative")
DESPITE = Claim("thesis 7.3", "some of them do not affect the outcome: the arm is deflected and reaches its goal", "qualitative")
CLAIMS = (UNREACHED, RARE, TURNED, RANDOM, STRETCH, CONTACTS, MORE, DESPITE)


def findings(found: Mapping[str, CellResult]) -> dict[str, Any]:
    """What was reached, where the actions turned aside end, self-contacts by pair; and the claims, if both lattices were explored."""
    runs = runs_of(found)
    whole = all(lattice in runs and len(runs[lattice][0].seen) == actions for lattice, actions in ACTIONS.items())
    return {
        "lattices": {lattice: _row(mine) for lattice, mine in runs.items()},
        "unreached": {lattice: _shares(mine) for lattice, mine in runs.items()},
        "turned aside": {f"{s}->{g}": _ends(runs["small"], s, g) for s, g in ASIDE} if "small" in runs else {},
        "self-contacts": {lattice: contacts_by_pair(mine) for lattice, mine in runs.items()},
        "claims": [claim.record() for claim in (_claims(runs) if whole else CLAIMS)],
    }


def _row(runs: list[Run]) -> dict[str, Any]:
    touched = [float((run.touching >= 0).mean()) for run in runs]
    return {
        "seeds": len(runs),
        "actions": len(runs[0].seen),
        "unreached": interquartile_mean([len(run.unreached) for run in runs]),
        "end_elsewhere": interquartile_mean([1.0 - run.succeeded.mean() for run in runs]),
        "uncertain_actions": interquartile_mean([run.uncertain for run in runs]),
        "most_outcomes": max(int(outcome_counts(run.space, run.seen).max()) for run in runs),
        "touch_self": interquartile_mean(touched),
        "deepest_mm": 1e3 * max(float(run.depths.max()) for run in runs),
    }


def _shares(runs: list[Run]) -> dict[str, str]:
    """In how many runs each state was never reached, those of one frequency together."""
    counted = Counter(state for run in runs for state in run.unreached)
    by_count: dict[int, list[int]] = {}
    for state, count in sorted(counted.items()):
        by_count.setdefault(count, []).append(state)
    return {f"in {count} of {len(runs)} runs": " ".join(map(str, states)) for count, states in sorted(by_count.items(), reverse=True)}


def _ends(runs: Sequence[Run], source: int, goal: int) -> dict[str, float]:
    """Where an action ends and how often in a run, on average."""
    counted: Counter[int] = Counter()
    for run in runs:
        counted.update(ends_of(run.space, run.seen, source, goal))
    return {str(state): count / len(runs) for state, count in counted.most_common()}


def contacts_by_pair(runs: Sequence[Run]) -> dict[str, dict[str, float]]:
    """For each pair of links: how many actions of a run touched with it, the deepest overlap, and which share reached their goal."""
    table: dict[str, dict[str, float]] = {}
    for pair in sorted({pair for run in runs for pair in run.pairs}):
        mine = [(run, run.touching == run.pairs.index(pair)) for run in runs if pair in run.pairs]
        actions = sum(int(touched.sum()) for _, touched in mine)
        table[pair] = {
            "actions": actions / len(runs),
            "deepest_mm": 1e3 * max(float(run.depths[touched].max(initial=0.0)) for run, touched in mine),
            "succeed": sum(int(run.succeeded[touched].sum()) for run, touched in mine) / actions,
        }
    return dict(sorted(table.items(), key=lambda item: -item[1]["actions"]))


def _claims(runs: Mapping[str, list[Run]]) -> list[Claim]:
    small, stretched = runs["small"], runs["stretched"]
    never = sum(set(NEVER) <= set(run.unreached) for run in small)
    too = [state for state, count in Counter(s for run in small for s in run.unreached).items() if state not in NEVER]
    also = f"; in some also {', '.join(map(str, sorted(too)))}" if too else ""
    return [
        UNREACHED.measured(f"all four unreached in {never} of {len(small)} runs{also}", never == len(small)),
        _rare(small),
        _turned(small),
        RANDOM.measured(
            f"{told([run.uncertain for run in small], 0)} actions (stretched {told([run.uncertain for run in stretched], 0)}) "
            "fail in 10 to 90 % of their tries",
            interval([run.uncertain for run in small])[0] >= 1.0,
        ),
        _stretch(small, stretched),
        *_self_contacts(small, stretched),
    ]


def _rare(small: list[Run]) -> Claim:
    visits = np.array([run.visits[list(HARDLY)] for run in small])
    others = min(int(np.delete(run.visits, (*NEVER, *HARDLY)).min()) for run in small)
    text = f"{told(visits.ravel(), 1)} times each, at most {visits.max()}; every other state at least {others} times"
    return RARE.measured(text, bool(visits.max() <= MOST_VISITS))


def _turned(small: list[Run]) -> Claim:
    parts, holds = [], True
    for (source, goal), end in ASIDE.items():
        ends = [ends_of(run.space, run.seen, source, goal) for run in small]
        aside = [found.get(end, 0) for found in ends]
        others = [sum(found.values()) - found.get(end, 0) for found in ends]
        parts.append(f"{source}->{goal}: {told(aside, 0)} times, and {np.mean(others):.1f} (at most {max(others)}) elsewhere")
        holds = holds and min(aside) >= LEAST_ASIDE and max(others) <= HANDFUL
    return TURNED.measured("; ".join(parts), holds)


def _stretch(small: list[Run], stretched: list[Run]) -> Claim:
    few, many = [len(run.unreached) for run in small], [len(run.unreached) for run in stretched]
    always = sorted(set.intersection(*(set(run.unreached) for run in stretched)))
    text = f"{told(many, 0)} against {told(few, 0)}; in every run {' '.join(map(str, always))}"
    return STRETCH.measured(text, interval(many)[0] > 2.0 * interval(few)[1])


def _self_contacts(small: list[Run], stretched: list[Run]) -> list[Claim]:
    shares = {name: [float((run.touching >= 0).mean()) for run in runs] for name, runs in (("20-80 %", small), ("stretched", stretched))}
    text = ", ".join(f"{name}: {told([100.0 * share for share in mine], 1)} % of the actions" for name, mine in shares.items())
    few, many = interval(shares["20-80 %"]), interval(shares["stretched"])
    reached = [float(run.succeeded[run.touching >= 0].mean()) for run in stretched if (run.touching >= 0).any()]
    said = f"stretched: {told([100.0 * share for share in reached], 0)} % of these actions reach their goal" if reached else "no contact"
    return [
        CONTACTS.measured(text, min(few[0], many[0]) > MANY),
        MORE.measured(text, many[0] > 2.0 * few[1]),
        DESPITE.measured(said, bool(reached) and interval(reached)[0] > 0.0),
    ]
