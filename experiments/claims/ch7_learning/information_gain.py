# SPDX-License-Identifier: Apache-2.0
"""Compare two information gains as rewards: the thesis' 'Kail' divergence, and the KL divergence from a uniform prior over all states.

'Kail' divergence is computed over the bins of an action: one for the start (failure), one for the goal (success), and one for each other
state that it has led to.
Claim: with the plain KL divergence and a uniform prior every first try has the same reward, so that many tries are needed to distinguish
failing actions from reliable ones; and rewards are larger in small state spaces than in large ones.  The 'Kail' divergence has neither
problem.  Source: thesis 6.4.2 and 6.4.3, eqs. 6.6 to 6.9, tables 6.1 to 6.4.  Run time: half a minute on 2 cores.

First the rewards of a reliable, a failing and an uncertain action are computed, try by try.  Then curious agents explore with both
divergences: the left arm with its constraints (81 states with 16 neighbours) makes 4000 transitions, and the torso (27 states with 8
neighbours) 900; all runs of a part have the same graph.  In the claims, the failing actions of a run are those that failed in more than
half of all their tries in the other runs of the arm.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from functools import cache, partial
from itertools import product
from typing import Any

import numpy as np

from experiments.kit.experiment import Claim, Experiment, Measured, claim, judged
from experiments.kit.learning.arm import ARM_NEIGHBOURS, DT, TORSO, arm_plant, arm_space, robot, torso_space
from experiments.kit.learning.exploration import begin_anywhere, explore
from experiments.kit.learning.outcomes import Explored, Groups, constraint_actions, draw_tries, explored, relative_tries_of
from experiments.kit.plots import finish, new_figure
from experiments.kit.rules import all_hold, decides, is_above, within
from experiments.kit.statistics import estimate, interval, mean_over
from experiments.kit.sweep import Cells, Condition, Sweep
from mobee import CuriousAgent, Gains, Lattice, Model, OfflinePlant, TransitionModel
from mobee.arrays import Array

DIVERGENCES = {"kail": "'Kail'", "kl": "plain KL, uniform prior"}
PARTS = {"left_arm": "arm, 81 states", "torso": "torso, 27 states"}
TRANSITIONS = {"left_arm": 4000, "torso": 900}
FEW = {"left_arm": 1000, "torso": 300}
EARLY = 100  # transitions whose mean reward is compared between the parts
TRIES, REPEATS = 30, 400  # of the computed actions
DIFFERENT, COMPARABLE = 1.5, (0.8, 1.25)  # ratios of rewards of two learners
SAME_REWARD = 1.05  # ratio of rewards up to which they count as the same


@cache
def space_of(part: str) -> Lattice:
    """Return the lattice of a part: 81 states with 16 neighbours for "left_arm", 27 with 8 for "torso"."""
    return torso_space() if part == "torso" else arm_space(neighbours=ARM_NEIGHBOURS)


def plant_of(part: str, seed: int) -> OfflinePlant:
    """Return an offline plant without objects in which only the motors of the part, "left_arm" or "torso", move.

    `seed`: of the plant.
    """
    if part == "torso":
        return OfflinePlant(Model(robot()), seed, Gains.published_2014(), dt=DT, active=TORSO)
    return arm_plant(seed)


def conditions(arguments: argparse.Namespace) -> list[Condition]:
    """Return the settings of the runs: both parts ("left_arm", "torso") with both divergences that define the reward.

    The divergences are "kail" (thesis 6.4.2) and "kl", the plain KL divergence with a uniform prior.  With --quick the runs have fewer
    transitions: 1000 of the arm and 300 of the torso.
    """
    counts = FEW if arguments.quick else TRANSITIONS
    return [
        Condition(f"{part}-{divergence}-n{counts[part]}", {"part": part, "divergence": divergence, "transitions": counts[part]})
        for part, divergence in product(PARTS, DIVERGENCES)
    ]


def trial(settings: dict[str, Any], seed: int) -> dict[str, Any]:
    """Let a curious agent explore with one part and one divergence as reward.

    Returns the transitions `seen` (T, 3): state, action, state reached; their `rewards` (T,) [nats]; and `first_reward`, the largest
    expected reward of an action before any try.  `settings`: "part"; "divergence"; "transitions", their number.  `seed`: of agent and
    plant.
    """
    part, divergence = settings["part"], settings["divergence"]
    space, plant = space_of(part), plant_of(part, seed)
    begin_anywhere(space, plant, seed)
    agent = CuriousAgent(space, plant, seed=seed, divergence=divergence)
    received: list[float] = []
    seen = explore(agent, settings["transitions"], lambda agent: _record_reward(agent, received))
    _record_reward(agent, received)
    first = float(TransitionModel(space, divergence=divergence).reward.max())
    return {"seen": seen.astype(np.uint16), "rewards": np.array(received, dtype=np.float32), "first_reward": first}


def _record_reward(agent: CuriousAgent, received: list[float]) -> bool:
    if agent.last is not None and agent.last.n > len(received):
        received.append(agent.last.reward)
    return False


Outcome = Callable[[np.random.Generator, int], int]  # draws the state in which an action with this goal ends


def reliable(rng: np.random.Generator, goal: int) -> int:
    """Return the state in which a reliable action ends: always its goal."""
    return goal


def failing(rng: np.random.Generator, goal: int) -> int:
    """Return the state in which a failing action ends: always the same state, which is not its goal."""
    return (goal + 7) % 27


def uncertain(rng: np.random.Generator, goal: int) -> int:
    """Return the state in which an uncertain action ends: its goal or one of two other states, with equal probability."""
    return (goal, (goal + 7) % 27, (goal + 11) % 27)[int(rng.integers(3))]


KINDS: dict[str, Outcome] = {"reliable": reliable, "failing": failing, "uncertain": uncertain}


def rewards(part: str, divergence: str, outcome: Outcome, repeats: int = REPEATS) -> Array:
    """Simulate 30 tries of one action, and return the reward of each try [nats], (repeats, 30).

    `part`: the part whose states are used, "left_arm" or "torso".  `divergence`: the one that defines the reward, "kail" (thesis 6.4.2) or
    "kl", plain KL with a uniform prior.  `outcome`: function that draws the state in which the action ends.  `repeats`: number of
    simulations.
    """
    space, rng = space_of(part), np.random.default_rng(0)
    goal = int(space.goals[0, 0])
    received = np.empty((repeats, TRIES))
    for row in received:
        model = TransitionModel(space, divergence=divergence)
        for number in range(TRIES):
            row[number] = model.observe(0, 0, outcome(rng, goal))
    return received


def tries_to_prefer(part: str, divergence: str, kind: str) -> float:
    """Return the mean number of tries after which an action of the kind `kind` has a larger reward than a reliable action.

    Both actions are tried equally often, and the rewards of their last tries are compared.  A reward is larger if it exceeds the other by
    more than 5 %.  `part`: "left_arm" or "torso".  `divergence`: the one that defines the reward, "kail" (thesis 6.4.2) or "kl", plain KL
    with a uniform prior.  `kind`: "failing" (never ends in its goal) or "uncertain" (ends in one of three states).  Returns inf if 30 tries
    were not enough in one of the simulations.
    """
    other = rewards(part, divergence, KINDS[kind])
    plain = rewards(part, divergence, reliable, repeats=1)[0]
    larger = other > SAME_REWARD * plain
    first = np.where(larger.any(axis=1), larger.argmax(axis=1) + 1, np.inf)
    return float(first.mean())


def groups(found: Cells) -> Groups:
    """Return the counts (tries, failures and visits) of the finished runs as a dict from (part, divergence) to a list sorted by seed.

    Parts: "left_arm", "torso".  Divergences, which define the reward: "kail" (thesis 6.4.2), or "kl", plain KL with a uniform prior.
    """
    return explored(found, space_of, "part", "divergence")


def findings(found: Cells) -> dict[str, Any]:
    """Return the results as a dict with two keys, "runs" and "claims".

    "runs" is a dict from "part, divergence" to a row: "seeds", rewards before any try and in the first and last 100 actions, and the number
    of "untried_actions".  "claims" is a list with the claims, their measured values and their verdicts, as dicts (`Claim.record`).  If not
    every part was run with every divergence, all claims stay unmeasured and are not judged.
    """
    grouped = groups(found)
    rows = {
        f"{PARTS[part]}, {DIVERGENCES[divergence]}": {
            "seeds": len(runs),
            "expected_reward_before_any_try": round(runs[0].values["first_reward"], 5),
            "mean_reward_of_first_100": round(mean_over(runs, _early_reward), 5),
            "mean_reward_of_last_100": round(mean_over(runs, lambda run: float(run.values["rewards"][-EARLY:].mean())), 5),
            "untried_actions": mean_over(runs, lambda run: float((run.tries == 0).sum())),
        }
        for (part, divergence), runs in grouped.items()
    }
    return {"runs": rows, "claims": judged(CLAIMS, grouped, set(product(PARTS, DIVERGENCES)) <= set(grouped))}


def _early_reward(run: Explored) -> float:
    return float(run.values["rewards"][:EARLY].mean())


def _apart(kind: str, grouped: Groups) -> Measured:
    """Judge whether the reward by "Kail" prefers an action of this kind to a reliable one after fewer tries than plain KL does.

    The numbers of tries are simulated by `tries_to_prefer` with the states of the left arm; the runs are not used.  `kind`: "failing" or
    "uncertain".
    """
    kail, plain = (tries_to_prefer("left_arm", divergence, kind) for divergence in DIVERGENCES)
    texts = [f"{count:.1f}" if np.isfinite(count) else "never" for count in (kail, plain)]
    return f"tries with 'Kail' {texts[0]}, with plain KL {texts[1]}", kail < plain


first, second = (
    Claim(
        source,
        f"with 'Kail' divergence fewer tries are needed to prefer {text} action to a reliable one than with plain KL divergence",
        "many with KL",
        rule=partial(_apart, kind),
    )
    for source, text, kind in (("thesis 6.4.2, 6.4.3", "a failing", "failing"), ("thesis 6.4.2", "an uncertain", "uncertain"))
)


def _of_arm(grouped: Groups) -> list[Explored]:
    return [run for divergence in DIVERGENCES for run in grouped.get(("left_arm", divergence), [])]


@claim(
    "thesis 6.4.3",
    "with 'Kail' divergence the agent tries failing actions more often than others, and more so than with plain KL divergence",
    "qualitative",
)
def spikes(grouped: Groups) -> Measured:
    kail, plain = (relative_tries_of(grouped["left_arm", divergence], _of_arm(grouped)) for divergence in DIVERGENCES)
    if not kail or not plain:
        return "no action fails in more than half of its tries", None
    text = f"tries of failing actions over those of others: 'Kail' {estimate(kail)}, plain KL {estimate(plain)}"
    return text, all_hold([is_above(kail, plain), decides(interval(kail), least=1.0)])


def _size_ratios(grouped: Groups, divergence: str) -> list[float]:
    """Return the mean reward of the torso's first 100 transitions divided by that of the arm's, for each seed with which both were run.

    `divergence`: the one that defines the reward, "kail" or "kl".
    """
    torso, arm = ({run.seed: _early_reward(run) for run in grouped[part, divergence]} for part in ("torso", "left_arm"))
    return [torso[seed] / arm[seed] for seed in sorted(torso.keys() & arm.keys())]


@claim(
    "thesis 6.4.2",
    "with plain KL divergence a learner with 27 states receives at least 1.5 times the reward of one with 81: ratio in the first "
    "transitions",
    "eqs. 6.6-6.9: falls with size",
)
def size(grouped: Groups) -> Measured:
    return within(_size_ratios(grouped, "kl"), least=DIFFERENT)


@claim(
    "thesis 6.4.3",
    "with 'Kail' divergence learners with 27 and 81 states receive comparable rewards: ratio for the first transitions within 0.8 and 1.25",
    "1",
)
def comparable(grouped: Groups) -> Measured:
    return within(_size_ratios(grouped, "kail"), least=COMPARABLE[0], most=COMPARABLE[1])


CLAIMS = (first, second, spikes, size, comparable)
SMOOTH = 50  # transitions


def plot(found: Cells) -> Any:
    """Draw the computed rewards of single actions, the rewards of both parts over time, and the tries of failing actions.

    The figure has a row of panels for each divergence.  Returns a matplotlib figure.
    """
    grouped = groups(found)
    drawing = new_figure(14.0, 6.0)
    panels = drawing.subplots(2, 3, squeeze=False)
    for (computed, received, tried), (divergence, title) in zip(panels, DIVERGENCES.items(), strict=True):
        for kind, outcome in KINDS.items():
            mean = rewards("left_arm", divergence, outcome, repeats=100).mean(axis=0)
            computed.plot(np.arange(1, TRIES + 1), mean, marker=".", label=f"{kind} action")
        computed.set(title=f"{title}: one action, 81 states (computed)", xlabel="try", ylabel="reward [nats]", yscale="log")
        for part, label in PARTS.items():
            if (part, divergence) in grouped:
                mean = np.mean([run.values["rewards"] for run in grouped[part, divergence]], axis=0)
                received.plot(np.convolve(mean, np.full(SMOOTH, 1.0 / SMOOTH), mode="valid"), label=label)
        received.set(
            title=f"rewards of the agents, mean over {SMOOTH} transitions", xlabel="transition", ylabel="reward [nats]", yscale="log"
        )
        if ("left_arm", divergence) in grouped:
            tries = grouped["left_arm", divergence][0].tries
            draw_tries(tried, tries, constraint_actions(_of_arm(grouped)), 3.0, "failing")
            tried.set(title=f"tries of the arm in {tries.sum()} transitions", xlabel="state-action")
        for axes in (computed, received, tried):
            finish(axes, legend=8)
    return drawing


EXPERIMENT = Experiment(
    claim="'Kail' divergence distinguishes failing from reliable actions in fewer tries than plain KL, in state spaces of any size",
    source="thesis 6.4.2, 6.4.3",
    method=Sweep(conditions, trial, findings, plot),
    claims=CLAIMS,
)
