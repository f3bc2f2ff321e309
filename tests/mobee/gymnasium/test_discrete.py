# SPDX-License-Identifier: Apache-2.0
"""The curious agent on Gymnasium's environments, and the small ones that come with the library."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import mobee
from mobee.gymnasium import EnvPlant
from mobee.store import TransitionStore


@pytest.mark.parametrize("name", ["MoBeE/RiverSwim-v0", "MoBeE/DeepSea-v0"])
def test_gymnasium_finds_nothing_wrong(name: str) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(gymnasium.make(name).unwrapped)


def explored(name: str, steps: int, explorer: str = "curious", **options: Any) -> tuple[EnvPlant, mobee.CuriousAgent]:
    plant = EnvPlant(gymnasium.make(name, **options), seed=0)
    agent = mobee.CuriousAgent(plant.space, plant, explorer, beliefs="debiased")
    agent.run(steps)
    return plant, agent


def test_curiosity_tries_everything_in_the_deep_sea_and_chance_does_not() -> None:
    plant, agent = explored("MoBeE/DeepSea-v0", 600)
    assert (agent.model.tries > 0).all() and max(plant.returns) == pytest.approx(0.99)
    _, random = explored("MoBeE/DeepSea-v0", 600, "random")
    assert not (random.model.tries > 0).all()


def test_the_lake_is_learned_as_it_is() -> None:
    plant, agent = explored("FrozenLake-v1", 4000)
    table = plant.env.unwrapped.P  # type: ignore[attr-defined]  # of FrozenLake
    beliefs = agent.model.debiased()
    for state, action in ((0, 0), (0, 2), (4, 1)):
        truth, found = np.zeros((2, 16))
        for share, after, _, _ in table[state][action]:
            truth[after] += share
        np.add.at(found, beliefs.outcomes[state, action], beliefs.probabilities[state, action])
        assert found == pytest.approx(truth, abs=0.2)
    holes = [5, 7, 11, 12]
    assert (agent.model.tries[holes].sum(axis=1) > 0).all()
    for hole in holes:  # every action in a state where an episode ended leads to the next one's beginning
        assert {int(after) for action in range(4) for after in agent.model.bins(hole, action)[0]} <= {0, hole}


def test_a_truncated_episode_is_no_observation() -> None:
    env = gymnasium.make("MoBeE/RiverSwim-v0", length=4, max_episode_steps=3)
    plant = EnvPlant(env, seed=0)
    part, right = plant.space.part, plant.space.aim(0, 1)
    for _ in range(3):
        plant.act(part, right)
    with pytest.raises(mobee.ActionInterrupted, match="truncated"):
        plant.act(part, right)
    assert plant.state == 0 and plant.measure(part).tolist() == [0.0, 0.0]
    agent = mobee.CuriousAgent(plant.space, plant)
    agent.run(20)
    assert agent.transitions == agent.model.tries.sum() == 20
    beliefs = agent.model
    for state in range(1, 4):
        for action in range(2):
            assert all(abs(int(after) - state) <= 1 for after in beliefs.bins(state, action)[0])


def test_an_external_reward_is_pursued() -> None:
    plant = EnvPlant(gymnasium.make("FrozenLake-v1", is_slippery=False), seed=0)
    curious = mobee.CuriousAgent(plant.space, plant, beliefs="debiased")
    curious.run(1500)
    arrived = len([value for value in plant.returns if value > 0.0])
    assert plant.rewards[14, 2] == 1.0 and plant.rewards.sum() == 1.0
    greedy = EnvPlant(gymnasium.make("FrozenLake-v1", is_slippery=False), seed=0)
    agent = mobee.CuriousAgent(greedy.space, greedy, beliefs="debiased", goal=[15], goal_weight=1.0)
    agent.run(1500)
    assert len([value for value in greedy.returns if value > 0.0]) > 2 * arrived


def test_the_same_seed_and_a_store_give_the_same_agent(tmp_path: Path) -> None:
    def run(steps: int, store: TransitionStore | None) -> mobee.CuriousAgent:
        plant = EnvPlant(gymnasium.make("FrozenLake-v1"), seed=3)
        agent = mobee.CuriousAgent(plant.space, plant, store=store)
        agent.run(steps)
        return agent

    with TransitionStore(tmp_path / "lake.sqlite", "environment") as store:
        first = run(50, store)
    assert np.array_equal(first.model.counts, run(50, None).model.counts)
    with TransitionStore(tmp_path / "lake.sqlite", "environment") as store:
        again = run(0, store)
    assert np.array_equal(first.model.counts, again.model.counts)


def test_agents_run_on_it_together() -> None:
    plant = EnvPlant(gymnasium.make("CliffWalking-v1"), seed=0)
    mobee.run([agent := mobee.CuriousAgent(plant.space, plant)], 30)
    assert agent.transitions == 30
    assert plant.q.shape == (2,) and 0 <= plant.state < 48


def test_states_and_actions_may_begin_anywhere() -> None:
    class Shifted(gymnasium.Env[int, int]):
        observation_space, action_space = gymnasium.spaces.Discrete(3, start=5), gymnasium.spaces.Discrete(2, start=1)

        def reset(self, *, seed: int | None = None, options: Any = None) -> tuple[int, dict[str, Any]]:
            return 5, {}

        def step(self, action: int) -> tuple[int, float, bool, bool, dict[str, Any]]:
            assert action in (1, 2)
            return 4 + action, 0.0, False, False, {}

    plant = EnvPlant(Shifted())
    assert [int(plant.act("environment", plant.space.aim(0, action)).q[0]) for action in (0, 1)] == [0, 1]


def test_an_argument_that_is_a_function_has_the_same_record_in_every_process() -> None:
    def reward(*transition: Any) -> float:
        return 0.0

    options: dict[str, Any] = {"joints": ("l_shoulder_pitch", "l_elbow"), "neighbours": "equidistant"}
    recorded = EnvPlant(gymnasium.make("MoBeE/Lattice-v0", reward=reward, **options)).settings["arguments"]
    assert recorded["reward"].startswith("<function ") and " at 0x" not in recorded["reward"]
    assert recorded["neighbours"] == "'equidistant'"


def test_invalid_spaces_parts_and_actions_are_refused() -> None:
    with pytest.raises(mobee.InvalidValue, match="must be Discrete"):
        EnvPlant(gymnasium.make("CartPole-v1"))
    plant = EnvPlant(gymnasium.make("MoBeE/RiverSwim-v0"))
    with pytest.raises(mobee.UnknownName, match="Valid: environment"):
        plant.measure("left_arm")
    with pytest.raises(mobee.InvalidValue, match="action from 0 to 1"):
        plant.act("environment", np.array([0.0, 2.0]))
    with pytest.raises(mobee.InvalidValue, match="begin one first"):
        plant.advance()
    plant.begin("environment", plant.space.aim(0, 1))
    with pytest.raises(mobee.InvalidValue, match="under way"):
        plant.begin("environment", plant.space.aim(0, 1))
