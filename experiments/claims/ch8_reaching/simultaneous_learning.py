# SPDX-License-Identifier: Apache-2.0
"""Compare learning transitions and reaches at the same time with learning the transitions first.

Claim: there is no reason that the transition model and the reaches cannot be learned simultaneously; where an action fails, contact with a
workspace object decides whether the failure is a negative reward of the problem (to reach a target) or an update of the model.
Source: thesis 9.4.1 (future work).  Published: no numbers.  Run time: five minutes on 2 cores.

The right arm under the published control law and the 27 targets are those of the experiment reach-exploration; the learner is one of those
of reach-predictors (--learner).  There are five variants.  All have the same total number of actions, which includes reaches but not the
actions of evaluations.  "contact": transitions and reaches are learned at the same time, and failures are attributed by contact.
"first-3000": first 3000 curious transitions without targets, as in the thesis; then reaches, during which the model does not change.
"first-1000": the same with 1000 transitions.  "model": as "contact", but every transition updates the model, as if there were no contact
sensors.  "target": as "contact", but every transition that does not end in its goal is attributed to the target, so that only successes
update the model.  A score is the sum of the rewards of the 27 targets in one evaluation.  The error of a model is the mean L1 distance, 0
to 2, between its outcome probabilities (without the imagined outcomes of the prior) and the outcomes of random walks without targets.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Literal

import numpy as np

from experiments.kit.experiment import Envelope, Experiment, Measured, claim, judged
from experiments.kit.learning.exploration import begin_anywhere
from experiments.kit.learning.outcomes import Truth, l1, truth_of, walk
from experiments.kit.plants import WrappedPlant
from experiments.kit.plots import draw_curve, finish, new_figure
from experiments.kit.reaching.arm import MARKER, learned_beliefs, reach_plant, reach_space
from experiments.kit.reaching.learning import LEARNERS
from experiments.kit.reaching.targets import grid, targets_at
from experiments.kit.rules import all_hold, decides, rises
from experiments.kit.statistics import estimate, interval
from experiments.kit.sweep import Cells, Condition, Sweep, grouped
from mobee import TransitionModel
from mobee.arrays import Array, Ints
from mobee.learning.reaching.reach_agent import ReachAgent
from mobee.learning.space import Space
from mobee.learning.value_iteration import OutcomeModel
from mobee.plant import Outcome
from mobee.reach import TARGET, ReachPlant

CHECKPOINTS = (500, 1000, 1500, 2000, 3000, 3500, 4000)  # actions after which the learners are evaluated
QUICK = (500, 1000, 2000)
LEARNER = "kernel-ucb"  # takes less time than the plant; "gp-ucb-alike" takes many times that
REPETITIONS = 2  # evaluations at each checkpoint
WALKS = (9001, 9002)  # seeds of the walks, which no learner has
TRIES, MAX_WALK = 20, 20_000  # tries of each action in a walk, and its largest number of actions
WALK = "walk"
Blame = Literal["model", "target"]
BLAMES: tuple[Blame, ...] = ("model", "target")
FIRST = {"first-3000": 3000, "first-1000": 1000}  # curious transitions before the first target
CONTACT = "contact"
VARIANTS = (CONTACT, *FIRST, *BLAMES)

SCORE_SHARE = 0.9  # of the final score of "model first": the score whose number of actions is compared
MARGIN = 0.05  # of that score: a score at most this much lower counts as equal

COLORS = {"contact": "tab:red", "first-3000": "tab:blue", "first-1000": "tab:cyan", "model": "tab:orange", "target": "0.4"}
LABELS = {
    "contact": "same time, failures attributed by contact",
    "first-3000": "3000 transitions first",
    "first-1000": "1000 transitions first",
    "model": "same time, failures attributed to the model",
    "target": "same time, failures attributed to the target",
}


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the option --learner: the reach learner of all variants."""
    parser.add_argument(
        "--learner", choices=list(LEARNERS), default=LEARNER, metavar="NAME", help=f"one of {', '.join(LEARNERS)} (default: {LEARNER})"
    )


def conditions(arguments: argparse.Namespace) -> list[Condition]:
    """Return the settings of the runs: walks through the states, which measure the true outcomes of actions, and five variants.

    The variants "contact", "model" and "target" learn transitions and reaches at the same time, and attribute failures by contact, always
    to the model, or always to the target.  "first-3000" and "first-1000" learn 3000 or 1000 transitions first.  With --quick the runs have
    2000 instead of 4000 actions.
    """
    checkpoints = list(QUICK if arguments.quick else CHECKPOINTS)
    variants = [Condition(variant, {"variant": variant, "learner": arguments.learner, "checkpoints": checkpoints}) for variant in VARIANTS]
    return [Condition("truth", {"variant": WALK}, 2.0, WALKS), *variants]


