"""Memory for what comes one by one and is asked about again."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from mobee.learning.bins import Scalar


def room_for(array: NDArray[Scalar], index: int) -> NDArray[Scalar]:
    """The array, or a copy twice as long where it has no such index."""
    return array if index < len(array) else np.concatenate([array, np.zeros_like(array)])


def forget(found: dict[bytes, Any], most: int) -> None:
    """Delete the entries that were put in first, so that there are fewer than `most`; who puts back what is used keeps the newest."""
    while len(found) >= most:
        del found[next(iter(found))]
