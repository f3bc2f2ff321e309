"""Kail: what is gained by counting outcomes in bins of variable number instead of over all states?

Claim: with plain KL divergence from a uniform prior every first try is equally interesting, so that it takes many tries to tell
failing actions from sound ones, and small state spaces are numerically more interesting than large ones; 'Kail' divergence has
neither problem.  Source: thesis 6.4.2 and 6.4.3, eqs. 6.6 to 6.9, tables 6.1 to 6.4.  Run time: half a minute on 2 cores.

On paper: the rewards of a sound, a failing and an uncertain action, try by try.  On the robot: the left arm, 81 states with 16
neighbours and its constraints, for 4000 transitions, and the torso, 27 states with 8 neighbours, for 900; both
divergences, all runs on one graph.  Failing actions are those that fail in more than half of the tries of all runs but the judged one.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping
from functools import cache
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from experiments.kit.experiment import Claim, Experiment
from experiments.kit.learning.arm import ARM_NEIGHBOURS, DT, TORSO, arm_plant, arm_space, robot, torso_space
from experiments.kit.learning.exploration import begin_anywhere, explore
from experiments.kit.learning.outcomes import Explored, Groups, constraint_actions, explored, relative_tries_of
from experiments.kit.plots import new_figure
from experiments.kit.statistics import estimate, interval, mean_over
from experiments.kit.sweep import Cells, Condition, Sweep
from mobee import CuriousAgent, Gains, Lattice, Model, OfflinePlant, TransitionModel
from mobee.arrays import Array, Ints

DIVERGENCES = {"kail": "'Kail'", "kl": "plain KL, uniform prior"}
PARTS = {"left_arm": "arm, 81 states", "torso": "torso, 27 states"}
TRANSITIONS = {"left_arm": 4000, "torso": 900}
FEW = {"left_arm": 1000, "torso": 300}
EARLY = 100  # transitions, whose mean pay is compared between the parts
TRIES, REPEATS = 30, 400  # on paper

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


@cache
def space_of(part: str) -> Lattice:
    """81 states with 16 neighbours, or 27 with 8."""
    return torso_space() if part == "torso" else arm_space(neighbours=ARM_NEIGHBOURS)


def plant_of(part: str, seed: int) -> OfflinePlant:
    """The part's own motors, the rest of the body rigid, no objects."""
    if part == "torso":
        return OfflinePlant(Model(robot()), seed, Gains.published_2014(), dt=DT, active=TORSO)
    return arm_plant(seed)


def conditions(arguments: argparse.Namespace) -> list[Condition]:
    """Both parts with both divergences; the short version makes fewer transitions."""
    counts = FEW if arguments.quick else TRANSITIONS
    return [
        Condition(f"{part}-{divergence}-n{counts[part]}", {"part": part, "divergence": divergence, "transitions": counts[part]})
        for part, divergence in product(PARTS, DIVERGENCES)
    ]


def trial(settings: dict[str, Any], seed: int) -> dict[str, Any]:
    """Explore; the transitions (T, 3), what each of them paid (T,), and what every action promises before anything was tried."""
    part, divergence = settings["part"], settings["divergence"]
    space, plant = space_of(part), plant_of(part, seed)
    begin_anywhere(space, plant, seed)
    agent = CuriousAgent(space, plant, seed=seed, divergence=divergence)
    paid: list[float] = []
    seen = explore(agent, settings["transitions"], lambda agent: _record_pay(agent, paid))
    _record_pay(agent, paid)
    first = float(TransitionModel(space, divergence=divergence).reward.max())
    return {"seen": seen.astype(np.uint16), "paid": np.array(paid, dtype=np.float32), "first_reward": first}


def _record_pay(agent: CuriousAgent, paid: list[float]) -> bool:
    if agent.last is not None and agent.last.n > len(paid):
        paid.append(agent.last.reward)
    return False


Outcome = Callable[[np.random.Generator, int], int]  # draws the outcome of an action with this goal


def sound(rng: np.random.Generator, goal: int) -> int:
    """The goal."""
    return goal


def failing(rng: np.random.Generator, goal: int) -> int:
    """One other state."""
    return (goal + 7) % 27


def uncertain(rng: np.random.Generator, goal: int) -> int:
    """The goal or one of two other states, equally likely."""
    return (goal, (goal + 7) % 27, (goal + 11) % 27)[int(rng.integers(3))]


KINDS: dict[str, Outcome] = {"sound": sound, "failing": failing, "uncertain": uncertain}


def rewards(part: str, divergence: str, outcome: Outcome, repeats: int = REPEATS) -> Array:
    """What each of 30 tries of one action pays, (repeats, 30)."""
    space, rng = space_of(part), np.random.default_rng(0)
    goal = int(space.goals[0, 0])
    paid = np.empty((repeats, TRIES))
    for row in paid:
        model = TransitionModel(space, divergence=divergence)
        for number in range(TRIES):
            row[number] = model.observe(0, 0, outcome(rng, goal))
    return paid


def tries_to_prefer(part: str, divergence: str, kind: str) -> float:
    """After how many tries of each a greedy agent prefers the other action to a sound one, by what each paid last: mean.

    Infinite where 30 tries do not suffice on average.
    """
    other = rewards(part, divergence, KINDS[kind])
    plain = rewards(part, divergence, sound, repeats=1)[0]
    dearer = other > 1.05 * plain  # rewards within 5 % are the same
    first = np.where(dearer.any(axis=1), dearer.argmax(axis=1) + 1, np.inf)
    return float(first.mean())


