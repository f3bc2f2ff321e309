"""What the runs say about the claims."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np

from experiments.kit.cells import CellResult
from experiments.kit.claims import Claim
from experiments.kit.statistics import decides, interquartile_mean, interval, told
from experiments.kit.verdicts import all_hold, better, changes, published_ratio, rises
from experiments.reach.runs import STRATEGIES, Runs, runs_of

RIVALS = STRATEGIES[1:]
JUDGED = (800, 1600, 3200, 6400)  # problem-tries at which intrinsic motivation is compared
HOURS = {"random": 207.0, "greedy": 109.0, "intrinsic": 113.0}  # published, of 5 runs
TWICE, SAME = (1.5, 2.5), (0.8, 1.2)  # "about twice", and as long as
NEARLY_ALL = 0.9  # "almost all possible combinations"
MINUTES, CORES, RUNS = 10.0, 2, 5

_SCORES, _CHOICES = "thesis 8.4.1, fig. 8.2", "thesis 8.4.2, figs. 8.4-8.6"
BETTER = {
    look: Claim(
        _SCORES,
        f"after {look} problem-tries intrinsic motivation has made a more competent agent than greedy and random exploration",
        "significantly more competent after about 800",
    )
    for look in JUDGED
}
WEAK = Claim(_SCORES, "the intrinsically motivated agent is less competent than the others after 100 problem-tries", "figure only")
STEADY = Claim(_SCORES, "it improves steadily, from 100 to 3200 problem-tries", "figure only")
FALLS = Claim(
    "our prototype of thesis 8.4",
    "it falls back from 3200 to 6400 problem-tries, as negative rewards spread over all targets",
    "6.5 of 7.9",
)
DECREASES = Claim("thesis 8.4.2", "the randomly exploring agent's score decreases from 100 to 400 problem-tries", "figure only")
AGREE = Claim(
    _CHOICES, "the runs of the intrinsic agent come to agree on the states to reach from, more than those of the others", "figures only"
)
FEW = Claim(_CHOICES, "it settles on few favourite states, fewer than the others", "2 are pictured in fig. 8.3")
NAMED = ({57, 77}, {56, 76})  # what 489 and 509 of 432 + 81 state-actions are if the reaches come last, counted from 0 or from 1
THOSE = Claim(
    "thesis 8.4.3", "its two favourites are the reaches 489 and 509 of 513: 57 and 77, or 56 and 76, if reaches come last", "489 and 509"
)
HIGH = Claim(_CHOICES, "the randomly exploring agent comes to prefer states with the hand high", "figure only")
COMBINATIONS = Claim(
    "thesis 8.4.3, fig. 8.7",
    "after 3200 problem-tries the intrinsic agent has tried almost all pairs of a state and a target",
    "almost all 2187",
)
REGIONS = Claim(
    "thesis 8.4.3, fig. 8.7", "the greedy agent leaves large regions untried, more than the intrinsic one (after 1600)", "figure only"
)
LINES = Claim(
    "thesis 8.4.3, fig. 8.7",
    "from 1600 problem-tries on the greedy agent reaches nearly always from two states",
    "all its time, two red lines",
)
NEGATIVE = Claim("thesis 8.4.4, fig. 8.8", "the random explorer gets many more negative rewards than the other two", "figure only")
TIME = Claim("thesis 8.4.4", "random exploration takes about twice the robot's time of intrinsic motivation", "207 against 113 h: 1.83")
TIME_GREEDY = Claim("thesis 8.4.4", "greedy exploration takes about as long as intrinsic motivation", "109 against 113 h: 0.96")
SPEED = Claim(
    "aim of this reproduction", f"all {RUNS * 3} runs of figure 8.2 take less than {MINUTES:.0f} minutes on {CORES} cores", "429 h"
)
CLAIMS = (
    *BETTER.values(),
    WEAK,
    STEADY,
    FALLS,
    DECREASES,
    AGREE,
    FEW,
    THOSE,
    HIGH,
    COMBINATIONS,
    REGIONS,
    LINES,
    NEGATIVE,
    TIME,
    TIME_GREEDY,
    SPEED,
)


def findings(found: Mapping[str, CellResult]) -> dict[str, Any]:
    """A row a strategy, and the claims; those about problem-tries that were not made stay open."""
    runs = runs_of(found)
    results: dict[str, Any] = {"runs": {name: _row(mine) for name, mine in runs.items()}}
    if set(runs) == set(STRATEGIES):
        results["claims"] = [claim.record() for claim in judged(runs)]
    return results


def judged(runs: Mapping[str, Runs]) -> list[Claim]:
    """The claims with our numbers."""
    looks = runs["intrinsic"].looks
    if looks[-1] < JUDGED[-1]:
        return list(CLAIMS)
    return [*_scores(runs), *_choices(runs), *_exploration(runs), *_costs(runs)]


def _row(mine: Runs) -> dict[str, Any]:
    last = mine.looks[-1]
    return {
        "seeds": len(mine),
        "scores": {str(look): told(mine.scores(look)) for look in mine.looks},
        "agreement": {str(look): told(mine.agreement(look)) for look in mine.looks},
        "states_of_half_the_reaches": {str(look): told(mine.favourites(look), 1) for look in mine.looks},
        "pairs_tried": {str(look): told(mine.tried(look)) for look in mine.looks},
        "favourites": np.argsort(-mine.chosen(last).mean(axis=0))[:5].tolist(),
        "negative_rewards": told(mine.failures(), 0),
        "actions_a_try": told(mine.actions()),
        "robot_hours_of_5_runs": told(5.0 * mine.hours(), 1),
        "seconds": interquartile_mean(mine.seconds),
    }


def _scores(runs: Mapping[str, Runs]) -> list[Claim]:
    def each(look: int) -> dict[str, Any]:
        return {name: mine.scores(look) for name, mine in runs.items()}

    found = []
    for look, claim in BETTER.items():
        text, verdicts = better(each(look), "intrinsic", RIVALS)
        found.append(claim.measured(text, all_hold(verdicts)))
    text, verdicts = better(each(100), "intrinsic", RIVALS, worse=True)
    found.append(WEAK.measured(text, all_hold(verdicts)))
    mine, random = runs["intrinsic"], runs["random"]
    steps = [mine.scores(later) - mine.scores(sooner) for sooner, later in pairwise(look for look in mine.looks if look <= 3200)]
    whole = mine.scores(3200) - mine.scores(100)
    falls = [rises(step) is False for step in steps]
    text = f"{changes(mine.scores(100), mine.scores(3200))}; significant falls between looks: {sum(falls)}"
    found.append(STEADY.measured(text, all_hold([rises(whole), not any(falls)])))
    for claim, runner, (sooner, later) in ((FALLS, mine, (3200, 6400)), (DECREASES, random, (100, 400))):
        before, after = runner.scores(sooner), runner.scores(later)
        found.append(claim.measured(changes(before, after), rises(before - after)))
    return found


def _choices(runs: Mapping[str, Runs]) -> list[Claim]:
    last = {name: mine.agreement(6400) for name, mine in runs.items()}
    mine = runs["intrinsic"]
    text, verdicts = better(last, "intrinsic", RIVALS)
    grown = rises(mine.agreement(6400) - mine.agreement(100))
    agree = AGREE.measured(
        f"overlap of two runs' choices {changes(mine.agreement(100), mine.agreement(6400))}; {text}", all_hold([grown, *verdicts])
    )
    text, verdicts = better({name: one.favourites(6400) for name, one in runs.items()}, "intrinsic", RIVALS, worse=True, digits=1)
    favourite = np.argsort(-mine.chosen(6400).mean(axis=0))[:2].tolist()
    few = FEW.measured(f"states of half the reaches: {text}; the two most frequent: {favourite[0]}, {favourite[1]}", all_hold(verdicts))
    named = np.array([float(set(np.argsort(-one)[:2].tolist()) in NAMED) for one in mine.chosen(6400)])
    text = f"they are in {named.sum():.0f} of {len(named)} runs; over all runs {favourite[0]} and {favourite[1]}"
    those = THOSE.measured(text, decides(interval(named, partial(np.mean, axis=-1)), least=0.5))
    height = runs["random"].height(6400)
    return [agree, few, those, HIGH.measured(f"{told(100.0 * height, 1)} cm above the mean of all states", rises(height))]


def _exploration(runs: Mapping[str, Runs]) -> list[Claim]:
    tried, greedy = runs["intrinsic"].tried(3200), runs["greedy"].concentration(1600, 6400)
    text, verdicts = better({name: runs[name].tried(1600) for name in ("intrinsic", "greedy")}, "intrinsic", ("greedy",))
    return [
        COMBINATIONS.measured(f"{told(tried)} of them", decides(interval(tried), least=NEARLY_ALL)),
        REGIONS.measured(f"share tried: {text}", all_hold(verdicts)),
        LINES.measured(
            f"{told(greedy)} of its reaches, intrinsic {told(runs['intrinsic'].concentration(1600, 6400))}",
            decides(interval(greedy), least=NEARLY_ALL),
        ),
    ]


def _costs(runs: Mapping[str, Runs]) -> list[Claim]:
    text, verdicts = better({name: mine.failures() for name, mine in runs.items()}, "random", ("greedy", "intrinsic"), digits=0)
    negative = NEGATIVE.measured(text, all_hold(verdicts))
    hours = {name: mine.hours() for name, mine in runs.items()}
    minutes = RUNS * sum(float(np.mean(mine.seconds)) for mine in runs.values()) / CORES / 60.0
    said = ", ".join(f"{name} {told(RUNS * hours[name], 1)} h" for name in HOURS)
    return [
        negative,
        published_ratio(TIME, hours["random"], hours["intrinsic"], TWICE, f"; 5 runs: {said}"),
        published_ratio(TIME_GREEDY, hours["greedy"], hours["intrinsic"], SAME),
        SPEED.measured(
            f"{minutes:.1f} minutes: 5 times the mean run of each strategy, on {CORES} cores; without the figure", minutes < MINUTES
        ),
    ]
