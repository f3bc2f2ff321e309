from __future__ import annotations

import numpy as np
import pytest

from experiments import change
from experiments.change.runs import EVERY
from experiments.kit.arm_learning import arm_space
from experiments.kit.cells import Cell
from experiments.kit.truth import l1, truth_of
from mobee import TransitionModel
from mobee.errors import InvalidValue


def all_succeed(but=()):
    """Every action once, to its goal, but for some (state, action), which stay where they are."""
    space = arm_space()
    return truth_of(space, np.array([[s, a, s if (s, a) in but else space.goals[s, a]] for s, a in np.argwhere(space.goals >= 0).tolist()]))


def cell(transitions):
    return Cell("short", 0, {"change": "object", "explorer": "curious", "forgetting": 1.0, "transitions": transitions})


def test_the_error_at_the_change_is_that_of_a_model_that_knows_nothing_of_it(monkeypatch):
    before, after = all_succeed(), all_succeed({(0, 0), (40, 1), (80, 0)})
    monkeypatch.setattr(change, "_truths", lambda name: (before, after))
    values = change.work(cell(EVERY))
    model = TransitionModel(arm_space())
    for s, a, reached in values["seen"][:EVERY].tolist():
        model.observe(s, a, reached)
    assert values["changed"].sum() == 3
    assert values["at_change"] == pytest.approx(l1(model.debiased(), after)[values["changed"]].mean())


def test_a_change_of_no_action_is_refused(monkeypatch):
    monkeypatch.setattr(change, "_truths", lambda name: (all_succeed(), all_succeed()))
    with pytest.raises(InvalidValue, match="make it larger"):
        change.work(cell(EVERY))
