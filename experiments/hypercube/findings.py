"""What the hypercube runs say about the claims."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from experiments.kit.cells import CellResult
from experiments.kit.claims import Claim
from experiments.kit.statistics import interquartile_mean, interval, told
from mobee.robot.robot import Array

DISCOUNTS = (0.5, 0.9, 0.99)
EARLY, LEAST = 50, 5  # transitions, tries
PUBLISHED = 320
ALIKE = (0.5, 2.0)  # times the variance of a uniform choice: like it

SUCCEED = Claim("thesis 7.1", "all actions of the hypercube bring the agent to their goal state", "all")
ACTIONS = Claim("thesis 7.1, fig. 7.3", "every state-action has been tried at least 5 times after 320 actions", "320 (= 64 x 5)")
UNIFORM = Claim(
    "thesis 7.1, figs. 7.2, 7.3", "action selection is noisy like uniform sampling early, and becomes increasingly uniform", "figures only"
)
FLAT = Claim("thesis 7.1, figs. 7.2, 7.3", "the value function becomes uniform", "figures only")
PROPORTIONAL = Claim("thesis 7.1, figs. 7.2, 7.3", "value is roughly proportional to the discount factor", "figures only")
CLAIMS = (SUCCEED, ACTIONS, UNIFORM, FLAT, PROPORTIONAL)

Groups = dict[float, list[dict[str, Any]]]  # discount -> values of the seeds


def groups(found: Mapping[str, CellResult]) -> Groups:
    """The values of the cells of each discount."""
    grouped: Groups = {}
    for result in sorted(found.values(), key=lambda result: (result.cell.settings["discount"], result.cell.seed)):
        grouped.setdefault(result.cell.settings["discount"], []).append(result.values)
    return grouped


def findings(found: Mapping[str, CellResult]) -> dict[str, Any]:
    """A row a discount, and the claims."""
    grouped = groups(found)
    rows = {f"discount {discount:g}": _row(discount, values) for discount, values in grouped.items()}
    claims = [_succeed(grouped), _actions(grouped), _uniform(grouped), _flat(grouped), _proportional(grouped)]
    return {"runs": rows, "claims": [claim.record() for claim in claims]}


def dispersion(tries: Array) -> float:
    """Variance of tries over what a uniformly random choice of state-actions has: 1 like random, 0 all equal."""
    count, total = tries.size, tries.sum()
    return float(tries.var() / (total / count * (1.0 - 1.0 / count)))


def _row(discount: float, values: list[dict[str, Any]]) -> dict[str, Any]:
    actions, once = [one["transitions"] for one in values], [one["all_once"] or one["transitions"] for one in values]
    low, high = interval(actions)
    return {
        "seeds": len(values),
        "actions": interquartile_mean(actions),
        "low": low,
        "high": high,
        "all_once": interquartile_mean(once),
        "spread_early": interquartile_mean([dispersion(one["early_tries"]) for one in values]),
        "spread_end": interquartile_mean([dispersion(one["tries"]) for one in values]),
        "uneven_value": interquartile_mean([_spread(one["values"]) for one in values]),
        "value_of_limit": interquartile_mean([_share(discount, one) for one in values]),
        "value": interquartile_mean([float(one["values"].mean()) for one in values]),
        "failed": sum(one["failed"] for one in values),
    }


def _spread(values: Array) -> float:
    return float(values.std() / values.mean())


def _share(discount: float, one: Mapping[str, Any]) -> float:
    """1 where the value is that of earning the mean reward for ever."""
    return float(one["values"].mean() * (1.0 - discount) / one["rewards"].mean())


def _succeed(grouped: Groups) -> Claim:
    failed = sum(one["failed"] for values in grouped.values() for one in values)
    total = sum(one["transitions"] for values in grouped.values() for one in values)
    return SUCCEED.measured(f"{total - failed} of {total}", failed == 0)


def _actions(grouped: Groups) -> Claim:
    parts, ends = [], []
    for discount, values in grouped.items():
        actions = [one["transitions"] for one in values]
        parts.append(f"{told(actions, 0)} at discount {discount:g}")
        ends.append(interval(actions)[1])
    return ACTIONS.measured("; ".join(parts), all(high <= 1.05 * PUBLISHED for high in ends))


def _uniform(grouped: Groups) -> Claim:
    early = [dispersion(one["early_tries"]) for values in grouped.values() for one in values]
    end = [dispersion(one["tries"]) for values in grouped.values() for one in values]
    spans = [interval(early), interval(end)]
    text = f"variance of tries over a uniform choice's: {told(early)} after {EARLY}, {told(end)} at the end"
    return UNIFORM.measured(text, ALIKE[0] <= spans[0][0] and spans[0][1] <= ALIKE[1] and spans[1][1] < spans[0][0])


def _flat(grouped: Groups) -> Claim:
    early = max(_spread(one["early_values"]) for values in grouped.values() for one in values)
    end = max(_spread(one["values"]) for values in grouped.values() for one in values)
    return FLAT.measured(f"standard deviation / mean at most {early:.2f} after {EARLY}, {end:.3f} at the end", end < min(0.1, early))


def _proportional(grouped: Groups) -> Claim:
    """In the limit it is the mean reward / (1 - discount), which grows much faster than the discount."""
    means = {discount: interquartile_mean([float(one["values"].mean()) for one in values]) for discount, values in grouped.items()}
    shares = [interquartile_mean([_share(discount, one) for one in values]) for discount, values in grouped.items()]
    of_limit = " to ".join(dict.fromkeys(f"{share:.2f}" for share in (min(shares), max(shares))))
    low, high = min(means), max(means)
    grown = means[high] / means[low]
    text = (
        f"mean value {', '.join(f'{1e3 * value:.3g}' for value in means.values())} x 1e-3 nats at {', '.join(f'{d:g}' for d in means)}: "
        f"{of_limit} of mean reward / (1 - discount), proportional to that"
    )
    return PROPORTIONAL.measured(text, abs(grown / (high / low) - 1.0) < 0.5)
