"""What the runs at the table say about the claims."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from experiments.kit.cells import CellResult
from experiments.kit.claims import Claim
from experiments.kit.statistics import interquartile_mean, interval, told
from experiments.table.cycles import at_second_peak, correlations, is_cyclic, second_peak
from experiments.table.dependence import LEARNERS, SCORES, judged
from experiments.table.interest import agreement, by_goal, of_arms, share_of_top
from experiments.table.runs import ARMS, EXPLORERS, PARTS, TRANSITIONS, WINDOW, Key, Run, low, runs_of, spaces, with_ghosts

HANDFUL = 5  # states
SIMILAR = 0.3  # rank correlation
DAYS = (1.0, 3.0)  # of the plant's time, for "a little more than two"

PAPER = "paper 3.2, thesis 7.4"
TOUCH = Claim(PAPER, "the agents begin to touch the table frequently: share of arm actions, second half", "qualitative")
GROWS = Claim(PAPER, "this emerges over time: touch rate of the last third less that of the first", "qualitative")
FORWARD = Claim("paper 3.2, fig. 10", "the torso's most frequent actions lean forward: tries over the others', second half", "qualitative")
LOW = Claim("paper 3.2, fig. 10", "the arms' most frequent actions put the arm low: tries over the others', second half", "qualitative")
SIMILAR_ARMS = Claim(
    "paper 3.2, fig. 10", "the two arms choose very similar actions: rank correlation of tries beside the ghost's, by goal", "qualitative"
)
CYCLES = Claim(
    PAPER,
    "periods of exploring, of static constraints and of touching come in a cyclic manner: second peak of the touch rate's autocorrelation",
    "cyclic",
)
RICHER = Claim("paper fig. 9, thesis 7.4", "outcomes are richer than by static constraints: actions with 3 or more", "qualitative")
FEW = Claim("thesis 6.4", "never more than a handful of outcomes (5) an action", "a handful")
DETECTOR = Claim(
    "paper 4.4",
    "the most tried actions are those that interact with other parts: precision and recall, beside the ghost's tries",
    "qualitative",
)
TIME = Claim("paper 3.2", "18 000 transitions take so many days of the robot's time", "a little more than 2")
CLAIMS = (TOUCH, GROWS, FORWARD, LOW, SIMILAR_ARMS, CYCLES, RICHER, FEW, DETECTOR, TIME)

Runs = dict[Key, list[Run]]
Number = Callable[[Run], float]


def findings(found: Mapping[str, CellResult]) -> dict[str, Any]:
    """A row a condition, interest beside the ghost, the detector; and the claims as far as their conditions were run in full."""
    runs = runs_of(found)
    whole = all(runs.get(("tree", explorer, world)) for explorer in EXPLORERS for world in ("table", "ghost"))
    whole = whole and len(next(iter(runs.values()))[0].seen["torso"]) >= TRANSITIONS
    return {
        "conditions": {", ".join(key): _row(mine) for key, mine in runs.items()},
        "beside the ghost": {
            f"{way}, {explorer}": _interest(pairs)
            for way in ("tree", "part")
            for explorer in EXPLORERS
            if (pairs := with_ghosts(runs, way, explorer))
        },
        "outcomes an action": {", ".join(key): _histogram(mine) for key, mine in runs.items()},
        "detector": detector(runs),
        "claims": [claim.record() for claim in (_claims(runs) if whole else CLAIMS)],
    }


def _mean(runs: Sequence[Run], number: Number) -> float:
    return interquartile_mean([number(run) for run in runs])


def _row(runs: list[Run]) -> dict[str, float]:
    return {
        "seeds": len(runs),
        "touch": _mean(runs, lambda run: run.touch),
        "growth": _mean(runs, lambda run: run.growth),
        "torso_forward": _mean(runs, lambda run: run.torso_forward),
        "low_and_forward": _mean(runs, lambda run: run.low_and_forward),
        "arms_low": _mean(runs, lambda run: run.arms_low),
        "half_failing": _mean(runs, lambda run: run.half_failing),
        "timeouts_torso": _mean(runs, lambda run: run.timeouts["torso"]),
        "timeouts_arms": _mean(runs, lambda run: 0.5 * sum(run.timeouts[arm] for arm in ARMS)),
        "hours": _mean(runs, lambda run: run.hours),
        "seconds": _mean(runs, lambda run: run.result.seconds),
    }


def _interest(pairs: Sequence[tuple[Run, Run]]) -> dict[str, float]:
    ratios = [of_arms(*pair) for pair in pairs]
    aims_low = low()[spaces()[ARMS[0]].goals]
    return {
        "rho_actions": interquartile_mean([agreement(ratio) for ratio in ratios]),
        "rho_goals": interquartile_mean([agreement(by_goal(ratio)) for ratio in ratios]),
        "low_of_top_5_percent": interquartile_mean([share_of_top(ratio, aims_low) for ratio in ratios]),
        "low_of_all": float(aims_low.mean()),
        "rho_raw": interquartile_mean([agreement(np.array([run.tries[arm] for arm in ARMS])) for run, _ in pairs]),
    }


def outcome_numbers(run: Run) -> NDArray[np.intp]:
    """In how many states the actions ended that were tried, of all parts together."""
    every = np.concatenate([run.outcomes[part].ravel() for part in PARTS])
    tried: NDArray[np.intp] = every[every > 0]
    return tried


def _histogram(runs: Sequence[Run]) -> dict[str, float]:
    """How many actions of a run ended in so many states."""
    most = max(int(outcome_numbers(run).max()) for run in runs)
    counts = np.mean([np.bincount(outcome_numbers(run), minlength=most + 1) for run in runs], axis=0)
    return {str(number): float(counts[number]) for number in range(1, most + 1)}


def detector(runs: dict[Key, list[Run]]) -> dict[str, dict[str, float]]:
    """Precision, equal to recall, when as many actions are called dependent as are; and the share of these, which chance gives."""
    table: dict[str, dict[str, float]] = {}
    for learner in LEARNERS:
        for explorer in EXPLORERS:
            found = {score: judged(runs, explorer, learner, score) for score in SCORES}
            if all(found.values()):
                table[f"{learner}, {explorer}"] = {
                    **{score: interquartile_mean([one.at_all for one in mine]) for score, mine in found.items()},
                    "chance": interquartile_mean([one.chance for one in found["tries"]]),
                }
    return table


def _claims(runs: Runs) -> list[Claim]:
    curious = runs["tree", "curious", "table"]
    return [
        _against(TOUCH, runs, lambda run: run.touch),
        _against(GROWS, runs, lambda run: run.growth, least=0.0),
        _against(FORWARD, runs, lambda run: run.torso_forward),
        _against(LOW, runs, lambda run: run.arms_low),
        _similar(runs),
        _cycles(runs),
        _against(RICHER, runs, lambda run: float((outcome_numbers(run) >= 3).sum()), 0),
        FEW.measured(_most(curious), max(int(outcome_numbers(run).max()) for run in curious) <= HANDFUL),
        _detects(runs),
        TIME.measured(
            f"{told([run.hours / 24.0 for run in curious])} days; computed in {told([run.result.seconds for run in curious], 0)} s",
            DAYS[0] <= _mean(curious, lambda run: run.hours / 24.0) <= DAYS[1],
        ),
    ]


def _against(claim: Claim, runs: Runs, number: Number, digits: int = 2, least: float = -np.inf) -> Claim:
    """The curious agents at the table stand out from all the controls, and are above `least`."""
    values = {key[1:]: [number(run) for run in mine] for key, mine in runs.items() if key[0] == "tree"}
    text = ", ".join(f"{explorer} at the {world} {told(mine, digits)}" for (explorer, world), mine in values.items())
    ours = interval(values["curious", "table"])[0]
    controls = (interval(mine)[1] for key, mine in values.items() if key != ("curious", "table"))
    return claim.measured(text, ours > max(least, *controls))


def _similar(runs: Runs) -> Claim:
    found = {e: [agreement(by_goal(of_arms(*pair))) for pair in with_ghosts(runs, "tree", e)] for e in EXPLORERS}
    text = ", ".join(f"{explorer} {told(values)}" for explorer, values in found.items())
    ours = interval(found["curious"])[0]
    return SIMILAR_ARMS.measured(text, ours > SIMILAR and all(ours > interval(found[e])[1] for e in EXPLORERS[1:]))


def _cycles(runs: Runs) -> Claim:
    pairs = with_ghosts(runs, "tree", "curious")
    if len(pairs) < 2:
        return CYCLES.measured("needs two seeds", None)
    ours, theirs = (correlations([pair[which] for pair in pairs]) for which in (0, 1))
    here, there = at_second_peak(ours, theirs)
    text = (
        f"around a lag of {WINDOW * second_peak(ours)} transitions {told(here)}, at the ghost {told(there)}; touching comes in bouts: "
        f"{told(ours[:, 1])} at {WINDOW}, at the ghost {told(theirs[:, 1])}"
    )
    return CYCLES.measured(text, is_cyclic(ours, theirs))


def _most(curious: list[Run]) -> str:
    most = [int(outcome_numbers(run).max()) for run in curious]
    many = [float((outcome_numbers(run) > HANDFUL).mean()) for run in curious]
    return f"at most {max(most)}; {100.0 * interquartile_mean(many):.2f} % of the actions have more than {HANDFUL}"


def _detects(runs: Runs) -> Claim:
    parts, holds = [], True
    for learner in LEARNERS:
        hits = {explorer: judged(runs, explorer, learner, "beside_ghost") for explorer in EXPLORERS}
        if not all(hits.values()):
            alone = len({run.seed for mine in runs.values() for run in mine}) == 1
            return DETECTOR.measured("needs two seeds" if alone else f"{learner}: no action depends on other parts", None)
        values = {explorer: [one.at_all for one in mine] for explorer, mine in hits.items()}
        chance = interquartile_mean([one.chance for one in hits["curious"]])
        parts.append(f"{learner}: " + ", ".join(f"{explorer} {told(mine)}" for explorer, mine in values.items()) + f", chance {chance:.2f}")
        least = interval(values["curious"])[0]
        holds = holds and least > 2.0 * chance and all(least > interval(values[explorer])[1] for explorer in EXPLORERS[1:])
    return DETECTOR.measured("; ".join(parts), holds)
