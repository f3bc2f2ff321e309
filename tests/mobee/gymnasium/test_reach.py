# SPDX-License-Identifier: Apache-2.0
"""MoBeE/Reach-v0, alone and several at once."""

from __future__ import annotations

import warnings
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import mobee
from mobee.errors import InvalidValue, MobeeError
from mobee.gymnasium import LatticeEnv, LatticeVectorEnv, ReachEnv, ReachTask, ReachVectorEnv, TableEnv
from mobee.gymnasium.reach import extent
from mobee.gymnasium.robots import guarded


def test_gymnasium_finds_nothing_wrong() -> None:
    env = gymnasium.make("MoBeE/Reach-v0", render_mode="rgb_array")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(env.unwrapped)


def wander(env: ReachEnv, episodes: int) -> np.ndarray:
    """The deepest contacts of solids in each step of random actions, in m."""
    env.action_space.seed(0)
    depths = []
    for episode in range(episodes):
        env.reset(seed=episode)
        depths += [env.step(env.action_space.sample())[4]["solid_depth"] for _ in range(50)]
    return np.array(depths)


def test_random_actions_collide_with_nothing_unless_the_contact_forces_are_off() -> None:
    assert wander(ReachEnv(), 12).max() == 0.0
    unguarded = mobee.PlantSettings(dt=0.02, contact_forces=False)
    assert wander(ReachEnv(plant=unguarded), 12).max() > 0.02


def test_a_goal_is_a_place_where_the_arm_can_rest() -> None:
    env = ReachEnv(reward="dense")
    for seed in range(3):
        seen, info = env.reset(seed=seed)
        assert not info["is_success"] and env.observation_space.contains(seen)
    for name, place in seen.items():
        assert seen[name] is not env.reset(seed=2)[0][name] and np.array_equal(env.reset(seed=2)[0][name], place)
    seen, _ = env.reset(seed=2, options={"goal": seen["achieved_goal"] + [0.0, 0.0, 0.03]})
    _, reward, over, _, info = env.step(np.zeros(4))
    assert info["is_success"] and not over
    assert reward == pytest.approx(-0.03, abs=0.01)


def test_rewards_of_many_goals_at_once_are_those_of_each() -> None:
    rng = np.random.default_rng(0)
    achieved, desired = rng.normal(scale=0.04, size=(2, 30, 3))
    for kind in ("sparse", "dense"):
        env = ReachEnv(reward=kind)
        every = env.compute_reward(achieved, desired, [{}] * 30)
        assert every.tolist() == [float(env.compute_reward(a, d, {})) for a, d in zip(achieved, desired, strict=True)]
        distance = np.linalg.norm(achieved - desired, axis=1)
        assert np.array_equal(every, np.where(distance <= 0.05, 0.0, -1.0) if kind == "sparse" else -distance)
    seen, _ = env.reset(seed=0)
    seen, reward, *_ = env.step(np.ones(4))
    assert reward == env.compute_reward(seen["achieved_goal"], seen["desired_goal"], {})


def test_each_robot_of_a_vector_is_an_environment_of_its_own() -> None:
    vector = gymnasium.make_vec("MoBeE/Reach-v0", num_envs=3, max_episode_steps=4, threads=2, period=0.1)
    actions = np.random.default_rng(1).uniform(-1.0, 1.0, size=(11, 3, 4))
    seen, infos = vector.reset(seed=[3, 4, 5])
    found = [(seen, np.zeros(3), np.zeros(3, dtype=bool), infos)]
    for chosen in actions:
        seen, rewards, _, cut, infos = vector.step(chosen)
        assert vector.observation_space.contains(seen)
        found.append((seen, rewards, cut, infos))
    for number in range(3):
        alone, over = gymnasium.make("MoBeE/Reach-v0", max_episode_steps=4, period=0.1), False
        alone_seen, info = alone.reset(seed=3 + number)
        for step, (seen, rewards, cut, infos) in enumerate(found):
            if step and over:
                (alone_seen, info), reward, over = alone.reset(), 0.0, False
            elif step:
                alone_seen, reward, _, over, info = alone.step(actions[step - 1, number])
                assert infos["field_depth"][number] == info["field_depth"] and infos["_field_depth"][number]
                assert (rewards[number], cut[number]) == (reward, over)
            assert all(np.array_equal(seen[name][number], alone_seen[name]) for name in alone_seen)
            assert infos["is_success"][number] == info["is_success"]


def test_vectors_without_a_seed_differ_and_so_do_their_robots() -> None:
    goals = np.concatenate([ReachVectorEnv(2).reset()[0]["desired_goal"] for _ in range(2)])
    assert len(np.unique(goals, axis=0)) == 4


