from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from experiments.simultaneous.blame import BlamingPlant
from mobee import TransitionModel
from mobee.plant import Outcome
from mobee.reach import TARGET
from tests.mobee.learning.reaching import toy


class Stuck:
    """Goes half of the way, and touches what it is told to touch."""

    robot = None

    def __init__(self, touched, share):
        self.touched, self.share = touched, share

    def act(self, part, target):
        return Outcome(self.share * target, settled=True, duration=1.0, touched=self.touched)


SPACE = SimpleNamespace(columns=np.array([0]), state_of=lambda q: round(float(q[0])))


@pytest.mark.parametrize("touched", [(), (TARGET,)])
@pytest.mark.parametrize(("share", "told"), [(1.0, ()), (0.5, (TARGET,))])
def test_who_blames_the_target_has_touched_it_wherever_a_transition_fails(touched, share, told):
    plant = BlamingPlant(Stuck(touched, share), SPACE, "target")
    assert plant.act("arm", np.array([4.0])).touched == told


@pytest.mark.parametrize("share", [1.0, 0.5])
def test_who_blames_the_model_has_touched_nothing(share):
    plant = BlamingPlant(Stuck((TARGET,), share), SPACE, "model")
    outcome = plant.act("arm", np.array([4.0]))
    assert outcome.touched == () and outcome.q.tolist() == [4.0 * share]


def learned(blame):
    """Transitions that the model has observed and that failed, and those remembered as failures, of a learner on a toy."""
    model, arm = TransitionModel(toy.SPACE), toy.plant(0)
    on = arm if blame is None else BlamingPlant(arm, toy.SPACE, blame)
    agent = toy.agent(0, on=on, model=model, strategy="random", failures="local")
    agent.learn(toy.TARGETS, 60)
    stayed = (model.counts[:, :, 0] - model.imagined[0] > 0.0).sum()
    return stayed, sum((agent.failures.rewards(target.position) < 0.0).sum() for target in toy.TARGETS)


def test_whose_fault_a_failure_is_decides_what_learns_of_it():
    (by_contact, remembered), (models, none), (of_target, most) = learned(None), learned("model"), learned("target")
    assert by_contact == of_target == none == 0  # where targets alone block, contact and blaming the target are the same
    assert models > 10 and remembered > 10 and most > 10