def groups(found: Cells) -> Groups:
    """The runs of each part and divergence, by seed."""
    return explored(found, space_of, "part", "divergence")


def findings(found: Cells) -> dict[str, Any]:
    """A row for each part and divergence, and the claims."""
    grouped = groups(found)
    rows = {f"{part}, {divergence}": _row(runs) for (part, divergence), runs in grouped.items()}
    complete = all(key in grouped for key in product(PARTS, DIVERGENCES))
    return {"runs": rows, "claims": [claim.record() for claim in (measured(grouped) if complete else CLAIMS)]}


def _row(runs: list[Explored]) -> dict[str, Any]:
    return {
        "seeds": len(runs),
        "promised_first": round(runs[0].values["first_reward"], 5),
        "paid_first_100": round(mean_over(runs, _early_pay), 5),
        "paid_last_100": round(mean_over(runs, lambda run: float(run.values["paid"][-EARLY:].mean())), 5),
        "untried": mean_over(runs, lambda run: float((run.tries == 0).sum())),
    }


def _early_pay(run: Explored) -> float:
    return float(run.values["paid"][:EARLY].mean())


def measured(grouped: Groups) -> list[Claim]:
    """The claims with our numbers, of the runs of both parts with both divergences."""
    ratios = {divergence: _size_ratios(grouped, divergence) for divergence in DIVERGENCES}
    kl_ratio, kail_ratio = interval(ratios["kl"]), interval(ratios["kail"])
    return [
        _apart(FIRST, "failing"),
        _apart(SECOND, "uncertain"),
        _spikes({divergence: relative_tries_of(grouped["left_arm", divergence], _of_arm(grouped)) for divergence in DIVERGENCES}),
        SIZE.measured(estimate(ratios["kl"]), kl_ratio[0] > 1.5),
        COMPARABLE.measured(estimate(ratios["kail"]), 0.8 < kail_ratio[0] and kail_ratio[1] < 1.25),
    ]


def _of_arm(grouped: Groups) -> list[Explored]:
    return [run for divergence in DIVERGENCES for run in grouped.get(("left_arm", divergence), [])]


def _spikes(dearer: Mapping[str, list[float]]) -> Claim:
    """Of mean tries of failing actions over those of the others, of each run of the arm."""
    if not all(dearer.values()):
        return SPIKES.measured("no action fails in more than half of its tries", None)
    text = f"tries over those of the others: {estimate(dearer['kail'])}, plain KL {estimate(dearer['kl'])}"
    return SPIKES.measured(text, interval(dearer["kail"])[0] > max(interval(dearer["kl"])[1], 1.0))


def _apart(claim: Claim, kind: str) -> Claim:
    """Tries on paper, in the arm's space."""
    kail, plain = tries_to_prefer("left_arm", "kail", kind), tries_to_prefer("left_arm", "kl", kind)
    return claim.measured(f"{_tries(kail)} against {_tries(plain)}", kail < plain)


def _tries(count: float) -> str:
    return f"{count:.1f}" if np.isfinite(count) else "never"


def _size_ratios(grouped: Groups, divergence: str) -> list[float]:
    """What the torso's first tries pay over what the arm's do, of each seed that both have."""
    torso, arm = ({run.seed: _early_pay(run) for run in grouped[part, divergence]} for part in ("torso", "left_arm"))
    return [torso[seed] / arm[seed] for seed in sorted(torso.keys() & arm.keys())]


SMOOTH = 50  # transitions


def plot(found: Cells) -> Any:
    """A row for each divergence: rewards on paper, pay of both parts over time, and tries of failing actions."""
    grouped = groups(found)
    drawing = new_figure(14.0, 6.0)
    panels = drawing.subplots(2, 3, squeeze=False)
    for (paper, paid, tried), (divergence, title) in zip(panels, DIVERGENCES.items(), strict=True):
        for kind, outcome in KINDS.items():
            paper.plot(np.arange(1, TRIES + 1), rewards("left_arm", divergence, outcome, repeats=100).mean(axis=0), marker=".", label=kind)
        paper.set(title=f"{title}: one action of 81 states", xlabel="try", ylabel="reward [nats]", yscale="log")
        for part, label in PARTS.items():
            if (part, divergence) in grouped:
                pay = np.mean([run.values["paid"] for run in grouped[part, divergence]], axis=0)
                paid.plot(np.convolve(pay, np.full(SMOOTH, 1.0 / SMOOTH), mode="valid"), label=label)
        paid.set(title="what the agents' transitions paid", xlabel="transition", ylabel="reward [nats]", yscale="log")
        if ("left_arm", divergence) in grouped:
            _tries_of_arm(tried, grouped["left_arm", divergence][0].tries, constraint_actions(_of_arm(grouped)))
        for axes in (paper, paid, tried):
            axes.legend(fontsize=8)
            axes.grid(alpha=0.2)
    return drawing


def _tries_of_arm(axes: Any, tries: Ints, chosen: NDArray[np.bool_]) -> None:
    number = np.arange(len(tries))
    axes.bar(number[~chosen], tries[~chosen], width=1.0, color="0.6", label="others")
    axes.bar(number[chosen], tries[chosen], width=3.0, color="C3", label="failing")
    axes.set(title=f"tries of the arm in {tries.sum()} transitions", xlabel="state-action")


EXPERIMENT = Experiment(
    name="information-gain",
    claim="'Kail' divergence tells failing from sound actions in fewer tries than plain KL, whatever the size of the state space",
    source="thesis 6.4.2, 6.4.3",
    notes=__doc__,
    method=Sweep(conditions, trial, findings, plot),
    claims=CLAIMS,
)
