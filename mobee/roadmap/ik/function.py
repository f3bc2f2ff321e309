"""A user's function of a pose, or of pose and contacts."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from mobee.errors import InvalidValue
from mobee.pose import Pose
from mobee.robot.robot import Array

Plain = Callable[..., ArrayLike]


class Function:
    """Calls a user's function with all poses of a batch and their table of contacts, or pose by pose with a tuple of contacts.

    `contacts`: False for a function of the pose alone.
    Which of the two it was written for is found out at the first call: batches that give what the poses give one by one.
    """

    def __init__(self, function: Plain, contacts: bool = True) -> None:
        self._function = function
        self._contacts = contacts
        self._takes_batches: bool | None = None

    def __call__(self, pose: Pose) -> Array:
        """What it says of the poses q (N, n), (N,)."""
        if self._takes_batches is None:
            singly = self._singly(pose)
            self._takes_batches = self._agrees(pose, singly)
            return singly
        if not self._takes_batches:
            return self._singly(pose)
        return self._called(pose, single=False)

    def _singly(self, pose: Pose) -> Array:
        found = [self._called(one, single=True) for one in pose.each()]
        if any(value.shape != () for value in found):
            raise InvalidValue(f"a function returned shape {found[0].shape} for one pose; it must return one number.")
        return np.array(found)

    def _called(self, pose: Pose, single: bool) -> Array:
        felt = () if not self._contacts else (pose.contacts,) if single else (pose.table,)
        return np.asarray(self._function(pose, *felt), dtype=np.float64)

    def _agrees(self, pose: Pose, singly: Array) -> bool:
        try:
            together = self._called(pose, single=False)
        except Exception:  # whatever it raises: it has just worked pose by pose, so it was written for one pose
            return False
        return together.shape == singly.shape and np.allclose(together, singly, rtol=1e-9, atol=1e-12, equal_nan=True)
