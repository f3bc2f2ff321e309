"""Accuracy: how true is what an agent has learnt of its actions?

Claim: curiosity learns the stochastic actions better than least-tried exploration, and counts without the imagined ones are about ten
times truer than the thesis' counts.  Source: aims of this reproduction; the thesis claims exploration that is "data-efficient" (7.2.1)
without measuring the model.  No numbers are published.  Run time: 3 minutes on 2 cores.

The error of a state-action is the L1 distance, 0 to 2, between the believed and the true distribution over outcomes.  The left arm on
81 and on 256 states (20-80 %), equidistant neighbours, and a table, known exactly, in which a plane cuts off three of 81 states.  The
arm's truth is that of walks which try every action 80 or 40 times, from starts that are reached as an agent reaches them.  Stochastic
are actions whose most likely outcome has less than .9: none of 432 on the arm with 81 states, some 25 of 1536 with 256, 13 of 432 of
the table.  A truth of so few tries has an error of its own, some .1 for an even chance: a floor to what is measured, which makes
ratios on the stochastic actions of the arm too small.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from experiments.kit.experiment import Claim, Experiment
from experiments.kit.learning.arm import RANK3, RANK4, arm_plant, arm_space
from experiments.kit.learning.exploration import begin_nearby, explore
from experiments.kit.learning.truth import CERTAIN, Truth, model_error, most_likely, sampling_error, truth_of, walk
from experiments.kit.plots import new_figure
from experiments.kit.statistics import decides, estimate, interquartile_mean, interval, ratio_estimate, ratio_interval
from experiments.kit.sweep import Cells, Condition, Sweep, grouped_by
from mobee import CuriousAgent, Lattice, Plant, TransitionModel
from mobee.arrays import Array, Ints
from mobee.learning.explorers import EXPLORERS
from mobee.learning.tabular import TabularPlant, half_space
from mobee.learning.value_iteration import OutcomeModel


@dataclass(frozen=True)
class World:
    """A lattice, the explorers on it, and their transitions.  `tries`: of each action in each walk; 0: the truth is a table."""

    text: str
    levels: tuple[float, ...]
    explorers: tuple[str, ...]
    transitions: int
    tries: int = 0


WORLDS = {
    "half-space": World("half-space, 81 states", RANK3, tuple(name for name in EXPLORERS if name != "nearest_untried"), 4000),
    "rank3": World("arm, 81 states", RANK3, ("curious", "least_tried", "random"), 4000, tries=40),
    "rank4": World("arm, 256 states", RANK4, ("curious", "least_tried", "depleting"), 8000, tries=20),
}
WALK, WALKS = "walk", (9001, 9002)  # in place of an explorer; seeds that no explorer has
LONGEST_WALK = 40_000  # actions; rank 4 has states that no walk reaches
SHARES = (0.125, 0.25, 0.375, 0.5, 0.75, 1.0)  # of a world's transitions, after which the error of its models is measured
MOST, BETTER, AIM, TEN = 0.04, 1.6, 2.0, 8.0  # L1; times; times; times

_AIM = "aim of this reproduction"
OVERALL = {
    world: Claim(_AIM, f"L1 of the model at most {MOST} after 4000 curious transitions with debiased counts ({text})", f"at most {MOST}")
    for world, text in (("half-space", "half-space"), ("rank3", "arm, 81 states"))
}
STOCHASTIC = {
    (world, explorer): Claim(
        _AIM, f"on stochastic actions the {explorer} agent's model is truer than least-tried's ({text})", f"at least {times} x"
    )
    for world, text in (("half-space", "half-space"), ("rank4", "arm, 256 states"))
    for explorer, times in (("curious", BETTER), ("depleting", AIM))
}
WITHOUT = Claim(_AIM, "without the imagined counts the model is many times truer (arm, 81 states)", f"at least {TEN:.0f} x")
CLAIMS = (*OVERALL.values(), *STOCHASTIC.values(), WITHOUT)

COLUMNS = ("counts", "counts_stochastic", "debiased", "debiased_stochastic")
COUNTS, DEBIASED, DEBIASED_STOCHASTIC = 0, 2, 3


@cache
def space_of(world: str) -> Lattice:
    """The lattice of a world, with equidistant neighbours."""
    return arm_space(WORLDS[world].levels)


def plant_of(world: str) -> Callable[[int], Plant]:
    """The function that makes the world's plant of a seed."""
    return arm_plant if WORLDS[world].tries else half_space_plant


