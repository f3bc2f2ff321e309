# SPDX-License-Identifier: Apache-2.0
"""Predictors of the rewards of reaching, by name."""

from collections.abc import Callable
from functools import partial

from mobee.learning.reaching.predictors.gaussian_process import GaussianProcess
from mobee.learning.reaching.predictors.local_averages import Kernel, Nearest, Table, Weighted
from mobee.learning.reaching.predictors.networks import Networks
from mobee.learning.reaching.predictors.predictor import RewardPredictor
from mobee.learning.reaching.reaches import Reaches

__all__ = ["PREDICTORS", "PredictorOf", "Reaches", "RewardPredictor"]

PredictorOf = Callable[[Reaches], RewardPredictor]
"""A class or function that makes the predictor of a learner from its reaches."""

PREDICTORS: dict[str, PredictorOf] = {
    "weighted": Weighted,
    "table": Table,
    "kernel": Kernel,
    "kernel_prior": partial(Kernel, prior=True),
    "nearest": Nearest,
    "networks": Networks,
    "gp": GaussianProcess,
}
"""By name, the class or function that makes a predictor that has not observed any reach."""
