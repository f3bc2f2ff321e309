# SPDX-License-Identifier: Apache-2.0
"""Measure the error of learned transition models, for several explorers, with and without imagined outcomes.

Claim: curiosity learns the stochastic actions better than least-tried exploration.  The error of counts without imagined outcomes
(debiased counts) is about a tenth of that of the thesis' counts, which include them: pseudo-counts from before the first try of an action.
Source: aims of this reproduction; the thesis calls the exploration "data-efficient" (7.2.1) without measuring the model.  No numbers are
published.  Run time: 3 minutes on 2 cores.

The error of a state-action is the L1 distance, 0 to 2, between the believed and the true distribution of outcomes.  There are three worlds:
the left arm on 81 and on 256 states (20-80 % of the ranges), with equidistant neighbours (states one level away along one joint), and a
world that is defined by a table of outcome probabilities, so that the truth is known exactly.  In this world a plane separates three of 81
states from the others ("half-space").  The arm's true outcomes are estimated by walks that try every action 80 or 40 times.  An action is
stochastic if its most likely outcome has a probability below .9: none of 432 on the arm with 81 states, some 25 of 1536 with 256, 13 of 432
in the half-space.  The walks have few tries, so their estimate has itself an error, some .1 for two equally likely outcomes.  Even a
perfect model would have this measured error.  Therefore, for the stochastic actions of the arm, the measured ratio of two models' errors
(the larger over the smaller) is smaller than the true ratio.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache, partial
from typing import Any

import numpy as np

from experiments.kit.experiment import OUR_AIM, Claim, Experiment, Measured, judged
from experiments.kit.learning.arm import RANK3, RANK4, arm_plant, arm_space
from experiments.kit.learning.exploration import begin_nearby, explore
from experiments.kit.learning.outcomes import CERTAIN, Truth, model_error, most_likely, sampling_error, truth_of, walk
from experiments.kit.plots import finish, new_figure
from experiments.kit.rules import decides, within
from experiments.kit.statistics import interquartile_mean, ratio_estimate, ratio_interval
from experiments.kit.sweep import Cells, Condition, Sweep, grouped_by
from mobee import CuriousAgent, Lattice, Plant, TransitionModel
from mobee.arrays import Array, Ints
from mobee.learning.explorers import EXPLORERS
from mobee.learning.tabular import TabularPlant, half_space
from mobee.learning.value_iteration import OutcomeModel


@dataclass(frozen=True)
class World:
    """A lattice with the explorers that run on it.

    `text`: name in tables.  `levels`: samples of each joint, as shares of its range.  `explorers`: names of explorers.  `transitions`:
    length of their runs.  `tries`: tries of each action in each of the two walks that measure the true outcomes; 0 if a table defines the
    outcomes.
    """

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
MAX_WALK = 40_000  # actions; rank 4 has states that no walk reaches
SHARES = (0.125, 0.25, 0.375, 0.5, 0.75, 1.0)  # of a world's transitions, after which the error of its models is measured
MAX_ERROR = 0.04  # L1
CURIOUS_RATIO, DEPLETING_RATIO, DEBIASED_RATIO = 1.6, 2.0, 8.0  # our aims: the larger error over the smaller one

COLUMNS = ("L1_with_imagined", "L1_with_imagined_stochastic", "L1_debiased", "L1_debiased_stochastic")
COUNTS, DEBIASED, DEBIASED_STOCHASTIC = 0, 2, 3


@cache
def space_of(world: str) -> Lattice:
    """Return the lattice of a world ("half-space", "rank3" or "rank4"); an action leads to a state one level away along one joint.

    "half-space" and "rank3" have 3 levels of each of the four joints (81 states), "rank4" has 4 levels (256 states).
    """
    return arm_space(WORLDS[world].levels)


def plant_of(world: str) -> Callable[[int], Plant]:
    """Return the function that makes the plant of a world from a seed.

    `world`: "half-space", a table of outcome probabilities; "rank3" or "rank4", the left arm on a lattice with 3 or 4 levels per joint.
    """
    return arm_plant if WORLDS[world].tries else half_space_plant


def half_space_plant(seed: int) -> TabularPlant:
    """Return a plant of 81 states with a table of outcome probabilities; a plane in joint space cuts off the states 24, 51 and 78.

    Only the actions towards these states are stochastic: their most likely outcome has a probability below 0.9.  `seed`: of the random
    outcomes.
    """
    space = space_of("half-space")
    return TabularPlant(space, *half_space(space), seed)


def conditions(arguments: argparse.Namespace) -> list[Condition]:
    """Return the settings of the runs: walks on the arm's lattices, and for each world its explorers.

    A walk tries every action equally often, to measure the true outcomes.  With --quick only the world "half-space" is explored, whose
    true outcomes are known without a walk.
    """
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
    """Explore one world with an explorer, or by a walk that tries every action equally often, to measure the true outcomes.

    Returns the transitions `seen` (T, 3): state, action, state reached.  `settings`: "world", a key of WORLDS; "explorer", its name, or
    "walk".  `seed`: of agent and plant, or of the walk.
    """
    name, explorer = settings["world"], settings["explorer"]
    space, world, plant = space_of(name), WORLDS[name], plant_of(name)
    if explorer == WALK:
        return {"seen": walk(space, plant, world.tries, MAX_WALK, seed).astype(np.uint16)}
    own = plant(seed)
    begin_nearby(space, own, seed)
    return {"seen": explore(CuriousAgent(space, own, explorer, seed), world.transitions).astype(np.uint16)}


def truths(found: Cells) -> dict[str, OutcomeModel]:
    """Return a dict from the world to its true outcomes: a table for the half-space, frequencies in the finished walks for the arm.

    A world of the arm without a finished walk is absent.
    """
    known: dict[str, OutcomeModel] = {"half-space": half_space_plant(0)}
    for (world, explorer), walks in grouped_by(found, "world", "explorer").items():
        if explorer == WALK:
            known[world] = truth_of(space_of(world), np.concatenate([one["seen"] for one in walks]).astype(np.intp))
    return known


def errors(found: Cells, known: Mapping[str, OutcomeModel]) -> dict[tuple[str, str], Array]:
    """Return a dict from (world, explorer) to the L1 errors of the models learned in each run, (seeds, times, columns).

    `known`: dict from a world to its true outcomes; runs in other worlds are left out.  The times are the numbers of transitions that the
    function `times` returns.  Columns 0 and 1: mean error over all actions, and over the stochastic ones, of a model whose counts include
    the imagined outcomes (pseudo-counts from before the first try).  Columns 2 and 3: the same errors of the debiased model, which has a
    weak prior instead of these pseudo-counts.
    """
    return {
        (world, explorer): np.array([error_curve(world, known[world], one["seen"]) for one in results])
        for (world, explorer), results in grouped_by(found, "world", "explorer").items()
        if explorer != WALK and world in known
    }


def times(world: str) -> list[int]:
    """Return the numbers of transitions after which the error of the models of a world is measured."""
    return [round(share * WORLDS[world].transitions) for share in SHARES]


def error_curve(world: str, truth: OutcomeModel, seen: Ints) -> Array:
    """Learn a model again from recorded transitions, and return its L1 errors after several numbers of transitions, (times, columns).

    The numbers of transitions are those that the function `times` returns.  `seen`: (T, 3), state, action, state reached.  Columns 0 and 1:
    mean error over all actions, and over the stochastic ones, of the model whose counts include the imagined outcomes (pseudo-counts from
    before the first try).  Columns 2 and 3: the same errors of the debiased model, which has a weak prior instead of these pseudo-counts.
    NaN at numbers beyond the last transition, and in the columns of stochastic actions if there are none.
    """
    model, at = TransitionModel(space_of(world)), times(world)
    beliefs = (model, model.debiased())
    curve = np.full((len(at), len(COLUMNS)), np.nan)
    for n, transition in enumerate(seen.tolist(), 1):
        model.observe(*transition)
        if n in at:
            curve[at.index(n)] = [error for one in beliefs for error in model_error(one, truth)]
    return curve


def findings(found: Cells) -> dict[str, Any]:
    """Return the results as a dict with two keys, "runs" and "claims".

    `found`: the results of the finished runs.  "runs" is a dict from "world; explorer", such as "arm, 81 states; curious", to a dict of
    numbers about the transition models that this explorer had learned at the end of its runs in this world:
    - "seeds": number of runs.
    - "stochastic_actions": number of actions whose most likely outcome has a probability below 0.9.
    - the names in COLUMNS: errors of the models, which `errors` describes; interquartile means over the runs.  None: not known.
    - "error_of_estimated_truth_stochastic": error of the outcome probabilities with which the models are compared, for the stochastic
      actions.  For the arm they are not exact, because they are frequencies in a limited number of tries (`truth_error`).

    "claims" is a list with the claims, their measured values and their verdicts, as dicts (`Claim.record`).
    """
    known = truths(found)
    last = {key: curves[:, -1] for key, curves in errors(found, known).items()}
    floors = {world: truth_error(truth) for world, truth in known.items()}
    rows = {
        f"{WORLDS[world].text}; {explorer.replace('_', ' ')}": _row(errors, known[world], floors[world])
        for (world, explorer), errors in last.items()
    }
    return {"runs": rows, "claims": judged(CLAIMS, (last, floors))}


def truth_error(truth: OutcomeModel) -> float | None:
    """Return the expected L1 error of the outcome probabilities that are used as the truth; the mean over the stochastic actions.

    `truth`: these probabilities.  If they were measured by walks (`Truth`), they are frequencies in a limited number of tries, so they have
    a sampling error.  If a table defines them, the error is 0.  Returns None if no action is stochastic.  A stochastic action has no
    outcome with a probability of 0.9 or more.
    """
    stochastic = most_likely(truth) < CERTAIN
    if not stochastic.any():
        return None
    return float(sampling_error(truth)[stochastic].mean()) if isinstance(truth, Truth) else 0.0


def _row(last: Array, truth: OutcomeModel, floor: float | None) -> dict[str, Any]:
    numbers = {
        name: interquartile_mean(column) if np.isfinite(column).all() else None for name, column in zip(COLUMNS, last.T, strict=True)
    }
    stochastic = int((most_likely(truth) < CERTAIN).sum())
    return {"seeds": len(last), "stochastic_actions": stochastic, **numbers, "error_of_estimated_truth_stochastic": floor}


Last = tuple[Mapping[tuple[str, str], Array], Mapping[str, float | None]]  # errors at the last time (seeds, columns); of the estimates


def _column(found: Last, world: str, explorer: str, number: int) -> Array | None:
    rows = found[0].get((world, explorer))
    return None if rows is None or not np.isfinite(rows[:, number]).all() else rows[:, number]


def _overall(world: str, found: Last) -> Measured | None:
    ours = _column(found, world, "curious", DEBIASED)
    return None if ours is None else within(ours, 4, most=MAX_ERROR)


def _ratio(above: Array | None, below: Array | None, least: float, note: str = "") -> Measured | None:
    """Judge whether the error `above` divided by the error `below` is at least `least`; returns text and verdict.

    `above`, `below`: errors of each run, (seeds,).  `note`: appended to the text.  Returns None if an error is not known (None).  The
    verdict is None (open) if the confidence interval of the ratio contains `least`.
    """
    if above is None or below is None:
        return None
    factor = ratio_estimate(above, below).replace(" ", " x ", 1)
    text = f"{factor} ({interquartile_mean(above):.3f} against {interquartile_mean(below):.3f})"
    return text + note, decides(ratio_interval(above, below), least)


def _stochastic(world: str, explorer: str, least: float, found: Last) -> Measured | None:
    rival, ours = (_column(found, world, name, DEBIASED_STOCHASTIC) for name in ("least_tried", explorer))
    floor = found[1].get(world)
    return _ratio(rival, ours, least, f"; the estimate of the true outcomes has itself an error of {floor:.3f}" if floor else "")


def _without(found: Last) -> Measured | None:
    counts, debiased = (_column(found, "rank3", "curious", which) for which in (COUNTS, DEBIASED))
    return _ratio(counts, debiased, DEBIASED_RATIO)


CLAIMS = (
    *(
        Claim(
            OUR_AIM,
            f"after 4000 curious transitions the L1 error of the model with debiased counts is at most {MAX_ERROR} ({text})",
            f"at most {MAX_ERROR}",
            rule=partial(_overall, world),
        )
        for world, text in (("half-space", "half-space"), ("rank3", "arm, 81 states"))
    ),
    *(
        Claim(
            OUR_AIM,
            f"on stochastic actions the {explorer} agent's model has a smaller error than the least-tried agent's: ratio ({text})",
            f"at least {times} x",
            rule=partial(_stochastic, world, explorer, times),
        )
        for world, text in (("half-space", "half-space"), ("rank4", "arm, 256 states"))
        for explorer, times in (("curious", CURIOUS_RATIO), ("depleting", DEPLETING_RATIO))
    ),
    Claim(
        OUR_AIM,
        "without imagined outcomes the error of the model is many times smaller: ratio (arm, 81 states)",
        f"at least {DEBIASED_RATIO:.0f} x",
        rule=_without,
    ),
)


def plot(found: Cells) -> Any:
    """Draw the L1 error of the learned transition models over the number of transitions: a column for each world, a color per explorer.

    The curves are medians over the seeds.  The upper panels show the mean error over all actions, of two models.  Dashed lines: the counts
    include the imagined outcomes, which are pseudo-counts from before the first try.  Solid lines: the debiased model, which has a weak
    prior instead of these pseudo-counts.  The lower panels show the mean error of the debiased model over the stochastic actions, whose
    most likely outcome has a probability below 0.9.  Returns a matplotlib figure.
    """
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
        finish(above, title=WORLDS[world].text, ylabel="L1 error, all actions", yscale="log")
        above.title.set_fontsize(9)
        finish(below, xlabel="transitions", ylabel="L1 error, stochastic actions", ylim=(0.0, None))
        if not any(np.isfinite(curves[key][:, :, DEBIASED_STOCHASTIC]).any() for key in curves if key[0] == world):
            below.text(0.5, 0.5, "no action is stochastic", transform=below.transAxes, ha="center")
    drawing.axes[0].legend(fontsize=7, title="debiased; dashed: with imagined outcomes", title_fontsize=7)
    return drawing


EXPERIMENT = Experiment(
    claim="curiosity learns stochastic actions best, and without imagined outcomes the model's error is a tenth",
    source="aims of this reproduction, to thesis 7.2.1",
    method=Sweep(conditions, trial, findings, plot),
    claims=CLAIMS,
)
