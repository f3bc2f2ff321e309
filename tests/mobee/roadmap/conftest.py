# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest

import mobee


@pytest.fixture(scope="session")
def icub() -> mobee.Robot:
    return mobee.load_robot("icub")


@pytest.fixture(scope="session")
def free(icub: mobee.Robot) -> mobee.Model:
    """The iCub in an empty world."""
    return mobee.Model(icub)


@pytest.fixture(scope="session")
def postures(icub: mobee.Robot) -> np.ndarray:
    return np.random.default_rng(5).uniform(*icub.limits.T, (6, len(icub.motors)))
