"""A user's function of pose and contacts."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from mobee.errors import InvalidValue
from mobee.pose import Pose
from mobee.robot.robot import Array

Plain = Callable[[Pose, Any], ArrayLike]


class Function:
    """Calls a user's function with all poses of a batch and their table of contacts, or pose by pose with a tuple of contacts.

    Which of the two it was written for is found out at the first call: batches that give what the poses give one by one.
    """

    def __init__(self, function: Plain) -> None:
        self._function = function
        self._takes_batches: bool | None = None

    def __call__(self, pose: Pose) -> Array:
        """What it says of the poses q (N, n), (N,)."""
        if self._takes_batches is None:
            singly = self._singly(pose)
            self._takes_batches = self._agrees(pose, singly)
            return singly
        if not self._takes_batches:
            return self._singly(pose)
        return np.asarray(self._function(pose, pose.table), dtype=np.float64)

    def _singly(self, pose: Pose) -> Array:
        found = [np.asarray(self._function(one, one.contacts), dtype=np.float64) for one in pose.each()]
        if any(value.shape != () for value in found):
            raise InvalidValue(f"a cost returned shape {found[0].shape} for one pose; it must return one number.")
        return np.array(found)

    def _agrees(self, pose: Pose, singly: Array) -> bool:
        try:
            together = np.asarray(self._function(pose, pose.table), dtype=np.float64)
        except Exception:  # whatever it raises: it has just worked pose by pose, so it was written for one pose
            return False
        return together.shape == singly.shape and np.allclose(together, singly, rtol=1e-9, atol=1e-12, equal_nan=True)
