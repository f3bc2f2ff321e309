"""Arrays whose last axis is the bins of a state-action."""

from __future__ import annotations

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

Scalar = TypeVar("Scalar", bound=np.generic)


def widened(array: NDArray[Scalar]) -> NDArray[Scalar]:
    """A copy with room for one more bin, zero."""
    return np.pad(array, [(0, 0)] * (array.ndim - 1) + [(0, 1)])


def read_only(array: NDArray[Scalar]) -> NDArray[Scalar]:
    """A view that cannot be written to."""
    view = array.view()
    view.setflags(write=False)
    return view
