"""Our own explorer: it knows that what it will have tried is worth less."""

from __future__ import annotations

from functools import cache
from types import ModuleType

import numpy as np

from mobee.learning.explorable import Explorable
from mobee.learning.transitions import TransitionModel
from mobee.robot.robot import Array

EQUAL = 0.01  # of the largest gain: action values that differ by less are taken for equal, as the plan's tolerance is of that size
HORIZONS = 2.0  # how far the plan is followed, in units of 1 / (1 - discount)


def depleting(agent: Explorable, state: int, rng: np.random.Generator) -> Array:
    """Prefer the largest discounted gain to expect next; among equals, what leaves most to be learnt when the plan is done.

    'Curious' is paid the last gain of a state-action, this one what its next observation will be worth on average under
    debiased counts, which tells sooner that an action is certain; what was never tried pays what it was imagined to.
    Then the best plan is followed through its most likely outcomes, the gains met fall as they would, and a second plan
    values what is left: a state with one untried action is worth less than one with sixteen.  Both plans are made with
    the agent's beliefs.
    """
    model, actions = agent.model, len(agent.model.space.actions(state))
    beliefs, counts, totals = model.debiased(), *_next_counts(model)
    gains = model.reward.copy()
    _core().expected_gains(beliefs.table, counts, totals, model.tries, gains)
    _, action_values = agent.plan(gains, key="depleting")
    scores = action_values[state, :actions]
    equal = scores >= scores.max() - EQUAL * gains.max()
    if np.count_nonzero(equal) == 1:
        return scores
    left, steps = gains.copy(), round(HORIZONS / (1.0 - agent.discount))
    _core().deplete(beliefs.table, counts, totals, action_values, state, steps, left)
    _, afterwards = agent.plan(left, key="depleted")
    later = afterwards[state, :actions] - left[state, :actions]
    return np.where(equal, gains[state, :actions] + later, -np.inf)


def _next_counts(model: TransitionModel) -> tuple[Array, Array]:
    """The counts (S, A, B) and their totals (S, A) over which the next observation's gain will be taken."""
    real = np.where(model.counts > 0.0, model.counts - model.imagined, 0.0) * model.forgetting
    floor = model.imagined if model.divergence == "kail" else np.ones_like(model.imagined)
    forgotten = 0.0 if model.forgetting == 1.0 else (1.0 / model.forgetting - 1.0) * real.sum(axis=-1)
    return real + floor, model.totals - forgotten


@cache
def _core() -> ModuleType:
    """Loaded when it is first needed."""
    from mobee._core import observations

    return observations
