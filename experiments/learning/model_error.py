"""How far what an agent believes of its actions is from the truth."""

from __future__ import annotations

import numpy as np

from experiments.learning.truth import Truth
from mobee.learning.value_iteration import OutcomeModel
from mobee.robot.robot import Array

CERTAIN = 0.9  # of the most likely outcome: actions below are stochastic


def l1(beliefs: OutcomeModel, truth: OutcomeModel) -> Array:
    """The sum of |p - q| over the outcomes of each state-action, 0 to 2, shape (S, A); NaN where the truth is not known.

    Bins of the two may differ in order and number, and several may be of one state.
    """
    states, actions = truth.outcomes.shape[:2]
    pair = np.arange(states * actions)[:, None]
    keys, signed = [], []
    for model, sign in ((beliefs, 1.0), (truth, -1.0)):
        probabilities = model.probabilities.reshape(states * actions, -1)
        keys.append((pair * states + model.outcomes.reshape(probabilities.shape))[probabilities > 0.0])
        signed.append(sign * probabilities[probabilities > 0.0])
    found, index = np.unique(np.concatenate(keys), return_inverse=True)
    difference = np.abs(np.bincount(index, weights=np.concatenate(signed)))
    error = np.bincount(found // states, weights=difference, minlength=states * actions).reshape(states, actions)
    return np.where(truth.probabilities.any(axis=-1), error, np.nan)


def most_likely(truth: OutcomeModel) -> Array:
    """The probability of each action's most likely outcome, shape (S, A); NaN where the truth is not known."""
    highest: Array = truth.probabilities.max(axis=-1)
    return np.where(highest > 0.0, highest, np.nan)


def model_error(beliefs: OutcomeModel, truth: OutcomeModel) -> tuple[float, float]:
    """Mean L1 over all state-actions, and over the stochastic ones: those whose most likely outcome has less than .9 (NaN: none)."""
    error = l1(beliefs, truth)
    stochastic = most_likely(truth) < CERTAIN
    return float(np.nanmean(error)), float(error[stochastic].mean()) if stochastic.any() else float("nan")


def sampling_error(truth: Truth) -> Array:
    """The L1 distance to be expected between these frequencies and the distribution they were drawn from, shape (S, A); NaN untried.

    The sum over the outcomes of the mean absolute deviation of a share p of n tries, sqrt(2 p (1 - p) / (pi n)): no model can be
    measured to be truer than that.
    """
    p = truth.probabilities
    with np.errstate(invalid="ignore", divide="ignore"):
        error: Array = np.sqrt(2.0 * p * (1.0 - p) / (np.pi * truth.tries[..., None])).sum(axis=-1)
    return error
