"""Predictors of the rewards of reaching, by name."""

from collections.abc import Callable

from mobee.learning.reaching.predictors.predictor import Reaches, RewardPredictor
from mobee.learning.reaching.predictors.thesis import Weighted

__all__ = ["PREDICTORS", "Reaches", "RewardPredictor"]

PREDICTORS: dict[str, Callable[[Reaches], RewardPredictor]] = {"weighted": Weighted}
"""Name -> maker of a predictor that has seen nothing yet."""
