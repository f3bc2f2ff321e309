from __future__ import annotations

import numpy as np
import pytest

from mobee.learning.agent import CuriousAgent
from mobee.learning.explorers import dirichlet
from tests.mobee.learning.toys import InstantPlant, arm


def test_drawn_probabilities_have_the_mean_and_spread_of_the_dirichlet_distribution():
    counts = np.array([2.0, 3.0, 1.0, 0.0])
    drawn = dirichlet(np.tile(counts, (200_000, 1)), np.random.default_rng(0).standard_normal((200_000, 4)))
    total = counts.sum()
    assert drawn.sum(axis=-1) == pytest.approx(1.0)
    assert (drawn[:, 3] == 0.0).all()
    assert drawn.mean(axis=0) == pytest.approx(counts / total, abs=0.01)
    assert drawn.var(axis=0) == pytest.approx(counts * (total - counts) / total**2 / (total + 1.0), abs=0.003)


def test_where_there_is_no_action_there_is_no_probability():
    assert not dirichlet(np.zeros((2, 3)), np.ones((2, 3))).any()


def beliefs_of(agent, monkeypatch):
    """The probabilities that the agent's next decision is made with."""
    seen = []
    plan = agent.plan
    monkeypatch.setattr(agent, "plan", lambda *asked, **key: seen.append(asked[1].probabilities) or plan(*asked, **key))
    agent.decide(agent.state)
    monkeypatch.undo()
    return seen[0]


def test_a_world_is_held_for_an_episode_and_then_drawn_anew(monkeypatch):
    space = arm(neighbours="equidistant")
    agent = CuriousAgent(space, InstantPlant(space.robot), "posterior_sampling")
    before = [beliefs_of(agent, monkeypatch)]
    for _ in range(10):
        agent.step()
        before.append(beliefs_of(agent, monkeypatch))
    same = [(after == first).all(axis=-1).mean() for first, after in zip(before, before[1:], strict=False)]
    assert min(same[:9]) > 0.99  # all but the state-action just observed
    assert same[9] < 0.5


def test_an_outcome_never_seen_before_changes_its_own_state_action_alone(monkeypatch):
    space = arm(neighbours="equidistant")
    agent = CuriousAgent(space, InstantPlant(space.robot), "posterior_sampling")
    before = beliefs_of(agent, monkeypatch)
    agent.model.observe(5, 0, 80)
    after = beliefs_of(agent, monkeypatch)
    changed = (after[:, :, :2] != before).any(axis=-1)
    assert np.argwhere(changed).tolist() == [[5, 0]]
    assert after[5, 0, 2] > 0