def trial(settings: dict[str, Any], seed: int) -> dict[str, Any]:
    """Make a walk that tries every transition, or let one variant learn and evaluate it L times.

    A walk returns its transitions `seen` (T, 3).  A learner returns, for L evaluations that try each target R times, `scores` (L, R), NaN
    before the first target; `tries` and `failed` (L,), numbers of problem-tries (attempts to reach one target) and failed transitions so
    far; and for each evaluation n its transition model, `outcomes_n` and `probabilities_n` (S, A, B) for up to B outcomes of an action.
    `settings`: "variant", "walk" or one of VARIANTS; "learner", one of LEARNERS; "checkpoints", the L numbers of actions before the
    evaluations.  `seed`: of agent and plant.
    """
    if settings["variant"] == WALK:
        return {"seen": walk(reach_space(), reach_plant, TRIES, MAX_WALK, seed).astype(np.uint16)}
    agent, beliefs, before = _agent(settings["variant"], settings["learner"], seed)
    problems, checkpoints = targets_at(grid()), settings["checkpoints"]
    found: dict[str, Any] = {}
    scores, counts, failed = np.full((len(checkpoints), REPETITIONS), np.nan), np.zeros((len(checkpoints), 2), dtype=np.intp), 0
    for n, checkpoint in enumerate(checkpoints):
        while before + agent.steps < checkpoint:
            agent.learn(problems, 1)
            assert agent.last is not None
            failed += agent.last.failures
        counts[n] = agent.tries, failed
        if checkpoint >= before:
            scores[n] = agent.evaluate(problems, REPETITIONS).scores
            found[f"outcomes_{n}"], found[f"probabilities_{n}"] = beliefs.outcomes.astype(np.int16), beliefs.probabilities.copy()
    return found | {"scores": scores, "tries": counts[:, 0], "failed": counts[:, 1]}


def _agent(variant: str, learner: str, seed: int) -> tuple[ReachAgent, OutcomeModel, int]:
    """Return the learner, its transition model, and the number of actions spent on that before the first target."""
    space, arm = reach_space(), reach_plant(seed)
    agent = partial(LEARNERS[learner].agent, space, marker=MARKER, seed=seed)
    if variant in FIRST:
        beliefs = learned_beliefs(arm, seed, FIRST[variant])
        return agent(plant=arm, beliefs=beliefs), beliefs, FIRST[variant]
    begin_anywhere(space, arm, seed)
    plant: ReachPlant = next((BlamingPlant(arm, space, blame) for blame in BLAMES if blame == variant), arm)
    model = TransitionModel(space)
    return agent(plant=plant, model=model), model.debiased(), 0


class BlamingPlant(WrappedPlant[ReachPlant]):
    """A plant that reports false contacts, so that failures are always attributed to the model, or always to the target.

    Args:
        plant: the plant inside, which performs the actions.
        space: its states and transitions.
        blame: "model": no contact is reported.  "target": contact with the target is reported if a transition does not end in its goal.
    """

    def __init__(self, plant: ReachPlant, space: Space, blame: Blame) -> None:
        super().__init__(plant)
        self._space, self._blame = space, blame

    def act(self, part: str, target: Array) -> Outcome:
        """Perform an action as `mobee.plant.Plant.act` does, but replace the contacts in the outcome.

        `touched` names the target if `blame` is "target" and the action did not end in its goal; otherwise it is empty.  `part`, `target`:
        as in that method.
        """
        outcome = super().act(part, target)
        arrived = self._space.state_of(outcome.q) == self._space.state_of(target)
        return replace(outcome, touched=() if self._blame == "model" or arrived else (TARGET,))


@dataclass(frozen=True, slots=True, eq=False)
class Runs:
    """The N runs of one variant, each with L evaluations.

    `actions`: (L,), number of actions before each evaluation.  `scores`, `errors`: (N, L), score and mean L1 error of the transition model;
    NaN where there was no evaluation.  `observed`: (N, L), the mean error only over the transitions that the model has observed.  `tries`,
    `failed`: (N,), numbers of problem-tries (attempts to reach one target) and of failed transitions at the end.
    """

    actions: Ints
    scores: Array
    errors: Array
    observed: Array
    tries: Ints
    failed: Ints


@dataclass(frozen=True, slots=True, eq=False)
class _Beliefs:
    outcomes: Ints
    probabilities: Array


