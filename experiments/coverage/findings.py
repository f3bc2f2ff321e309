"""What the coverage runs say about the claims."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from experiments.kit.cells import CellResult
from experiments.kit.claims import Claim
from experiments.kit.statistics import decides, interquartile_mean, interval, probability_of_improvement, ratio, ratio_interval
from mobee.robot.robot import Array

EARLY = 220  # transitions, before which the published figure shows no difference in actions
ABOUT_HALF = (0.4, 0.6)
FLOORS = {"free": 1.05, "constrained": 1.08}  # times the postman's walk
SLACK = 0.01  # of nearest-untried

_WHERE = "paper 3.1, fig. 4; thesis 7.2.1, fig. 7.5"
RATIO = {
    world: Claim(_WHERE, f"AC has tried every action in about half the time of LT ({text})", "about 1/2")
    for world, text in (("constrained", "16 nearest, cable rows and self-contacts"), ("free", "16 nearest, nothing in the way"))
}
BEST = Claim(_WHERE, "AC produces, by far, the best explorer of AC, LT and RAND", "figure only")
NOVEL = Claim(_WHERE, "early on AC and LT try only novel actions, RAND repeats", "up to about 220 transitions")
AGGRESSIVE = Claim(_WHERE, f"before {EARLY} transitions AC visits novel states more aggressively than LT", "figure only")
FLOOR = {
    world: Claim("aim of this reproduction", f"AC needs at most {most} x the Chinese postman's walk ({world})", f"at most {most}")
    for world, most in FLOORS.items()
}
DEPLETES = Claim("aim of this reproduction", "curiosity that depletes along its plan covers no worse than nearest-untried", "at most 1.01")
CLAIMS = (*RATIO.values(), BEST, NOVEL, AGGRESSIVE, *FLOOR.values(), DEPLETES)

Groups = dict[tuple[str, str, str], list[dict[str, Any]]]  # (graph, world, explorer) -> values of the seeds


def groups(found: Mapping[str, CellResult]) -> Groups:
    """The values of the cells that differ in nothing but the seed."""
    grouped: Groups = {}
    for result in found.values():
        settings = result.cell.settings
        key = settings["graph"], settings["world"], settings["explorer"]
        grouped.setdefault(key, []).append(result.values)
    return grouped


def findings(found: Mapping[str, CellResult]) -> dict[str, Any]:
    """A table of all runs, and the claims about the published graph."""
    grouped = groups(found)
    results: dict[str, Any] = {"runs": {" ".join(key): _row(values) for key, values in sorted(grouped.items())}}
    published = {key[1:]: values for key, values in grouped.items() if key[0] == "nearest"}
    if published:
        results["claims"] = [claim.record() for claim in _claims(published)]
    return results


def covered(values: list[dict[str, Any]]) -> Array:
    """Transitions until everything was tried, one a seed; those that were made, if it never was."""
    return np.array([one["transitions"] for one in values], dtype=np.float64)


def unfinished(values: list[dict[str, Any]]) -> int:
    """How many runs ended before everything was tried."""
    return sum(len(one["new_actions"]) < one["state_actions"] for one in values)


def first_repeat(one: Mapping[str, Any]) -> int:
    """The first transition whose action had been tried before, counted from 1."""
    new = one["new_actions"]
    gaps = np.flatnonzero(new != np.arange(1, len(new) + 1))
    return int(gaps[0]) + 1 if len(gaps) else len(new) + 1


def states_seen(one: Mapping[str, Any], transitions: int) -> int:
    """How many states had been visited by then."""
    return int((one["new_states"] <= transitions).sum())


def _row(values: list[dict[str, Any]]) -> dict[str, Any]:
    times = covered(values)
    low, high = interval(times)
    return {
        "seeds": len(values),
        "unfinished": unfinished(values),
        "transitions": round(interquartile_mean(times)),
        "low": round(low),
        "high": round(high),
        "times_the_floor": interquartile_mean([t / one["floor"] for t, one in zip(times, values, strict=True)]),
        "first_repeat": interquartile_mean([first_repeat(one) for one in values]),
        f"states_at_{EARLY}": interquartile_mean([states_seen(one, EARLY) for one in values]),
        "failed": interquartile_mean([one["failed"] for one in values]),
    }


def _claims(published: Mapping[tuple[str, str], list[dict[str, Any]]]) -> list[Claim]:
    times = {key: covered(values) for key, values in published.items()}
    claims = []
    for world, claim in RATIO.items():
        curious, least = times[world, "curious"], times[world, "least_tried"]
        low, high = ratio_interval(curious, least)
        text = _number(ratio(curious, least), low, high) + (", better than published" if high < ABOUT_HALF[0] else "")
        claims.append(claim.measured(text, decides((low, high), *ABOUT_HALF)))
    claims += [_best(times, published), _novel(published), _aggressive(published)]
    for world, claim in FLOOR.items():
        shares = times[world, "curious"] / [one["floor"] for one in published[world, "curious"]]
        low, high = interval(shares)
        claims.append(claim.measured(_number(interquartile_mean(shares), low, high, digits=3), decides((low, high), most=FLOORS[world])))
    return [*claims, _depletes(times)]


def _best(times: Mapping[tuple[str, str], Array], published: Mapping[tuple[str, str], list[dict[str, Any]]]) -> Claim:
    worst = min(
        probability_of_improvement(times[world, rival], times[world, "curious"]) for world in FLOORS for rival in ("least_tried", "random")
    )
    by_random = ratio(times["constrained", "curious"], times["constrained", "random"])
    bound = "at most " if unfinished(published["constrained", "random"]) else ""
    return BEST.measured(f"probability that AC is sooner at least {worst:.2f}; AC/RAND {bound}{by_random:.2f}", worst > 0.95)


def _novel(published: Mapping[tuple[str, str], list[dict[str, Any]]]) -> Claim:
    repeats = {name: [first_repeat(one) for one in published["constrained", name]] for name in ("curious", "least_tried", "random")}
    said = {name: _number(interquartile_mean(values), *interval(values), digits=0) for name, values in repeats.items()}
    holds = all(interval(repeats[name])[0] >= EARLY for name in ("curious", "least_tried")) and interval(repeats["random"])[1] < EARLY
    text = f"first repeat at AC {said['curious']}, LT {said['least_tried']}, RAND {said['random']} transitions"
    return NOVEL.measured(text, holds)


def _aggressive(published: Mapping[tuple[str, str], list[dict[str, Any]]]) -> Claim:
    seen = {name: [states_seen(one, EARLY) for one in published["constrained", name]] for name in ("curious", "least_tried")}
    text = ", ".join(
        f"{label} {_number(interquartile_mean(seen[name]), *interval(seen[name]), digits=1)}"
        for label, name in (("AC", "curious"), ("LT", "least_tried"))
    )
    better = interval(seen["curious"])[0] > interval(seen["least_tried"])[1]
    return AGGRESSIVE.measured(f"states of 81 seen at {EARLY}: {text}", better)


def _depletes(times: Mapping[tuple[str, str], Array]) -> Claim:
    parts, intervals = [], []
    for world in FLOORS:
        ours, theirs = times.get((world, "depleting")), times.get((world, "nearest_untried"))
        if ours is None or theirs is None:  # not run in this world
            return DEPLETES
        intervals.append(ratio_interval(ours, theirs))
        parts.append(f"{_number(ratio(ours, theirs), *intervals[-1], digits=3)} {world}")
    return DEPLETES.measured(", ".join(parts), _at_most(1.0 + SLACK, intervals))


def _at_most(bound: float, intervals: list[tuple[float, float]]) -> bool | None:
    """Whether all are below the bound, or one is above it; None where an interval does not decide."""
    each = [decides(span, most=bound) for span in intervals]
    return False if False in each else None if None in each else True


def _number(value: float, low: float, high: float, digits: int = 2) -> str:
    return f"{value:.{digits}f} [{low:.{digits}f}, {high:.{digits}f}]"
