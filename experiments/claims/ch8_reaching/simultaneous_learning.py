"""Learning the transitions and the reaches at the same time, from nothing, against the transitions first.

Claim: there is no reason that the transition model and the reaches cannot be learned simultaneously; where an action fails, contact with
a workspace object tells a negative reward of the problem from an update of the model.
Source: thesis 9.4.1 (future work).  Published: no numbers.  Run time: five minutes on 2 cores.

The right arm under the published law and the 27 targets, as in `reach-exploration`; a quick learner of `reach-predictors` (--learner).
All have the same total of actions, reaches included and evaluations not.  "contact": both at once, failures attributed by contact.
"first-3000", "first-1000": so many curious transitions without targets, as the thesis did it, then reaches; the model is changed no more.
"model": both at once, and every transition is an update of the model, as if no contact were felt.  "target": both at once, and every
transition that does not end in its goal is attributed to the target, so that the model is updated by successes alone.
A score is the sum of the rewards of the 27 targets in one evaluation.  The error of a model is the mean L1 distance, 0 to 2, of its beliefs
without imagined outcomes to the outcomes of walks without targets.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Literal

import numpy as np

from experiments.kit.experiment import Claim, Experiment
from experiments.kit.learning.exploration import begin_anywhere
from experiments.kit.learning.truth import Truth, l1, truth_of, walk
from experiments.kit.plots import draw_curve, new_figure
from experiments.kit.reaching.arm import MARKER, learned_beliefs, reach_plant, reach_space
from experiments.kit.reaching.learning import LEARNERS
from experiments.kit.reaching.targets import grid, targets_at
from experiments.kit.statistics import all_hold, decides, estimate, interval, rises
from experiments.kit.sweep import Cells, Condition, Sweep, grouped
from mobee import TransitionModel
from mobee.arrays import Array, Ints
from mobee.learning.reaching.reach_agent import ReachAgent
from mobee.learning.space import Space
from mobee.learning.value_iteration import OutcomeModel
from mobee.plant import Outcome
from mobee.reach import TARGET, ReachOutcome, ReachPlant, ReachTarget

CHECKPOINTS = (500, 1000, 1500, 2000, 3000, 3500, 4000)  # actions after which everybody is evaluated
QUICK = (500, 1000, 2000)
LEARNER = "kernel-ucb"  # costs less than the plant; "gp-ucb-alike" many times that
REPETITIONS = 2  # of an evaluation
WALKS = (9001, 9002)  # seeds that no learner has
TRIES, LONGEST_WALK = 20, 20_000  # of each transition in a walk; actions
WALK = "walk"
Blame = Literal["model", "target"]
BLAMES: tuple[Blame, ...] = ("model", "target")
FIRST = {"first-3000": 3000, "first-1000": 1000}  # curious transitions before the first target
CONTACT = "contact"
VARIANTS = (CONTACT, *FIRST, *BLAMES)

SHARE = 0.9  # of the score that model first ends with: the score that both are to come to
EVEN = 0.05  # of that score: as much below still counts as equal

_SOURCE = "thesis 9.4.1"
SOONER = {
    variant: Claim(
        _SOURCE, f"model and reaches at once need no more actions to {SHARE:.0%} of the final score of {start} first", "no number"
    )
    for variant, start in (("first-3000", "3000 curious transitions"), ("first-1000", "1000 curious transitions"))
}
LEVEL = Claim(
    _SOURCE,
    f"with the same total of actions they end with no lower score than the better of these (at most {EVEN:.0%} below)",
    "no number",
)
CLEAN = Claim(_SOURCE, "contact keeps the model clean: its error is smaller than if all failures are the model's", "no number")
HEARD = Claim(_SOURCE, "the reaches are better than if all failures are the target's", "no number")
CLAIMS = (*SOONER.values(), LEVEL, CLEAN, HEARD)


COLORS = {"contact": "tab:red", "first-3000": "tab:blue", "first-1000": "tab:cyan", "model": "tab:orange", "target": "0.4"}
LABELS = {
    "contact": "at once, by contact",
    "first-3000": "model first, 3000 transitions",
    "first-1000": "model first, 1000 transitions",
    "model": "at once, all is the model's fault",
    "target": "at once, failures are the target's fault",
}


def add_options(parser: argparse.ArgumentParser) -> None:
    """Options besides those of all sweeps."""
    parser.add_argument(
        "--learner", choices=list(LEARNERS), default=LEARNER, metavar="NAME", help=f"one of {', '.join(LEARNERS)} (default: {LEARNER})"
    )


def conditions(arguments: argparse.Namespace) -> list[Condition]:
    """The walks that find the truth, and every variant of learning."""
    checkpoints = list(QUICK if arguments.quick else CHECKPOINTS)
    variants = [Condition(variant, {"way": variant, "learner": arguments.learner, "looks": checkpoints}) for variant in VARIANTS]
    return [Condition("truth", {"way": WALK}, 2.0, WALKS), *variants]


def trial(settings: dict[str, Any], seed: int) -> dict[str, Any]:
    """Walk, the record `seen` (T, 3); or learn, with an evaluation after so many actions.

    Returns of a learner `scores` (L, R), of the L evaluations with R repetitions, NaN before the first target; `tries` and `failed` (L,),
    problem-tries and failed transitions so far; and of evaluation n `outcomes_n` and `probabilities_n` (S, A, B), its transition model.
    """
    if settings["way"] == WALK:
        return {"seen": walk(reach_space(), reach_plant, TRIES, LONGEST_WALK, seed).astype(np.uint16)}
    agent, beliefs, before = _agent(settings["way"], settings["learner"], seed)
    problems, checkpoints = targets_at(grid()), settings["looks"]
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
    """The learner, its transition model, and the number of actions spent on it before the first target."""
    chosen, space, arm = LEARNERS[learner], reach_space(), reach_plant(seed)
    agent = partial(
        ReachAgent, space, marker=MARKER, predictor=chosen.predictor, strategy=chosen.strategy, failures=chosen.failures, seed=seed
    )
    if variant in FIRST:
        beliefs = learned_beliefs(arm, seed, FIRST[variant])
        return agent(plant=arm, beliefs=beliefs), beliefs, FIRST[variant]
    begin_anywhere(space, arm, seed)
    plant: ReachPlant = next((BlamingPlant(arm, space, blame) for blame in BLAMES if blame == variant), arm)
    model = TransitionModel(space)
    return agent(plant=plant, model=model), model.debiased(), 0


class BlamingPlant:
    """A plant with false contacts: none, or the target's wherever a transition does not end in its goal.

    Args:
        plant: the true one.
        space: its states and transitions.
        blame: "model" or "target".
    """

    def __init__(self, plant: ReachPlant, space: Space, blame: Blame) -> None:
        self.inner, self.robot, self._space, self._blame = plant, plant.robot, space, blame

    def measure(self, part: str) -> Array:
        """See Plant."""
        return self.inner.measure(part)

    def act(self, part: str, target: Array) -> Outcome:
        """See Plant; with the false contacts."""
        outcome = self.inner.act(part, target)
        arrived = self._state(outcome.q) == self._state(target)
        return replace(outcome, touched=() if self._blame == "model" or arrived else (TARGET,))

    def present(self, target: ReachTarget | None) -> None:
        """See ReachPlant."""
        self.inner.present(target)

    def reach(self, part: str, marker: str, stay: bool = False) -> ReachOutcome:
        """See ReachPlant."""
        return self.inner.reach(part, marker, stay)

    def _state(self, q: Array) -> int:
        return self._space.state_of(q[self._space.columns])


@dataclass(frozen=True, slots=True, eq=False)
class Runs:
    """The N runs of one variant of learning: `scores` and `errors` (N, L) after so many `actions` (L,); NaN: not evaluated.

    `observed`: as `errors`, of those transitions alone that the model has observed.  `tries`, `failed`: (N,) problem-tries and failed
    transitions.
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
    """A row a variant, and the claims once every variant has runs."""
    runs = runs_of(found)
    results: dict[str, Any] = {"ways": [_row(variant, mine) for variant, mine in runs.items()]}
    if set(runs) == set(VARIANTS):
        results["claims"] = [claim.record() for claim in measured(runs)]
    return results