def findings(found: Cells) -> dict[str, Any]:
    """Return the results: "variants" is a list with a row for each variant, "claims" a list with the judged claims, as dicts.

    A row is a dict of text: "variant", "problem-tries" (attempts to reach one target), "failed transitions", and for each evaluation that
    all runs have, "score after N actions" and "L1 error after N actions" (error of the transition model).  The claims are absent if a
    variant has no run.
    """
    runs = runs_of(found)
    results: dict[str, Any] = {"variants": [_row(variant, group) for variant, group in runs.items()]}
    if set(runs) == set(VARIANTS):
        results["claims"] = judged(CLAIMS, runs, are_complete(runs))
    return results


def are_complete(runs: Mapping[str, Runs]) -> bool:
    """Return whether every run has an evaluation after its last action."""
    return all(np.isfinite(group.scores[:, -1]).all() for group in runs.values())


def runs_of(found: Cells) -> dict[str, Runs]:
    """Return a dict from each variant to its runs, sorted by seed.

    Model errors are differences from true outcomes, which are measured by random walks through the states (the runs "walk" of `trial`).
    They are NaN if `found` has no such run.
    """
    walks = [values["seen"] for values in grouped(found, "variant", [WALK]).get(WALK, [])]
    truth = truth_of(reach_space(), np.concatenate(walks).astype(np.intp)) if walks else None
    checkpoints_of = {one.cell.settings["variant"]: one.cell.settings.get("checkpoints", []) for one in found.values()}
    runs = {}
    for variant, group in grouped(found, "variant", VARIANTS).items():
        checkpoints = checkpoints_of[variant]
        errors = np.array([_errors(values, len(checkpoints), truth) for values in group])
        runs[variant] = Runs(
            np.array(checkpoints),
            np.array([values["scores"].mean(axis=-1) for values in group]),
            errors[..., 0],
            errors[..., 1],
            np.array([values["tries"][-1] for values in group]),
            np.array([values["failed"][-1] for values in group]),
        )
    return runs


def _actions_text(needed: Array) -> str:
    never = int(np.isinf(needed).sum())
    return f"never in {never} of {len(needed)} runs" if never else estimate(needed, 0)


def _of_observed(group: Runs) -> str:
    last = group.observed[:, -1]
    return f" (of observed transitions {estimate(last, 3)})" if np.isfinite(last).all() else ""


def actions_to(least: float, actions: Ints, scores: Array) -> Array:
    """Return the number of actions after which the score of each run reaches `least`, (N,); inf if it never does.

    `actions`: (L,), numbers at the evaluations.  `scores`: (N, L).  Between two evaluations the number is interpolated linearly.
    """
    found = np.full(len(scores), np.inf)
    for n, run in enumerate(scores):
        enough = np.flatnonzero(run >= least)
        if len(enough):
            at = enough[0]
            known = at > 0 and np.isfinite(run[at - 1])
            found[n] = np.interp(least, run[at - 1 : at + 1], actions[at - 1 : at + 1]) if known else actions[at]
    return found


def no_more(ours: Array, theirs: Array) -> bool | None:
    """Return whether the runs of the variant "contact" need at most as many actions as those of another variant with the same seeds.

    `ours`, `theirs`: numbers of actions until a given score is reached (`actions_to`), for these two groups of runs, (N,).  None if a
    number is inf, because its run never reached the score, or if the interval of the differences contains 0.
    """
    if not np.isfinite([ours, theirs]).all():
        return None
    return decides(interval(ours - theirs), most=0.0)


def level(ours: Array, theirs: Sequence[Array]) -> bool | None:
    """Return whether the scores of the variant "contact" are at most 5 % below the scores of each other variant.

    `ours`: scores (N,) of "contact" with N seeds.  `theirs`: scores (N,) with the same seeds, for each other variant.  The intervals of the
    differences decide: True if all lie above the bound of -5 %, False if one lies completely below it, else None.
    """
    return all_hold(decides(interval(ours - other), least=-MARGIN * float(other.mean())) for other in theirs)


ByVariant = Mapping[str, Runs]
_SOURCE = "thesis 9.4.1"


@claim(
    _SOURCE,
    f"learning transitions and reaches at the same time needs no more actions to {SCORE_SHARE:.0%} of the final score than learning "
    "transitions first",
    "no number",
)
def sooner(runs: ByVariant) -> Measured:
    parts, found = list[str](), dict[str, bool | None]()
    for variant, start in FIRST.items():
        least = SCORE_SHARE * float(runs[variant].scores[:, -1].mean())
        ours, theirs = (actions_to(least, one.actions, one.scores) for one in (runs[CONTACT], runs[variant]))
        parts.append(f"actions to a score of {least:.1f}: {_actions_text(ours)}; {LABELS[variant]}: {_actions_text(theirs)}")
        found[str(start)] = no_more(ours, theirs)
    return "; ".join(parts), Envelope("number of transitions learned first", found)


