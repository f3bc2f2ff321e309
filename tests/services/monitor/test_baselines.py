# SPDX-License-Identifier: Apache-2.0
"""The simulated explorers, beside real ones."""

from __future__ import annotations

import json

import numpy as np
import pytest

from bus_schema.messages import Learned
from mobee import CuriousAgent, Lattice, TransitionModel, load_robot
from mobee.learning.tabular import TabularPlant, ideal
from services.agents.streams import surprises
from services.monitor.story.baselines import BASELINES, baselines, outcomes_of
from services.monitor.story.knowledge import knowledge_of
from tests.services.monitor.test_story import HEADER

SPACE = Lattice(load_robot("icub"), ["torso_yaw", "torso_roll", "torso_pitch"], neighbours=8)


def learned(model: TransitionModel) -> Learned:
    numbers = {"tries": model.tries.astype("<u4").tobytes(), "reward": model.reward.astype("<f4").tobytes()}
    numbers["value"] = numbers["reward"]
    settings = json.dumps(SPACE.settings)
    return Learned(**HEADER, agent="torso", n=int(model.tries.sum()), s=0, space=settings, surprises=surprises(model), **numbers)


def simulated(model: TransitionModel, transitions: int) -> dict[str, list[tuple[int, float, float]]]:
    known = knowledge_of(learned(model), SPACE)
    assert known is not None
    return baselines(outcomes_of(learned(model), known, SPACE), known.exists, 0, transitions)


@pytest.mark.parametrize("explorer", BASELINES)
def test_where_every_action_reaches_its_goal_they_try_as_much_as_real_agents(explorer: str) -> None:
    curve = simulated(TransitionModel(SPACE), 150)[explorer]
    real = []
    for seed in range(6):
        agent = CuriousAgent(SPACE, TabularPlant(SPACE, *ideal(SPACE), seed=seed), explorer=explorer, seed=seed)
        agent.run(150)
        real.append(float((agent.model.tries > 0).sum()) / SPACE.state_actions)
    assert curve[-1][0] == 150
    assert curve[-1][1] == pytest.approx(np.mean(real), abs=0.06)  # means of 4 and of 6 runs, each with a deviation of 0.03


def test_they_stay_in_a_state_that_no_action_leaves() -> None:
    model = TransitionModel(SPACE)
    for action in range(len(SPACE.actions(0))):
        for _ in range(5):
            model.observe(0, action, 0)
    for curve in simulated(model, 100).values():
        assert curve[-1][1] == pytest.approx(len(SPACE.actions(0)) / SPACE.state_actions, abs=1e-4)
        assert [tried for _, tried, _ in curve] == sorted(tried for _, tried, _ in curve)
