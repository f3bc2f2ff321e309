"""Predictors of the rewards of reaching, by name."""

from collections.abc import Callable
from functools import partial

from mobee.learning.reaching.predictors.gaussian_process import GaussianProcess
from mobee.learning.reaching.predictors.kernel import Kernel
from mobee.learning.reaching.predictors.nearest import Nearest
from mobee.learning.reaching.predictors.networks import Networks
from mobee.learning.reaching.predictors.predictor import Reaches, RewardPredictor
from mobee.learning.reaching.predictors.table import Table
from mobee.learning.reaching.predictors.thesis import Weighted

__all__ = ["PREDICTORS", "Reaches", "RewardPredictor"]

PREDICTORS: dict[str, Callable[[Reaches], RewardPredictor]] = {
    "weighted": Weighted,
    "table": Table,
    "kernel": Kernel,
    "kernel_prior": partial(Kernel, prior=True),
    "nearest": Nearest,
    "networks": Networks,
    "gp": GaussianProcess,
}
"""Name -> maker of a predictor that has seen nothing yet."""