def half_space_plant(seed: int) -> TabularPlant:
    """The half-space in which states 24, 51 and 78 are cut off."""
    space = space_of("half-space")
    return TabularPlant(space, *half_space(space), seed)


def conditions(arguments: argparse.Namespace) -> list[Condition]:
    """The walks that find the truth of the arm, and every explorer in its worlds; the short version has the half-space only."""
    worlds = {name: world for name, world in WORLDS.items() if not (arguments.quick and world.tries)}
    walks = [
        Condition(f"truth-{name}", {"world": name, "explorer": WALK}, cost=8.0, seeds=WALKS)
        for name, world in worlds.items()
        if world.tries
    ]
    explorations = [
        Condition(f"{name}-{explorer}", {"world": name, "explorer": explorer}, cost=world.transitions / (4000 if world.tries else 12000))
        for name, world in worlds.items()
        for explorer in world.explorers
    ]
    return walks + explorations


def trial(settings: dict[str, Any], seed: int) -> dict[str, Any]:
    """Explore; the transitions (T, 3)."""
    name, explorer = settings["world"], settings["explorer"]
    space, world, plant = space_of(name), WORLDS[name], plant_of(name)
    if explorer == WALK:
        return {"seen": walk(space, plant, world.tries, LONGEST_WALK, seed).astype(np.uint16)}
    own = plant(seed)
    begin_nearby(space, own, seed)
    return {"seen": explore(CuriousAgent(space, own, explorer, seed), world.transitions).astype(np.uint16)}


def truths(found: Cells) -> dict[str, OutcomeModel]:
    """The truth of each world that has one: the half-space's own table, the arm's by the walks among the cells."""
    known: dict[str, OutcomeModel] = {"half-space": half_space_plant(0)}
    for (world, explorer), walks in grouped_by(found, "world", "explorer").items():
        if explorer == WALK:
            known[world] = truth_of(space_of(world), np.concatenate([one.values["seen"] for one in walks]).astype(np.intp))
    return known


def errors(found: Cells, known: Mapping[str, OutcomeModel]) -> dict[tuple[str, str], Array]:
    """The error curves of every explorer in every world whose truth is known, (seeds, times, columns)."""
    return {
        (world, explorer): np.array([error_curve(world, known[world], one.values["seen"]) for one in mine])
        for (world, explorer), mine in grouped_by(found, "world", "explorer").items()
        if explorer != WALK and world in known
    }


def times(world: str) -> list[int]:
    """The transitions after which the error of a world's models is measured."""
    return [round(share * WORLDS[world].transitions) for share in SHARES]


def error_curve(world: str, truth: OutcomeModel, seen: Ints) -> Array:
    """Learn again from transitions (T, 3); the errors, shape (times, columns), NaN beyond the last transition."""
    model, at = TransitionModel(space_of(world)), times(world)
    beliefs = (model, model.debiased())
    curve = np.full((len(at), len(COLUMNS)), np.nan)
    for n, transition in enumerate(seen.tolist(), 1):
        model.observe(*transition)
        if n in at:
            curve[at.index(n)] = [error for one in beliefs for error in model_error(one, truth)]
    return curve


def findings(found: Cells) -> dict[str, Any]:
    """A row for each world and explorer at the last time, and the claims."""
    known = truths(found)
    last = {key: curves[:, -1] for key, curves in errors(found, known).items()}
    floors = {world: truth_error(truth) for world, truth in known.items()}
    rows = {" ".join(key): _row(mine, known[key[0]], floors[key[0]]) for key, mine in last.items()}
    return {"runs": rows, "claims": [claim.record() for claim in measured(last, floors)]}


def truth_error(truth: OutcomeModel) -> float | None:
    """The error of the truth itself on the stochastic actions, a floor to measured errors: 0 for a table; None without any."""
    stochastic = most_likely(truth) < CERTAIN
    if not stochastic.any():
        return None
    return float(sampling_error(truth)[stochastic].mean()) if isinstance(truth, Truth) else 0.0