def _scores(runs: ByVariant, *variants: str) -> tuple[str, list[Array]]:
    """Return the scores of some variants at the end, as text and by seed."""
    ends = [runs[variant].scores[:, -1] for variant in variants]
    return "score: " + "; ".join(f"{LABELS[variant]} {estimate(end)}" for variant, end in zip(variants, ends, strict=True)), ends


@claim(
    _SOURCE,
    "with the same total of actions, learning at the same time ends with no lower score than the better of the two that learn transitions "
    f"first (at most {MARGIN:.0%} below)",
    "no number",
)
def no_lower(runs: ByVariant) -> Measured:
    text, (ours, *theirs) = _scores(runs, CONTACT, *FIRST)
    return text, level(ours, theirs)


@claim(
    _SOURCE, "attributing failures by contact gives a smaller error of the transition model than attributing all to the model", "no number"
)
def clean(runs: ByVariant) -> Measured:
    errors = {variant: runs[variant].errors[:, -1] for variant in (CONTACT, "model", "target")}
    text = "L1: " + "; ".join(f"{LABELS[variant]} {estimate(errors[variant], 3)}{_of_observed(runs[variant])}" for variant in errors)
    return text, rises(errors["model"] - errors[CONTACT])


@claim(_SOURCE, "attributing failures by contact gives a higher score than attributing all to the target", "no number")
def better_reaches(runs: ByVariant) -> Measured:
    text, (ours, theirs, _) = _scores(runs, CONTACT, "target", "model")
    return text, rises(ours - theirs)


CLAIMS = (sooner, no_lower, clean, better_reaches)


def _errors(values: Mapping[str, Any], checkpoints: int, truth: Truth | None) -> Array:
    """Return the mean L1 error of the transition model at every evaluation, over all transitions and over those observed, (L, 2).

    NaN where no model was recorded, the truth was not measured, or no transition was observed.
    """
    found = np.full((checkpoints, 2), np.nan)
    for n in range(checkpoints):
        if truth is not None and f"outcomes_{n}" in values:
            believed = _Beliefs(values[f"outcomes_{n}"].astype(np.intp), values[f"probabilities_{n}"])
            error, observed = l1(believed, truth), _observed(believed)
            found[n, 0] = np.nanmean(error)
            if np.isfinite(error[observed]).any():
                found[n, 1] = np.nanmean(error[observed])
    return found


def _observed(believed: _Beliefs) -> Array:
    """Return which transitions (S, A) of the model differ from those of a model without observations."""
    before = TransitionModel(reach_space()).debiased().probabilities
    changed: Array = (believed.probabilities[..., : before.shape[2]] != before).any(axis=2)
    return changed


def _row(variant: str, group: Runs) -> dict[str, Any]:
    checkpoints = group.actions.tolist()
    row: dict[str, Any] = {
        "variant": LABELS[variant],
        "problem-tries": estimate(group.tries, 0),
        "failed transitions": estimate(group.failed, 0),
    }
    for name, values, digits in (("score", group.scores, 2), ("L1 error", group.errors, 3)):
        known = {n: values[:, at] for at, n in enumerate(checkpoints) if np.isfinite(values[:, at]).all()}
        row |= {f"{name} after {n} actions": estimate(column, digits) for n, column in known.items()}
    if np.isfinite(group.errors[:, -1]).all():
        row[f"L1 error after {checkpoints[-1]} actions"] += _of_observed(group)
    return row


def plot(found: Cells) -> Any:
    """Draw the scores, and the L1 errors of the transition models, over the number of actions, a curve for each variant.

    Returns a matplotlib figure.
    """
    drawing = new_figure(12.0, 4.6)
    scores, errors = drawing.subplots(1, 2)
    for variant, group in runs_of(found).items():
        _curve(scores, group.actions, group.scores, variant)
        _curve(errors, group.actions, group.errors, variant)
    xlabel = "actions, with those before the first target"
    finish(scores, xlabel=xlabel, ylabel="score: sum of rewards of 27 targets", ylim=(0.0, None))
    finish(errors, legend=8, xlabel=xlabel, ylabel="mean L1 error of the transition model", yscale="log")
    return drawing


def _curve(axes: Any, actions: Ints, values: Array, variant: str) -> None:
    """Draw the interquartile mean and interval of the runs, at the evaluations that all of them have."""
    known = np.isfinite(values).all(axis=0)
    if known.any():
        draw_curve(axes, actions[known], values[:, known], COLORS[variant], LABELS[variant])


EXPERIMENT = Experiment(
    claim="transitions and reaches can be learned at the same time, if contact decides to which of them a failure belongs",
    source="thesis 9.4.1",
    method=Sweep(conditions, trial, findings, plot, add_options=add_options),
    claims=CLAIMS,
)
