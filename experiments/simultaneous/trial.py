"""One learner with a number of actions, looked at in between."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np

from experiments.kit.reaching.arm import MARKER, learned_beliefs, reach_plant, reach_space
from experiments.kit.reaching.learning import LEARNERS
from experiments.kit.reaching.targets import grid, targets_at
from experiments.learning.trial import begin_anywhere
from experiments.simultaneous.blame import BLAMES, BlamingPlant
from mobee import TransitionModel
from mobee.learning.reaching.reach_agent import ReachAgent
from mobee.learning.value_iteration import OutcomeModel
from mobee.reach import ReachPlant

FIRST = {"first-3000": 3000, "first-1000": 1000}  # curious transitions before the first target
CONTACT = "contact"
WAYS = (CONTACT, *FIRST, *BLAMES)


def trial(way: str, learner: str, looks: Sequence[int], repetitions: int, seed: int) -> dict[str, Any]:
    """Let one learn, and look at it after so many actions.

    Returns `scores` (L, R), of the L looks with R repetitions, NaN before the first target; `tries` and `failed` (L,), problem-tries
    and failed transitions so far; and of look n `outcomes_n` and `probabilities_n` (S, A, B), what is believed of the transitions.
    """
    agent, beliefs, before = _agent(way, learner, seed)
    problems = targets_at(grid())
    found: dict[str, Any] = {}
    scores, counts, failed = np.full((len(looks), repetitions), np.nan), np.zeros((len(looks), 2), dtype=np.intp), 0
    for n, look in enumerate(looks):
        while before + agent.steps < look:
            agent.learn(problems, 1)
            assert agent.last is not None
            failed += agent.last.failures
        if look >= before:
            scores[n] = agent.evaluate(problems, repetitions).scores
        counts[n] = agent.tries, failed
        if look >= before:
            found[f"outcomes_{n}"], found[f"probabilities_{n}"] = beliefs.outcomes.astype(np.int16), beliefs.probabilities.copy()
    return found | {"scores": scores, "tries": counts[:, 0], "failed": counts[:, 1]}


def _agent(way: str, learner: str, seed: int) -> tuple[ReachAgent, OutcomeModel, int]:
    """The learner, what it believes of its transitions, and how many actions that has taken."""
    chosen, space, arm = LEARNERS[learner], reach_space(), reach_plant(seed)
    agent = partial(
        ReachAgent, space, marker=MARKER, predictor=chosen.predictor, strategy=chosen.strategy, failures=chosen.failures, seed=seed
    )
    if way in FIRST:
        beliefs = learned_beliefs(arm, seed, FIRST[way])
        return agent(plant=arm, beliefs=beliefs), beliefs, FIRST[way]
    begin_anywhere(space, arm, seed)
    plant: ReachPlant = next((BlamingPlant(arm, space, blame) for blame in BLAMES if blame == way), arm)
    model = TransitionModel(space)
    return agent(plant=plant, model=model), model.debiased(), 0
