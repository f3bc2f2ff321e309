# SPDX-License-Identifier: Apache-2.0
"""An explorer from outside the library, for the agent that is started with it."""

from __future__ import annotations

import numpy as np

from mobee.arrays import Array
from mobee.learning.explorers import Explorable


def last_action(agent: Explorable, state: int, rng: np.random.Generator) -> Array:
    """Prefer the last action of each state."""
    return np.arange(float(len(agent.model.space.actions(state))))
