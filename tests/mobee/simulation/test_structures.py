# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import ctypes

import numpy as np

from mobee._core import address
from mobee._core.plant import STRUCTURES, calls


def test_the_structures_of_the_core_are_as_long_as_those_of_python() -> None:
    sizes = np.zeros(len(STRUCTURES), dtype=np.int64)
    calls().sizes(address(sizes))
    assert sizes.tolist() == [s.itemsize if isinstance(s, np.dtype) else ctypes.sizeof(s) for s in STRUCTURES]