def runs_of(found: Cells) -> dict[str, Runs]:
    """The runs by variant, in the order of the seeds."""
    walks = [values["seen"] for values in grouped(found, "way", [WALK]).get(WALK, [])]
    truth = truth_of(reach_space(), np.concatenate(walks).astype(np.intp)) if walks else None
    checkpoints_of = {one.cell.settings["way"]: one.cell.settings.get("looks", []) for one in found.values()}
    runs = {}
    for variant, group in grouped(found, "way", VARIANTS).items():
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


def measured(runs: Mapping[str, Runs]) -> list[Claim]:
    """The claims with our numbers; open where the run is too short for an evaluation of every variant."""
    contact = runs[CONTACT]
    ends = {variant: mine.scores[:, -1] for variant, mine in runs.items()}
    if not all(np.isfinite(scores).all() for scores in ends.values()):
        return list(CLAIMS)
    found = []
    for variant, claim in SOONER.items():
        least = SHARE * float(ends[variant].mean())
        ours, theirs = (actions_to(least, one.actions, one.scores) for one in (contact, runs[variant]))
        text = f"{_actions_text(ours)} against {_actions_text(theirs)} actions to a score of {least:.1f}"
        found.append(claim.measured(text, no_more(ours, theirs)))
    text = "score " + ", ".join(f"{variant} {estimate(ends[variant])}" for variant in (CONTACT, *FIRST))
    found.append(LEVEL.measured(text, level(ends[CONTACT], [ends[variant] for variant in FIRST])))
    errors = {variant: runs[variant].errors[:, -1] for variant in (CONTACT, "model", "target")}
    text = "L1 " + ", ".join(f"{variant} {estimate(values, 3)}{_of_observed(runs[variant])}" for variant, values in errors.items())
    found.append(CLEAN.measured(text, rises(errors["model"] - errors[CONTACT])))
    text = "score " + ", ".join(f"{variant} {estimate(ends[variant])}" for variant in (CONTACT, "target", "model"))
    found.append(HEARD.measured(text, rises(ends[CONTACT] - ends["target"])))
    return found


