# SPDX-License-Identifier: Apache-2.0
"""MoBeE/Lattice-v0, alone and several at once."""

from __future__ import annotations

import warnings
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import mobee
from mobee.errors import InvalidValue
from mobee.gymnasium import LatticeEnv, LatticeVectorEnv
from mobee.robot.load import ROBOTS

PUBLISHED = mobee.PlantSettings(gains=mobee.Gains.published_2014(), dt=0.02)
SHORT: dict[str, Any] = {"joints": ("l_shoulder_pitch", "l_elbow"), "neighbours": "equidistant", "plant": PUBLISHED}


def test_gymnasium_finds_nothing_wrong() -> None:
    env = gymnasium.make("MoBeE/Lattice-v0", render_mode="rgb_array", **SHORT)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(env.unwrapped)
    assert env.spec is not None and env.spec.max_episode_steps == 200


def test_a_step_is_an_action_of_the_plant() -> None:
    env = LatticeEnv(**SHORT)
    state, info = env.reset(seed=4)
    twin = mobee.OfflinePlant(
        mobee.Model(mobee.load_robot("icub"), mobee.load_world("table")), env.plant.motors.seed, settings=PUBLISHED, active=["left_arm"]
    )
    for action in (0, 1, 0, 1):
        outcome = twin.act("left_arm", env.space.target(env.space.goal(state, action)))
        state, reward, over, cut, info = env.step(action)
        assert state == env.space.state_of(outcome.q)
        assert (reward, over, cut) == (0.0, False, False)
        assert np.array_equal(info["q"], outcome.q)
        assert (info["settled"], info["duration"], info["touched"]) == (outcome.settled, outcome.duration, outcome.touched)


def test_an_action_that_the_state_does_not_have_moves_nothing() -> None:
    env = LatticeEnv(**SHORT)
    _, info = env.reset(seed=0, options={"state": 0})
    assert info["action_mask"].tolist() == [1, 1, 0, 0]
    before = env.plant.time
    state, reward, over, _, info = env.step(3)
    assert (state, reward, over, info["valid"], info["duration"], env.plant.time) == (0, 0.0, False, False, 0.0, before)
    assert env.step(0)[4]["valid"]


def test_a_goal_ends_the_episode_and_gain_is_that_of_a_model() -> None:
    env = LatticeEnv(goal=1, reward="gain", **SHORT)
    env.reset(seed=0, options={"state": 0})
    model = mobee.TransitionModel(env.space)
    action = env.space.actions(0).tolist().index(1)
    state, reward, over, _, _ = env.step(action)
    assert (state, over) == (1, True)
    assert reward == 1.0 + model.observe(0, action, 1)
    assert env.learned is not None and env.learned.tries.sum() == 1
    env.reset()
    assert env.learned.tries.sum() == 1


def test_a_reward_of_the_user_sees_the_outcome() -> None:
    env = LatticeEnv(reward=lambda state, action, after, outcome: -outcome.duration, **SHORT)
    env.reset(seed=0)
    _, reward, _, _, info = env.step(0)
    assert reward == -info["duration"] < 0.0


def episodes(env: Any, seed: int, actions: np.ndarray) -> list[Any]:
    """The observations of one environment under these actions; a new episode begins where one ends, as in a vector environment."""
    seen = [env.reset(seed=seed)[0]]
    over = False
    for action in actions.tolist():
        if over:
            seen.append((env.reset()[0], 0.0, False, False))
            over = False
        else:
            state, reward, ended, cut, _ = env.step(action)
            seen.append((state, reward, ended, cut))
            over = ended or cut
    return seen


@pytest.mark.parametrize("threads", [1, 2])
def test_each_robot_of_a_vector_is_an_environment_of_its_own(threads: int) -> None:
    options: dict[str, Any] = {**SHORT, "goal": 4, "reward": "gain"}
    vector = gymnasium.make_vec("MoBeE/Lattice-v0", num_envs=3, max_episode_steps=4, threads=threads, **options)
    actions = np.random.default_rng(0).integers(4, size=(14, 3))
    states, infos = vector.reset(seed=7)
    rows: list[list[Any]] = [[state] for state in states.tolist()]
    assert infos["action_mask"].shape == (3, 4)
    for chosen in actions:
        states, rewards, over, cut, infos = vector.step(chosen)
        for row, *values in zip(rows, states.tolist(), rewards.tolist(), over.tolist(), cut.tolist(), strict=True):
            row.append(tuple(values))
        assert vector.observation_space.contains(states) and infos["q"].shape == (3, 16)
    for number, row in enumerate(rows):
        alone = gymnasium.make("MoBeE/Lattice-v0", max_episode_steps=4, **options)
        assert episodes(alone, 7 + number, actions[:, number]) == row
    assert any(step[2] for row in rows for step in row[1:]) and any(step[3] for row in rows for step in row[1:])


def test_a_robot_of_a_file_in_an_empty_world() -> None:
    env = LatticeEnv(robot=str(ROBOTS / "katana.xml"), joints=["arm_1", "arm_2"], levels=(0.4, 0.6), world=None)
    env.reset(seed=0)
    states = {env.step(action)[0] for action in (0, 1, 2, 0, 1)}
    assert len(states) > 1


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"goal": 99}, "no such state"),
        ({"reward": "money"}, "reward='money'"),
        ({"joints": ["l_elbow", "r_elbow"]}, "several parts"),
        ({"goals": 3}, "unknown setting 'goals'. Did you mean 'goal'"),
    ],
)
def test_a_wrong_setting_is_refused(changes: dict[str, Any], message: str) -> None:
    for kind in (LatticeEnv, LatticeVectorEnv):
        with pytest.raises(mobee.MobeeError, match=message):
            kind(**{**SHORT, **changes})


def test_an_action_or_a_state_that_is_no_number_of_one_is_refused() -> None:
    alone, both = LatticeEnv(**SHORT), LatticeVectorEnv(2, **SHORT)
    alone.reset(seed=0)
    both.reset(seed=0)
    for action in (1.7, float("nan"), [1, 2], None):
        with pytest.raises(InvalidValue, match="action"):
            alone.step(action)  # type: ignore[arg-type]
    for actions in ([1.0, 0.0], [1], [0, 0, 0], 1):
        with pytest.raises(InvalidValue, match="actions"):
            both.step(np.array(actions))
    for env in (alone, both):
        with pytest.raises(InvalidValue, match="give the number of one state"):
            env.reset(options={"state": [1, 2]})
    assert alone.reset(options={"state": np.int64(5)})[0] == 5


def test_a_picture_shows_what_moved() -> None:
    env = LatticeEnv("rgb_array", **SHORT)
    env.reset(seed=0)
    before = env.render()
    env.step(0)
    after = env.render()
    assert before is not None and after is not None and before.shape == after.shape and (before != after).any()
    assert LatticeEnv(**SHORT).render() is None
    with pytest.raises(InvalidValue):
        env.reset(options={"state": 9})
