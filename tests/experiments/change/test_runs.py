from __future__ import annotations

import numpy as np
import pytest

from experiments.change.runs import EVERY, SOON, Run
from experiments.kit.arm_learning import arm_space

LOOKS = 4 * SOON // EVERY  # half of them before the change


def a_run(errors):
    """Before the change nothing that changed is tried, afterwards nothing else."""
    changed = np.zeros(arm_space().goals.shape, dtype=bool)
    changed[0, 0] = True
    seen = np.zeros((LOOKS * EVERY, 3), dtype=int)
    seen[: len(seen) // 2, 1] = 1
    series = np.ones((LOOKS, 4))
    series[LOOKS // 2 :, 0] = errors
    series[LOOKS // 2 :, 2] = 3.0
    return Run(seen, series, 2.0, changed, ~changed)


def test_tries_are_over_the_mean_of_all_actions():
    run = a_run(np.ones(LOOKS // 2))
    assert run.eagerness_before == 0.0
    assert run.eagerness == pytest.approx(arm_space().state_actions)
    assert run.value_jump == pytest.approx(3.0) and run.value_jump_before == pytest.approx(1.0)


def test_half_of_the_error_at_the_change_is_gone_or_never_is():
    errors = np.linspace(1.8, 0.0, LOOKS // 2)
    assert a_run(errors).relearned == EVERY * (np.flatnonzero(errors <= 1.0)[0] + 1)
    assert a_run(np.full(LOOKS // 2, 1.5)).relearned == np.inf


def test_what_is_gone_by_the_first_look_counts():
    assert a_run(np.full(LOOKS // 2, 0.9)).relearned == EVERY
