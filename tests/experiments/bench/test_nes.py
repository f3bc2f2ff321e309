# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import sys

import numpy as np
import pytest

from experiments.bench.nes import FUNCTIONS, Settings, measure
from mobee.errors import NotInstalled


@pytest.mark.parametrize("name", FUNCTIONS)
def test_every_function_is_zero_at_its_optimum_alone(name: str) -> None:
    best = np.ones(5) if name == "Rosenbrock" else np.zeros(5)
    costs = FUNCTIONS[name](best + np.concatenate([np.zeros((1, 5)), 0.1 * np.eye(5)]))
    assert costs[0] == 0.0 and (costs[1:] > 0.0).all()


def test_without_cma_it_names_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "cma", None)
    with pytest.raises(NotInstalled, match=r"\[bench\]"):
        measure(Settings())