def test_a_vector_begins_with_the_goals_of_its_options() -> None:
    vector = gymnasium.make_vec("MoBeE/Reach-v0", num_envs=2, period=0.02)
    goals = np.array([[-0.3, 0.1, 0.1], [-0.2, 0.2, 0.0]])
    assert vector.reset(seed=0, options={"goal": goals})[0]["desired_goal"].tolist() == goals.tolist()
    with pytest.raises(gymnasium.error.Error, match="python integer"):
        vector.reset(seed=np.int64(3))  # type: ignore[arg-type]
    assert vector.reset(seed=0, options={"goal": goals[1]})[0]["desired_goal"].tolist() == goals[[1, 1]].tolist()
    with pytest.raises(InvalidValue, match=r"goal: \[0.0, 1.0\] is not a position"):
        vector.reset(options={"goal": [0.0, 1.0]})
    with pytest.raises(InvalidValue, match="not finite"):
        ReachEnv().reset(options={"goal": [0.0, np.nan, 0.0]})


def test_episodes_of_one_step_begin_again_all_at_once() -> None:
    vector = gymnasium.make_vec("MoBeE/Reach-v0", num_envs=2, max_episode_steps=1, period=0.02)
    vector.reset(seed=0)
    cuts = [vector.step(np.zeros((2, 4)))[3].tolist() for _ in range(4)]
    assert cuts == [[True, True], [False, False], [True, True], [False, False]]


def test_only_pairs_that_fields_keep_apart_are_tested() -> None:
    robot = mobee.load_robot("icub")
    kept = guarded(robot)
    assert guarded(robot) is kept
    names = {frozenset((robot.shapes[a].name, robot.shapes[b].name)) for a, b in kept.solid_pairs}
    assert frozenset(("root_link_3", "l_hand_index_3_0")) in names
    assert frozenset(("root_link_3", "l_upper_arm_0")) not in names


def test_no_pose_is_farther_than_the_extent() -> None:
    robot = mobee.load_robot("icub")
    q = np.random.default_rng(0).uniform(*robot.limits.T, size=(500, len(robot.motors)))
    far = np.abs(mobee.Model(robot).evaluate(q).position("left_palm")).max()
    assert far < extent(robot, "left_palm") < 3.0 * far


def test_a_task_without_a_place_to_rest_and_a_wrong_setting_are_refused() -> None:
    world = mobee.load_world("table")
    world.add("wall", mobee.box(3.0, 3.0, 3.0), position=(0.0, 0.0, 0.0))
    with pytest.raises(MobeeError, match="no goal found"):
        ReachEnv(world=world).reset(seed=0)
    wrong: dict[str, Any]
    for wrong in ({"period": 0.0}, {"reward": "large"}, {"marker": "left_plam"}, {"tolerance": -1.0}):
        with pytest.raises(MobeeError):
            ReachEnv(**wrong)
    with pytest.raises(InvalidValue, match="'right_palm' is moved by none of l_shoulder_pitch"):
        ReachEnv(marker="right_palm")
    assert ReachTask().reward == "sparse"


@pytest.mark.parametrize("made", [ReachEnv, LatticeEnv, TableEnv, ReachVectorEnv, LatticeVectorEnv])
def test_a_render_mode_that_draws_nothing_is_refused(made: Any) -> None:
    several = ', or vectorization_mode="sync", which can draw'
    with pytest.raises(InvalidValue, match=f"render_mode='human': give .*None{several if 'Vector' in made.__name__ else ''}.$"):
        made(render_mode="human")


@pytest.mark.parametrize("action", [0.5, [0.5], [0.5] * 3, np.zeros((4, 1)), [np.nan, 0.0, 0.0, 0.0], "left", [1j] * 4])
def test_an_action_that_is_not_a_number_for_each_joint_is_refused(action: Any) -> None:
    env = ReachEnv()
    env.reset(seed=0)
    before = env.plant.time
    with pytest.raises(InvalidValue, match="action"):
        env.step(action)
    assert env.plant.time == before


def test_wrong_numbers_of_robots_steps_seeds_and_actions_are_refused() -> None:
    for wrong in ({"num_envs": 0}, {"num_envs": 1.5}, {"max_episode_steps": 0}):
        with pytest.raises(InvalidValue, match=next(iter(wrong))):
            ReachVectorEnv(**wrong)
    envs = ReachVectorEnv(3)
    with pytest.raises(InvalidValue, match="2 seeds: give one for each of the 3 robots"):
        envs.reset(seed=[1, 2])
    for count in (2, 4):
        with pytest.raises(InvalidValue, match=r"shape \(3, 4\)"):
            envs.step(np.zeros((count, 4)))