def _actions_text(needed: Array) -> str:
    never = int(np.isinf(needed).sum())
    return f"never in {never} of {len(needed)} runs" if never else estimate(needed, 0)


def _of_observed(mine: Runs) -> str:
    last = mine.observed[:, -1]
    return f" ({estimate(last, 3)} of transitions observed)" if np.isfinite(last).all() else ""


def actions_to(least: float, actions: Ints, scores: Array) -> Array:
    """The number of actions at which each run's scores (N, L) reach `least`, interpolated linearly, (N,); inf if never."""
    found = np.full(len(scores), np.inf)
    for n, mine in enumerate(scores):
        enough = np.flatnonzero(mine >= least)
        if len(enough):
            at = enough[0]
            known = at > 0 and np.isfinite(mine[at - 1])
            found[n] = np.interp(least, mine[at - 1 : at + 1], actions[at - 1 : at + 1]) if known else actions[at]
    return found


def no_more(ours: Array, theirs: Array) -> bool | None:
    """Whether our runs (N,) need at most as many actions as theirs of the same seeds.

    None where the interval leaves that open, and where a run never reached the score: the number that it needs was not measured.
    """
    if not np.isfinite([ours, theirs]).all():
        return None
    return decides(interval(ours - theirs), most=0.0)


def level(ours: Array, theirs: Sequence[Array]) -> bool | None:
    """Whether our scores (N,) are at most EVEN below each of theirs; False if they are farther below one of them."""
    return all_hold(decides(interval(ours - other), least=-EVEN * float(other.mean())) for other in theirs)


def _errors(values: Mapping[str, Any], checkpoints: int, truth: Truth | None) -> Array:
    """The mean L1 of the transition model at every evaluation: of all transitions, and of those observed, (L, 2).

    NaN where no model was kept, no truth is known, or no transition was observed.
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
    """Which transitions (S, A) of the model differ from those of one without observations."""
    before = TransitionModel(reach_space()).debiased().probabilities
    changed: Array = (believed.probabilities[..., : before.shape[2]] != before).any(axis=2)
    return changed


def _row(variant: str, mine: Runs) -> dict[str, Any]:
    row: dict[str, Any] = {
        "way": variant,
        "problem-tries": estimate(mine.tries, 0),
        "failed transitions": estimate(mine.failed, 0),
    }
    for n, checkpoint in enumerate(mine.actions.tolist()):
        if np.isfinite(mine.scores[:, n]).all():
            row[f"score at {checkpoint}"] = estimate(mine.scores[:, n])
    for n, checkpoint in enumerate(mine.actions.tolist()):
        if np.isfinite(mine.errors[:, n]).all():
            row[f"L1 at {checkpoint}"] = estimate(mine.errors[:, n], 3) + (_of_observed(mine) if n == len(mine.actions) - 1 else "")
    return row


def plot(found: Cells) -> Any:
    """Scores and errors of the models against actions."""
    drawing = new_figure(12.0, 4.6)
    scores, errors = drawing.subplots(1, 2)
    for variant, mine in runs_of(found).items():
        _curve(scores, mine.actions, mine.scores, variant)
        _curve(errors, mine.actions, mine.errors, variant)
    scores.set(xlabel="actions, the model's included", ylabel="cumulative reward, 27 targets", ylim=(0.0, None))
    errors.set(xlabel="actions", ylabel="mean L1 of the transition model", yscale="log")
    errors.legend(fontsize=8)
    for axes in (scores, errors):
        axes.grid(alpha=0.2)
    return drawing


def _curve(axes: Any, actions: Ints, values: Array, variant: str) -> None:
    """Interquartile mean and interval of the runs, at the evaluations that all of them have."""
    known = np.isfinite(values).all(axis=0)
    if known.any():
        draw_curve(axes, actions[known], values[:, known], COLORS[variant], LABELS[variant])


EXPERIMENT = Experiment(
    name="simultaneous-learning",
    claim="transitions and reaches can be learned at the same time, if contact tells whose fault a failure is",
    source="thesis 9.4.1",
    notes=__doc__,
    method=Sweep(conditions, trial, findings, plot, add_options=add_options),
    claims=CLAIMS,
)