def _row(last: Array, truth: OutcomeModel, floor: float | None) -> dict[str, Any]:
    numbers = {
        name: interquartile_mean(column) if np.isfinite(column).all() else None for name, column in zip(COLUMNS, last.T, strict=True)
    }
    return {"seeds": len(last), "stochastic_actions": int((most_likely(truth) < CERTAIN).sum()), **numbers, "truth_stochastic": floor}


def measured(last: Mapping[tuple[str, str], Array], floors: Mapping[str, float | None]) -> list[Claim]:
    """The claims with our numbers as far as their runs were made, of the errors (seeds, columns) at the last time."""

    def column(world: str, explorer: str, number: int) -> Array | None:
        rows = last.get((world, explorer))
        return None if rows is None or not np.isfinite(rows[:, number]).all() else rows[:, number]

    claims = []
    for world, claim in OVERALL.items():
        mine = column(world, "curious", DEBIASED)
        claims.append(claim if mine is None else claim.measured(estimate(mine, 4), decides(interval(mine), most=MOST)))
    for (world, explorer), claim in STOCHASTIC.items():
        least = BETTER if explorer == "curious" else AIM
        rival, mine = (column(world, name, DEBIASED_STOCHASTIC) for name in ("least_tried", explorer))
        floor = floors.get(world)
        claims.append(_ratio(claim, rival, mine, least, f"; the truth's own error, a floor to both, is {floor:.3f}" if floor else ""))
    claims.append(_ratio(WITHOUT, column("rank3", "curious", COUNTS), column("rank3", "curious", DEBIASED), TEN))
    return claims


def _ratio(claim: Claim, above: Array | None, below: Array | None, least: float, note: str = "") -> Claim:
    """Whether what is above is that many times what is below; open if one is not known, or the interval holds the number."""
    if above is None or below is None:
        return claim
    factor = ratio_estimate(above, below).replace(" ", " x ", 1)
    text = f"{factor} ({interquartile_mean(above):.3f} against {interquartile_mean(below):.3f})"
    return claim.measured(text + note, decides(ratio_interval(above, below), least))


def plot(found: Cells) -> Any:
    """Error against transitions, a column a world: all actions, counts dashed and debiased solid; below the stochastic ones, debiased."""
    curves = errors(found, truths(found))
    worlds = [world for world in WORLDS if any(key[0] == world for key in curves)]
    drawing = new_figure(4.6 * len(worlds), 6.4)
    for (above, below), world in zip(drawing.subplots(2, len(worlds), squeeze=False, sharex="col").T, worlds, strict=True):
        for number, explorer in enumerate(EXPLORERS):
            if (world, explorer) in curves:
                counts, _, debiased, stochastic = np.median(curves[world, explorer], axis=0).T
                label = explorer.replace("_", " ")
                above.plot(times(world), counts, "--", color=f"C{number}", linewidth=0.9)
                above.plot(times(world), debiased, color=f"C{number}", label=label)
                below.plot(times(world), stochastic, color=f"C{number}", label=label)
        above.set(title=WORLDS[world].text, ylabel="L1, all actions", yscale="log")
        above.title.set_fontsize(9)
        below.set(xlabel="transitions", ylabel="L1, stochastic actions", ylim=(0.0, None))
        if not any(np.isfinite(curves[key][:, :, DEBIASED_STOCHASTIC]).any() for key in curves if key[0] == world):
            below.text(0.5, 0.5, "there is none", transform=below.transAxes, ha="center")
        above.grid(alpha=0.2)
        below.grid(alpha=0.2)
    drawing.axes[0].legend(fontsize=7, title="debiased; dashed: with imagined counts", title_fontsize=7)
    return drawing


EXPERIMENT = Experiment(
    name="model-accuracy",
    claim="curiosity learns the stochastic actions best, and counts without the imagined ones are ten times truer",
    source="aims of this reproduction, to thesis 7.2.1",
    notes=__doc__,
    method=Sweep(conditions, trial, findings, plot),
    claims=CLAIMS,
)
