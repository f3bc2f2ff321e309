"""What an observation was worth: how far it moved a distribution of counts (thesis 6.4.2, 6.4.3)."""

from __future__ import annotations

from math import log1p

import numpy as np
from numpy.typing import ArrayLike

from mobee.errors import InvalidValue


def kl_divergence(p: ArrayLike, t: ArrayLike) -> float:
    """KL(P || T) in nats of two distributions over the same bins, given as counts or probabilities (thesis eq. 6.5).

    `p`, `t`: shape (bins,), every component above zero (else it is undefined, thesis 6.4.2); they are normalised here.
    """
    new, old = np.asarray(p, dtype=np.float64), np.asarray(t, dtype=np.float64)
    if new.ndim != 1 or new.shape != old.shape or not len(new):
        raise InvalidValue(f"distributions of shapes {new.shape} and {old.shape}: give two vectors over the same bins.")
    if not ((new > 0).all() and (old > 0).all() and np.isfinite(new).all() and np.isfinite(old).all()):
        raise InvalidValue(f"KL divergence needs components above zero, given {new.tolist()} and {old.tolist()}: leave empty bins out.")
    new, old = new / new.sum(), old / old.sum()
    return float((new * np.log(new / old)).sum())


def information_gain(count: float, total: float) -> float:
    """KL(P || T) in nats when one bin of T grows by one: its count before, above 0, and that of all bins, at least `count`.

    The closed form of eq. 6.5 for this case: the other bins only share the factor total / (total + 1).
    """
    gain = (count + 1.0) / (total + 1.0) * log1p(1.0 / count) - log1p(1.0 / total)
    return max(0.0, gain)  # rounding
