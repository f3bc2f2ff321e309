"""How unevenly something is distributed."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike


def relative_spread(counts: ArrayLike) -> float:
    """Standard deviation over mean; 0 when all are equal."""
    given = np.asarray(counts, dtype=np.float64)
    return float(given.std() / given.mean())


def gini(counts: ArrayLike) -> float:
    """The Gini coefficient of numbers of 0 or more: 0 when all are equal, 1 - 1/n when one has everything."""
    ordered = np.sort(np.asarray(counts, dtype=np.float64))
    ranks = np.arange(1, len(ordered) + 1)
    return float(2.0 * (ranks * ordered).sum() / (len(ordered) * ordered.sum()) - (len(ordered) + 1) / len(ordered))
