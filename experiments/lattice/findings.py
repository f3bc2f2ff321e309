"""What the lattice runs say about the claims."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from scipy.stats import spearmanr

from experiments.kit.cells import CellResult
from experiments.kit.claims import Claim
from experiments.kit.statistics import decides, interquartile_mean, interval, ratio_interval, told
from experiments.lattice.groups import ENTERING, FAILING, HARD, Key, Run, groups

DISCOUNTS = (0.5, 0.9, 0.99)
INITIAL = ("50-50", "60-40")
LEAST = 5  # tries
PUBLISHED = {"50-50": 2987, "60-40": 2651}
TOLERANCE = 0.1  # of a published number of actions
SOMETIMES = (0.1, 0.9)  # shares of failures between which an action neither works nor fails

NUMBERS = {
    initial: Claim(
        f"thesis 7.2.2, fig. {figure}", f"{initial}: every state-action tried 5 times after so many actions, within 10 %", f"{actions}"
    )
    for (initial, actions), figure in zip(PUBLISHED.items(), ("7.6", "7.7"), strict=True)
}
SOONER = Claim("thesis 7.2.2, figs. 7.6, 7.7", "60-40 takes fewer actions than 50-50: their ratio", "0.89 (2651 / 2987)")
LEAST_VISITED = Claim("thesis 7.2.5", "the least visited states are 24, 51 and 78", "those three")
FAIL = Claim("thesis 7.2.5, fig. 7.4", "the actions 15->24, 42->51 and 69->78 fail: share of failures", "infeasible")
ENTER = Claim("thesis 7.2.5", "other actions into the same states, as 21->24, succeed", "succeed")
SPIKES = Claim(
    "thesis 7.2.5, fig. 7.6", "50-50: the actions that do enter them are tried more than others, the more the larger the discount", "spikes"
)
DIPS = Claim(
    "thesis 7.2.5, fig. 7.6", "50-50: tries of actions from 24, 51, 78 are below the average, the less the larger the discount", "dips"
)
PEAKS = Claim(
    "thesis 7.2.5, fig. 7.7", "60-40: the failing actions into 24, 51, 78 stand out in tries at every discount", "peaks at 80, 230, 378"
)
DEGREE = Claim("thesis 7.2.3", "states are visited the more often the more actions lead into them", "qualitative")
UNIFORM = Claim("thesis 7.2.4", "tries over state-actions are fairly uniform, more so than visits over states", "qualitative")
STOCHASTIC = Claim(
    "thesis 7.2.5", "static constraints make outcomes uncertain: some actions sometimes fail and sometimes succeed", "qualitative"
)
CLAIMS = (*NUMBERS.values(), SOONER, LEAST_VISITED, FAIL, ENTER, SPIKES, DIPS, PEAKS, DEGREE, UNIFORM, STOCHASTIC)

Groups = Mapping[Key, list[Run]]


def findings(found: Mapping[str, CellResult]) -> dict[str, Any]:
    """A row a setting, and the claims as far as their settings were run."""
    grouped = groups(found)
    rows = {f"{initial}, discount {discount:g}": _row(runs) for (initial, discount), runs in grouped.items()}
    return {"runs": rows, "claims": [claim.record() for claim in _claims(grouped)]}


def _claims(grouped: Groups) -> list[Claim]:
    missing = [(i, d) for i in INITIAL for d in DISCOUNTS if not grouped.get((i, d))]
    if missing:
        return list(CLAIMS)
    every = [run for runs in grouped.values() for run in runs]
    return [
        *(_number(grouped, initial) for initial in INITIAL),
        _sooner(grouped),
        _least_visited(every),
        _share(FAIL, every, FAILING, lambda low, high: low > 0.5),
        _share(ENTER, every, ENTERING, lambda low, high: high < 0.1),
        _by_discount(SPIKES, grouped, ENTERING, lambda low, high: low > 1.0),
        _by_discount(DIPS, grouped, None, lambda low, high: high < 1.0),
        _peaks(grouped),
        _degree(every),
        _uniform(every),
        _stochastic(every),
    ]


def _row(runs: list[Run]) -> dict[str, Any]:
    actions = [run.transitions for run in runs]
    low, high = interval(actions)
    return {
        "seeds": len(runs),
        "actions": interquartile_mean(actions),
        "low": low,
        "high": high,
        "hard_visits": _mean(runs, lambda run: float(run.visits[list(HARD)].mean() / run.visits.mean())),
        "hard_tries": _mean(runs, lambda run: run.relative_tries(run.out_of_hard)),
        "failing_tries": _mean(runs, lambda run: run.relative_tries(FAILING)),
        "entering_tries": _mean(runs, lambda run: run.relative_tries(ENTERING)),
        "failing_fail": _mean(runs, lambda run: run.share_failed(FAILING)),
        "entering_fail": _mean(runs, lambda run: run.share_failed(ENTERING)),
        "value": _mean(runs, lambda run: float(run.values[run.exists].mean())),
    }


def _mean(runs: list[Run], number: Callable[[Run], float]) -> float:
    return interquartile_mean([number(run) for run in runs])


def _actions(grouped: Groups, initial: str) -> list[float]:
    return [float(run.transitions) for discount in DISCOUNTS for run in grouped[initial, discount]]


def _number(grouped: Groups, initial: str) -> Claim:
    parts = []
    for discount in DISCOUNTS:
        parts.append(f"{told([float(run.transitions) for run in grouped[initial, discount]], 0)} at discount {discount:g}")
    strata = [discount for discount in DISCOUNTS for _ in grouped[initial, discount]]
    span = interval(_actions(grouped, initial), strata=strata)
    least, most = PUBLISHED[initial] * (1.0 - TOLERANCE), PUBLISHED[initial] * (1.0 + TOLERANCE)
    return NUMBERS[initial].measured("; ".join(parts), decides(span, least, most))


def _sooner(grouped: Groups) -> Claim:
    optimistic, even = _actions(grouped, "60-40"), _actions(grouped, "50-50")
    low, high = ratio_interval(optimistic, even)
    return SOONER.measured(f"{interquartile_mean(optimistic) / interquartile_mean(even):.2f} [{low:.2f}, {high:.2f}]", high < 1.0)


def _least_visited(every: list[Run]) -> Claim:
    hits = [len(set(np.argsort(run.visits, kind="stable")[:3].tolist()) & set(HARD)) for run in every]
    together = np.argsort(sum(run.visits for run in every), kind="stable")[:3].tolist()
    rest = [float(run.visits[list(HARD)].mean() / run.visits.mean()) for run in every]
    text = (
        f"{', '.join(map(str, sorted(together)))} in all runs together, {np.mean(hits):.1f} of the three in a run; "
        f"visits over the mean of all states {told(rest)}"
    )
    return LEAST_VISITED.measured(text, set(together) == set(HARD))


def _share(claim: Claim, every: list[Run], pairs: tuple[tuple[int, int], ...], holds: Callable[[float, float], bool]) -> Claim:
    parts, verdicts = [], []
    for pair in pairs:
        shares = [run.share_failed([pair]) for run in every]
        low, high = interval(shares)
        parts.append(f"{pair[0]}->{pair[1]} {told(shares)}")
        verdicts.append(holds(low, high))
    return claim.measured("fail " + ", ".join(parts), all(verdicts))


def _by_discount(claim: Claim, grouped: Groups, pairs: Any, stands_out: Callable[[float, float], bool]) -> Claim:
    """Whether the tries stand out at the smallest discount, and grow from each discount to the next; open where the ends do not differ."""
    parts, found = [], []
    for discount in DISCOUNTS:
        values = [run.relative_tries(pairs or run.out_of_hard) for run in grouped["50-50", discount]]
        parts.append(f"{told(values)} at discount {discount:g}")
        found.append(values)
    means = [interquartile_mean(values) for values in found]
    holds = stands_out(*interval(found[0])) and means == sorted(means)
    grows = decides(ratio_interval(found[-1], found[0]), least=1.0)
    return claim.measured("tries over the mean of all: " + ", ".join(parts), grows if holds else False)


def _peaks(grouped: Groups) -> Claim:
    parts, verdicts = [], []
    for discount in DISCOUNTS:
        values = [run.relative_tries(FAILING) for run in grouped["60-40", discount]]
        parts.append(f"{told(values)} at discount {discount:g}")
        verdicts.append(interval(values)[0] > 1.0)
    even = [run.relative_tries(FAILING) for discount in DISCOUNTS for run in grouped["50-50", discount]]
    return PEAKS.measured("tries over the mean of all: " + ", ".join(parts) + f"; 50-50: {told(even)}", all(verdicts))


def _degree(every: list[Run]) -> Claim:
    goals = every[0].space.goals
    degree = np.bincount(goals[goals >= 0], minlength=len(goals))
    correlations = [float(spearmanr(degree, run.visits).statistic) for run in every]
    return DEGREE.measured(f"rank correlation {told(correlations)}", interval(correlations)[0] > 0.5)


def _uniform(every: list[Run]) -> Claim:
    tries = [float(run.tries[run.exists].std() / run.tries[run.exists].mean()) for run in every]
    visits = [float(run.visits.std() / run.visits.mean()) for run in every]
    text = f"standard deviation over mean: tries {told(tries)}, visits {told(visits)}"
    return UNIFORM.measured(text, decides(ratio_interval(tries, visits), most=1.0))


def _stochastic(every: list[Run]) -> Claim:
    counts = []
    for run in every:
        share = run.failures[run.exists] / run.tries[run.exists]
        counts.append(float(((share > SOMETIMES[0]) & (share < SOMETIMES[1])).sum()))
    text = f"{told(counts, 1)} of 432 actions a run fail in 10 to 90 % of their tries"
    return STOCHASTIC.measured(text, interval(counts)[0] >= 1.0)
